# ruff: noqa: E501
"""Angles at the start that hardly can be meant: whose zero nothing says, and springs that start wound up."""

import numpy as np
import pytest

from hfsim.errors import DeckError
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

ARM = """hfsim: 1
bodies:
  arm: {{type: rigid, mass: 1.0, inertia: {inertia}, points: {{c: [-0.3, 0.0{z}]}}}}
  blade: {{type: rigid, mass: 1.0, inertia: {inertia}, points: {{in: [-1.0, 0.0{z}]}}}}
joints:
  w: {{type: fixed, between: [ground, arm.c], angle: 180 deg}}
  flap: {{type: revolute, between: [{ends}]{axis}}}
springs:
  fs: {{type: rotational, between: [arm, blade.in]{axis}, stiffness: 2000}}
solve: {{duration: 0.1}}
"""
PLANE = {"inertia": 0.1, "z": "", "axis": "", "ends": "arm, blade.in"}
SPACE = {"inertia": [0.1, 0.1, 0.1], "z": ", 0.0", "axis": ", axis: [0, -1, 0]", "ends": "arm, blade.in"}
FLIP = """hfsim: 1
bodies:
  flap: {type: rigid, mass: 1.0, inertia: [0.01, 0.1, 0.1], points: {in: [-0.3, 0, 0]}}
joints:
  hinge: {type: revolute, between: [ground, flap.in]}
springs:
  fs: {type: rotational, between: [ground, flap.in], stiffness: 10}
initial:
  flap: {orientation: {axis: [0, 1, 0], angle: 180 deg}}
solve: {duration: 0.1}
output: {channels: [hinge.angle]}
"""
OVER = "orientation={axis: [0, 1, 0], angle: 180 deg}"


def scene(text, *settings):
    return build(parse_deck(text, "start.yaml", settings))


def angle(found, name):
    return float(found.coordinate(name, "rad").measured(np.zeros(1), found.system.absolute(found.q[None]))[0][0])


@pytest.mark.parametrize("kind", [PLANE, SPACE, {**PLANE, "ends": "blade.in, arm"}], ids=["plane", "space", "back"])
def test_a_spring_that_nothing_states_to_be_wound_up_is_warned_of_with_what_states_it(kind):
    found = scene(ARM.format(**kind))
    (told,) = (one for one in found.warnings if "wound" in one)
    assert told.startswith("springs.fs (line 9): starts wound up by 3.142 rad (6283 N m), though nothing states that")
    assert abs(angle(found, "fs")) == pytest.approx(np.pi)
    stated = told.split("'initial: ")[1].split("' starts")[0]
    found = scene(ARM.format(**kind), f"initial={stated}")
    assert angle(found, "fs") == pytest.approx(0.0, abs=1e-12)
    assert not any("wound" in one for one in found.warnings)


BUSHING = "springs.fs={{type: bushing, between: [arm, blade.in], {}}}"


@pytest.mark.parametrize(
    ("kind", "stiffness", "moment"),
    [
        (PLANE, "rotational_stiffness: 20", "62.83"),
        (PLANE, "rotational_stiffness: 20, angle: 100 deg", "97.74"),
        ({**SPACE, "axis": ""}, "rotational_stiffness: [0, 0, 20]", "62.83"),
        ({**SPACE, "axis": ""}, "stiffness: 1, rotational_stiffness: 20", "62.83"),
    ],
)
def test_a_bushing_that_is_wound_up_is_warned_of_once_as_a_spring_is(kind, stiffness, moment):
    bushing = BUSHING.format(stiffness)
    found = scene(ARM.format(**kind), bushing)
    (told,) = (one for one in found.warnings if "wound" in one)
    assert told.startswith("springs.fs: starts wound up by ")
    assert f"({moment} N m), though nothing states that" in told
    stated = told.split("'initial: ")[1].split("' starts")[0]
    found = scene(ARM.format(**kind), bushing, f"initial={stated}")
    (tie,) = (one for one in found.ties("fs") if one.item in ("springs.fs.turn", "springs.fs.about_z"))
    x = found.system.absolute(found.q[None])
    assert tie.effort(np.zeros(1), x, 0.0 * x) == pytest.approx(0.0, abs=1e-9)
    assert not found.warnings


@pytest.mark.parametrize(
    ("kind", "spring"),
    [
        (PLANE, BUSHING.format("stiffness: 1, rotational_damping: 3")),
        (PLANE, "springs.fs={type: rotational, between: [arm, blade.in], damping: 3}"),
        (PLANE, BUSHING.format("rotational_stiffness: 20, angle: -100 deg")),
        ({**SPACE, "axis": ""}, BUSHING.format("rotational_stiffness: 20, angle: -100 deg")),
    ],
)
def test_dampers_are_not_wound_up_and_bushings_near_their_rest_are_not_either(kind, spring):
    assert not any("wound" in one for one in scene(ARM.format(**kind), spring).warnings)


@pytest.mark.parametrize(
    "setting",
    [
        "initial={flap: {angle: 180 deg}}",  # the joint states it
        "initial={blade: {angle: 0}}",  # the body does
        "initial={equilibrium: [blade]}",  # it starts at rest
        "springs.fs.rest_angle=-100 deg",  # it is at rest not so far off
        "joints.w.angle=80 deg",  # it is not wound up by so much
        "springs.fs.stiffness=0.0",  # it does not act
    ],
)
def test_springs_that_may_well_be_meant_are_not_warned_of(setting):
    assert not any("wound" in one for one in scene(ARM.format(**PLANE), setting).warnings)


def test_what_a_clock_winds_up_is_not_warned_of():
    found = scene(ARM.format(**PLANE), "joints.w.angle=0", "springs.fs.rest_angle=-5 rev")
    assert not any("wound" in one for one in found.warnings)


def test_an_angle_whose_axis_points_the_opposite_way_has_no_zero_until_an_orientation_says_it():
    found = scene(FLIP)
    told = [one for one in found.warnings if "where this angle is zero" in one]
    assert [one.split(" ")[0] for one in told] == ["springs.fs", "joints.hinge"]
    assert "'orientation: {axis: [0, 1, 0], angle: 180 deg}' does" in told[0]
    found = scene(FLIP, f"joints.hinge.{OVER}", f"springs.fs.{OVER}")
    assert not found.warnings
    assert angle(found, "hinge") == angle(found, "fs") == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("spring", "angles"),
    [("rotational_stiffness: 10", "its angles about x and z are zero: these axes"),
     ("rotational_damping: 1, orientation: {axis: [0, 1, 0], angle: 360 deg}", "its angles about x and z are zero: these axes"),
     ("rotational_stiffness: [10, 5, 0]", "its angle about x is zero: its axis"),
     ("rotational_stiffness: 10, angle: 180 deg", "its angles about y and z are zero: these axes"),
     ("stiffness: 10, rotational_stiffness: [0, 10, 0]", ""),
     (f"rotational_stiffness: 10, {OVER.replace('=', ': ')}", "")],
)  # fmt: skip
def test_a_bushing_that_starts_half_a_turn_from_rest_is_warned_of_as_other_springs_are(spring, angles):
    """Its energy was another one with each digit, and grew."""
    over = f"springs.m={{type: bushing, between: [ground, flap], {spring}}}"
    told = [one for one in scene(FLIP, "joints={}", "output.channels=[flap.x]", "springs={}", over).warnings if "nothing says" in one]
    starts = "point" if "axes" in angles else "points"
    expected = f"springs.m: nothing says where {angles} {starts} the opposite way in 'flap' ('{OVER.replace('=', ': ')}' does, where it starts)"
    assert told == ([expected] if angles else [])


def test_what_is_to_be_stated_of_a_start_without_a_turn_has_an_axis():
    level = scene(FLIP, "initial={}", f"springs.fs.{OVER}", "output.channels=[flap.x]")
    assert [one.partition("('")[2] for one in level.warnings if "nothing says" in one] == ["orientation: {axis: [0, 0, 1], angle: 0 deg}' does, where it starts)"]


def test_an_angle_that_nobody_asks_for_needs_no_zero():
    assert not scene(FLIP, "springs={}", "output.channels=[flap.x]").warnings


@pytest.mark.parametrize("kind", ["revolute", "cylindrical"])
@pytest.mark.parametrize("degrees", [0.0, 30.0, -170.0])
def test_angles_of_hinges_count_from_the_orientation_they_state(kind, degrees):
    text = FLIP.replace("revolute", kind)
    found = scene(text, f"joints.hinge.{OVER}", "springs={}", f"initial={{hinge: {{angle: {degrees} deg}}}}")
    assert angle(found, "hinge") == pytest.approx(np.radians(degrees), abs=1e-12)
    R = found.assembly.poses["flap"].turned(np.array([0.0, 0.0, 1.0]))
    assert pytest.approx([0.0, 0.0, -1.0], abs=1e-12) == R
    assert found.assembly.poses["flap"].turned(np.array([1.0, 0.0, 0.0]))[0] == pytest.approx(-np.cos(np.radians(degrees)))


def test_a_hinge_with_an_orientation_lets_the_other_body_start_so():
    found = scene(FLIP, f"joints.hinge.{OVER}", "springs={}", "initial={}")
    assert angle(found, "hinge") == pytest.approx(0.0, abs=1e-12)
    assert found.assembly.poses["flap"].turn == pytest.approx([0.0, np.pi, 0.0])


def test_a_stated_joint_angle_that_an_orientation_contradicts_by_half_a_turn_is_named():
    """Its equations hold with bodies turned over, which gaps of rounding at other joints are no reason for."""
    hub = FLIP.replace("bodies:", "bodies:\n  hub: {type: rigid, mass: 1.0, inertia: [1.0, 1.0, 1.0]}")
    hub = hub.replace("ground, flap.in", "hub, flap.in").replace("joints:", "joints:\n  shaft: {type: fixed, between: [ground, hub]}")
    with pytest.raises(DeckError, match=r"contradict this joint by 3\.14159 rad") as refusal:
        scene(hub, "initial.hinge={angle: 0}")
    assert refusal.value.problems[0].path == "initial.hinge.angle"


OVERTURNED = """hfsim: 1
ground: {points: {A: [0, 0, 0], B: [2.5, 0, 0]}}
bodies:
  b1: {type: rigid, mass: 1, inertia: [1, 1, 1], points: {s: [1, 0, 1]}}
  b2: {type: rigid, mass: 1, inertia: [1, 1, 1], points: {s: [1, 0, 1]}}
joints:
  s1: {type: spherical, between: [ground.A, b1.s]}
  h: {type: revolute, between: [b1, b2], axis: [0, 0, 1]}
  s2: {type: spherical, between: [ground.B, b2.s]}
solve: {duration: 0.01}
"""


def test_what_closes_with_an_axis_turned_over_alone_is_told_so_not_by_a_gap_of_rounding():
    with pytest.raises(DeckError, match="only with axes turned over") as refusal:
        scene(OVERTURNED)
    (problem,) = refusal.value.problems
    assert problem.path == "joints.h" and "state orientations" in problem.hint


@pytest.mark.parametrize("order", [("h", "k"), ("k", "h")])
def test_an_orientation_along_a_chain_holds_whatever_the_order_of_joints(order):
    joints = {
        "h": "{type: revolute, between: [ground, a]}",
        "k": "{type: revolute, between: [a.tip, b.root], orientation: {angle: 90 deg, axis: [0, 0, 1]}}",
    }
    text = """hfsim: 1
bodies:
  a: {type: rigid, mass: 1, inertia: [0.01, 0.1, 0.1], points: {tip: [0.5, 0, 0]}}
  b: {type: rigid, mass: 1, inertia: [0.01, 0.1, 0.1], points: {root: [-0.5, 0, 0]}}
joints: {%s}
solve: {duration: 0.5}
output: {channels: [h.angle, k.angle]}
"""
    found = scene(text % ", ".join(f"{name}: {joints[name]}" for name in order))
    x = found.system.absolute(found.q[None])
    angles = [found.coordinate(name, "rad").measured(np.zeros(1), x)[0][0] for name in "hk"]
    assert angles == pytest.approx([0.0, 0.0], abs=1e-12)
