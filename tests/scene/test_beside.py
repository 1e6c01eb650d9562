# ruff: noqa: E501
"""Bodies beside loops that must be searched for: they start as they would without the search."""

import itertools

import numpy as np
import pytest

from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.scene.loops import Loops

PLANE = """hfsim: 1
ground: {{points: {{right: [0.4, 0.0]}}}}
bodies:
  crank: {{type: rigid, mass: 0.2, inertia: 2.0e-4, points: {{foot: [-0.05, 0.0], end: [0.05, 0.0]}}}}
  coupler: {{type: rigid, mass: 0.2, inertia: 2.0e-3, points: {{a: [-0.2, 0], b: [0.2, 0]}}}}
  rocker: {{type: rigid, mass: 0.4, inertia: 3.0e-3, points: {{foot: [-0.15, 0.0], end: [0.15, 0.0]}}}}
  {bodies}
joints:
  shaft: {{type: revolute, between: [ground, crank.foot]}}
  left: {{type: revolute, between: [crank.end, coupler.a]}}
  right: {{type: revolute, between: [coupler.b, rocker.end]}}
  pivot: {{type: revolute, between: [ground.right, rocker.foot]}}
  {joints}
initial: {{crank: {{angle: 0}}{initial}}}
solve: {{duration: 0.01}}
"""
SPACE = """hfsim: 1
ground: {{points: {{right: [0.4, 0.0, 0.0]}}}}
bodies:
  crank: {{type: rigid, mass: 0.2, inertia: [2.0e-4, 2.0e-4, 2.0e-4], points: {{foot: [-0.05, 0.0, 0.0], end: [0.05, 0.0, 0.0]}}}}
  coupler: {{type: rigid, mass: 0.2, inertia: [2.0e-3, 2.0e-3, 2.0e-3], points: {{a: [-0.2, 0, 0], b: [0.2, 0, 0]}}}}
  rocker: {{type: rigid, mass: 0.4, inertia: [3.0e-3, 3.0e-3, 3.0e-3], points: {{foot: [-0.15, 0.0, 0.0], end: [0.15, 0.0, 0.0]}}}}
  {bodies}
joints:
  shaft: {{type: revolute, between: [ground, crank.foot]}}
  left: {{type: spherical, between: [crank.end, coupler.a]}}
  right: {{type: universal, between: [coupler.b, rocker.end], axes: [[1, 0, 0], [0, 0, 1]]}}
  pivot: {{type: revolute, between: [ground.right, rocker.foot]}}
  {joints}
initial: {{crank: {{angle: 0}}{initial}}}
solve: {{duration: 0.01}}
"""
BALL = "ball: {type: rigid, mass: 0.3, inertia: 1.0e-4, points: {a: [-1.0, 0.0]}}"
BALL_3D = "ball: {type: rigid, mass: 0.3, inertia: [1.0e-4, 1.0e-4, 1.0e-4], points: {a: [-1.0, 0.0, 0.0]}}"


def poses(text, bodies="", joints="", initial=""):
    """Return the poses at the start of a deck with a loop that must be searched for, and of more bodies."""
    loaded = parse_deck(text.format(bodies=bodies, joints=joints, initial=initial))
    found = build(loaded).assembly.poses
    if text in (PLANE, SPACE):
        assert abs(found["rocker"].turn[-1]) > 1.0  # it was searched for
    return found


@pytest.mark.parametrize("hung", ["", "ground", "rocker.end", "coupler.b"])
def test_a_body_that_only_hangs_on_a_loop_is_not_turned_to_close_it(hung):
    """It was: by 162 deg if nothing holds it, by 153 deg on the ground, by 159 deg on the rocker."""
    joints = hung and f"hang: {{type: revolute, between: [{hung}, ball.a]}}"
    initial = "" if hung else ", ball: {position: [1, 1], velocity: [0, 0]}"
    found = poses(PLANE, BALL, joints, initial)
    alone = poses(PLANE)
    assert found["ball"].turn == pytest.approx(0.0, abs=1e-12)
    for name in ("crank", "coupler", "rocker"):
        assert found[name].turn == pytest.approx(alone[name].turn, abs=1e-8)


@pytest.mark.parametrize(
    "joints",
    [
        "on: {type: fixed, between: [rocker.end, ball.a], angle: 30 deg}",
        "hang: {type: revolute, between: [rocker.end, ball.a]}\n  on: {type: driver, between: [rocker, ball], angle: {type: constant_rate, rate: 1.0, start: 30 deg}}",
    ],
)
def test_what_a_loop_turns_by_its_joints_follows_it(joints):
    found = poses(PLANE, BALL, joints)
    assert found["ball"].turn - found["rocker"].turn == pytest.approx(np.radians(30.0), abs=1e-9)


@pytest.mark.parametrize(
    ("joint", "turn"),
    [("", 0.0), ("spherical, between: [rocker.end, ball.a]", 0.0), ("revolute, axis: [0, 1, 0], between: [rocker.end, ball.a]", None)],
)
def test_in_space_too(joint, turn):
    """A hinge whose axis the loop has turned by an angle turns what hangs on it by that, not more."""
    initial = "" if joint else ", ball: {position: [1, 1, 1], velocity: [0, 0, 0]}"
    found = poses(SPACE, BALL_3D, joint and f"hang: {{type: {joint}}}", initial)
    expected = found["rocker"].turn if turn is None else np.zeros(3)
    assert found["ball"].turn == pytest.approx(expected, abs=1e-9)


ROTOR = """hfsim: 1
bodies:
  "blade{{k=1..{n}}}": {{type: rigid, mass: 1.0, inertia: 0.1, points: {{root: [-0.5, 0.0]}}}}
  hub: {{type: rigid, mass: 1.0, inertia: 0.1}}
joints:
  axle: {{type: revolute, between: [ground, hub]}}
  "mount{{k=1..{n}}}": {{type: fixed, between: [hub, "blade{{k}}.root"], angle: "${{k * 360 / {n}}} deg"}}
solve: {{duration: 0.01}}
"""


@pytest.mark.parametrize("n", [2, 3, 4, 6])
def test_bodies_that_only_joints_between_them_turn_are_turned_from_the_one_nearest_to_the_ground(n):
    found = build(parse_deck(ROTOR.format(n=n))).assembly
    assert found.poses["hub"].turn == pytest.approx(0.0, abs=1e-12)
    angles = [found.poses[f"blade{k}"].turn[0] for k in range(1, n + 1)]
    assert angles == pytest.approx(2.0 * np.pi * np.arange(1, n + 1) / n)
    assert not found.closed


def test_rotors_beside_a_loop_stand_as_without_it():
    bodies = 'hub: {type: rigid, mass: 1.0, inertia: 0.1}\n  "blade{k=1..2}": {type: rigid, mass: 1.0, inertia: 0.1, points: {root: [-0.5, 0.0]}}'
    joints = 'axle: {type: revolute, between: [ground, hub]}\n  "mount{k=1..2}": {type: fixed, between: [hub, "blade{k}.root"], angle: "${k * 180} deg"}'
    found = poses(PLANE, bodies, joints)
    assert [found[name].turn[0] for name in ("hub", "blade1", "blade2")] == pytest.approx([0.0, np.pi, 2.0 * np.pi])


def test_loops_that_share_a_body_are_two_and_nested_ones_are_one():
    ring, beside = [(-1, 0), (0, 1), (1, -1)], [(0, 2), (2, 3), (3, 0)]
    loops = Loops.of(6, [*ring, *beside, (3, 4), (4, 3)])
    ways = {pair: loops.loop_of(pair) for pair in (*ring, *beside, (3, 4))}
    assert len({ways[pair] for pair in ring}) == len({ways[pair] for pair in beside}) == 1
    assert len(set(ways.values())) == 3
    assert set(loops.bodies([ways[0, 2]])) == {0, 2, 3}
    assert set(loops.inner) == set(range(6)) and loops.inner[5] == -1
    nested = Loops.of(4, [(-1, 0), (0, 1), (1, 2), (2, 3), (3, -1), (0, 2), (1, 3)])
    assert len({nested.loop_of(pair) for pair in itertools.pairwise((-1, 0, 1, 2, 3))}) == 1
