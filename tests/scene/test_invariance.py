# ruff: noqa: E501
"""Where a scene is and how it is turned changes nothing: spatial scenes as a whole, planar ones posed in space."""

from copy import deepcopy
from pathlib import Path

import numpy as np
import posed
import pytest
import yaml

from hfsim.maths.rotations import rotation
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

R, SHIFT = rotation(np.array([0.9, -1.7, 0.6])), np.array([0.4, -2.0, 1.3])
EVERY = yaml.safe_load((Path(__file__).parents[2] / "cases" / "joints.yaml").read_text("utf-8"))
"""The shipped case with every kind of joint, spring and load."""
EVERY["solve"], EVERY["output"]["interval"] = {"duration": 0.3, "tolerance": 1e-11}, 0.1


def run(deck):
    return simulate(parse_deck(yaml.safe_dump(deck), "deck.yaml"), error_estimate=False)


def values(result):
    return np.array([channel.values for channel in result.channels])


@pytest.fixture(scope="module")
def every():
    return run(EVERY)


def test_one_deck_with_every_joint_keeps_its_joints_and_its_energy(every):
    assert every.status == "done"
    assert every.statistics["energy_drift"] < 1e-10
    assert every.statistics["constraint_position"] < 1e-12
    assert np.ptp(values(every)[:3], axis=1).max() > 0.1


def test_a_spatial_scene_turned_and_shifted_does_the_same(every):
    here, there = values(every), values(run(posed.moved(EVERY, R, SHIFT)))
    lifted = there[-1] - here[-1]  # the weight of all, moved with the ground's origin where it was
    assert lifted == pytest.approx(np.full(len(lifted), lifted[0]), abs=1e-9 * np.abs(there[-1]).max())
    for k in range(0, 18, 3):
        vector = R @ here[k : k + 3] + (SHIFT[:, None] if k < 9 else 0.0)
        scale = max(1.0, np.abs(here[k : k + 3]).max())
        assert there[k : k + 3] == pytest.approx(vector, abs=1e-9 * scale), every.channels[k].name


@pytest.mark.parametrize("kind", ["revolute", "spherical", "universal", "cylindrical", "prismatic", "fixed"])
@pytest.mark.parametrize("on", ["ground", "body"])
def test_each_joint_in_a_small_mechanism(kind, on):
    """A body on the ground by it, or on one that swings from a ball; nothing is lost, whatever the orientation."""
    deck = {
        "hfsim": 1,
        "gravity": [0.0, 0.0, -9.81],
        "ground": {"points": {"o": [0.0, 0.0, 0.0]}},
        "bodies": {
            "one": {"type": "rigid", "mass": 1.0, "inertia": [0.1, 0.2, 0.15], "points": {"a": [0, 0, 0.4], "b": [0.1, 0, -0.4]}},
            "two": {"type": "rigid", "mass": 0.7, "inertia": [0.05, 0.04, 0.08], "points": {"a": [0.1, 0.3, 0.2]}},
        },
        "joints": {"ball": {"type": "spherical", "between": ["ground.o", "one.a"]}},
        "initial": {
            "one": {"orientation": posed.axes(rotation(np.array([0.3, -0.5, 1.0]))), "angular_velocity": [1.0, 0.5, -0.7]},
            "two": {"orientation": posed.axes(rotation(np.array([0.3, -0.5, 1.0])))},
        },
        "solve": {"duration": 1.0, "tolerance": 1e-10},
        "output": {"interval": 0.1, "channels": ["two.a.x", "two.a.y", "two.a.z", "energy.total"]},
    }
    ends = ["one.b", "two.a"]
    if on == "ground":
        ends = ["ground.o", "two.a"]
        deck["bodies"].pop("one"), deck["joints"].clear(), deck["initial"].pop("one")
    joint = {"type": kind, "between": ends}
    if kind in ("revolute", "cylindrical", "prismatic"):
        joint["axis"] = [0.2, 1.0, 0.3]
    if on == "ground" and kind in ("prismatic", "universal", "fixed"):
        joint["orientation"] = deck["initial"]["two"]["orientation"]
    if (on, kind) == ("ground", "fixed"):
        deck["bodies"]["free"] = {"type": "rigid", "mass": 1.0, "inertia": [1.0, 1.0, 1.0]}
        deck["initial"]["free"] = {"orientation": posed.axes(np.eye(3)), "velocity": [1.0, 0.0, 0.0]}
        deck["solve"]["keep"] = ["fixed_bodies"]
    if kind in ("cylindrical", "prismatic"):
        place = posed.matrix(deck["initial"]["two"]) @ ([0.1, 0.0, -0.8] if on == "body" else np.zeros(3))
        deck["initial"]["two"]["position"] = posed.plain(place - posed.matrix(deck["initial"]["two"]) @ [0.1, 0.3, 0.2])
    deck["joints"][kind] = joint
    found = run(deck)
    assert found.status == "done"
    assert found.statistics["energy_drift"] < 1e-10
    assert found.statistics["constraint_position"] < 1e-12
    here, there = values(found), values(run(posed.moved(deck, R, SHIFT)))
    assert there[:3] == pytest.approx(R @ here[:3] + SHIFT[:, None], abs=1e-9)


PLANE = yaml.safe_load("""
hfsim: 1
gravity: [0.5, -9.81]
materials: {rubber: {density: 1100.0, youngs_modulus: 5.0e5}}
sections: {bar: {shape: circle, diameter: 0.03}}
ground: {points: {rail: [-1.0, 0.5]}}
bodies:
  hub: {type: rigid, mass: 1.0, inertia: 0.1, points: {rim: [0.3, 0.0]}}
  arm: {type: beam, element: cable, material: rubber, section: bar, length: 0.8, elements: 2}
  rope: {type: beam, element: cable, material: rubber, section: bar, length: 0.5, elements: 2}
  bob: {type: rigid, mass: 0.3, inertia: 0.01, points: {hook: [-0.1, 0.0]}}
  cart: {type: rigid, mass: 1.0, inertia: 0.2}
joints:
  axle: {type: revolute, between: [ground, hub]}
  mount: {type: fixed, between: [hub.rim, arm.root], angle: 0.2}
  elbow: {type: revolute, between: [arm.tip, rope.root]}
  hook: {type: revolute, between: [rope.tip, bob.hook]}
  rail: {type: prismatic, between: [ground.rail, cart], axis: [1.0, 0.0]}
  push: {type: driver, between: [ground.rail, cart], axis: [1.0, 0.0], position: {type: sine, amplitude: 0.2, frequency: 1.0}}
springs:
  coil: {type: rotational, between: [ground, hub], stiffness: 3.0, damping: 0.1, rest_angle: -0.2}
  band: {type: two_point, between: [cart, bob], stiffness: 4.0, damping: 0.1}
loads:
  tip: {type: force, at: arm.tip, force: [1.0, 0.5]}
  turn: {type: moment, at: hub, moment: 0.6}
initial:
  hub: {angle: 0.3, angular_velocity: 1.0}
  arm: {angle: 0.5}
  rope: {angle: -1.0}
  bob: {angle: -1.2, angular_velocity: 0.5}
  cart: {angle: 0.0}
solve: {duration: 0.1, tolerance: 1.0e-11}
output: {interval: 0.05, channels: [arm.tip.x, arm.tip.y, bob.x, bob.y, rope.tip.x, rope.tip.y, energy.total]}
""")
DRIVEN = {"motor": {"type": "driver", "between": ["ground", "hub"], "angle": {"type": "sine", "amplitude": 0.8, "frequency": 0.7, "offset": 0.3}}}


@pytest.mark.parametrize(("driven", "element"), [(False, "cable"), (True, "cable"), (True, "cosserat")])
def test_a_planar_scene_posed_in_space_does_the_same(driven, element):
    """Rigid bodies and beams, hinges, clamps, slides, springs, drivers, loads."""
    plane = deepcopy({**PLANE, "joints": {**PLANE["joints"], **(DRIVEN if driven else {})}})
    for beam in ("arm", "rope") if element == "cosserat" else ():
        plane["bodies"][beam] |= {"element": element, "elements": 1, "degree": 2}
        plane["solve"]["duration"] = 0.03
    if driven:
        plane["initial"] = {**plane["initial"], "hub": {"angle": 0.3}}
    space = posed.in_space(plane, R, SHIFT)
    points = ["arm.tip", "bob", "rope.tip"]
    space["output"] = {"interval": 0.05, "channels": [*(f"{point}.{axis}" for point in points for axis in "xyz"), "energy.total"]}
    here, there = values(run(plane)), values(run(space))
    for k in range(3):
        own = R.T @ (there[3 * k : 3 * k + 3] - SHIFT[:, None])
        assert own[:2] == pytest.approx(here[2 * k : 2 * k + 2], abs=1e-9)
        assert np.abs(own[2]).max() < 1e-9
    shift = np.array(space["gravity"]) @ SHIFT
    mass = there[-1] - here[-1]
    assert mass == pytest.approx(np.full(len(mass), mass[0]), abs=1e-8 * max(1.0, abs(shift)))


def test_a_posed_scene_has_the_free_motions_of_the_plane():
    built = [build(parse_deck(yaml.safe_dump(deck))) for deck in (PLANE, posed.in_space(PLANE, R, SHIFT))]
    plane, space = (sum(motion.number for motion in one.free_motions) for one in built)
    assert (plane, space) == (3, 5)


BEAMS = yaml.safe_load("""
hfsim: 1
gravity: [0.0, 0.0, -9.81]
materials: {rubber: {density: 1100.0, youngs_modulus: 5.0e5, poisson_ratio: 0.4}}
sections: {bar: {shape: rectangle, width: 0.04, height: 0.04}}
ground: {points: {wall: [0.0, 0.0, 0.5]}}
bodies:
  arm: {type: beam, element: ELEMENT, material: rubber, section: bar, length: 0.5, elements: 1}
  bob: {type: rigid, mass: 0.2, inertia: [0.001, 0.002, 0.002], points: {hook: [-0.05, 0.02, 0.0]}}
joints:
  clamp: {type: fixed, between: [ground.wall, arm.root], orientation: {x: [0.6, 0.8, 0.0], y: [-0.8, 0.6, 0.0]}}
  pin: {type: revolute, between: [arm.tip, bob.hook], axis: [0.0, 1.0, 0.0]}
loads: {push: {type: force, at: bob, force: [0.2, -0.1, 0.3]}}
initial:
  arm: {orientation: {x: [0.6, 0.8, 0.0], y: [-0.8, 0.6, 0.0]}}
  bob: {orientation: {x: [0.6, 0.8, 0.0], y: [-0.8, 0.6, 0.0]}}
solve: {duration: 0.07, tolerance: 1.0e-10}
output: {interval: 0.05, channels: [arm.tip.x, arm.tip.y, arm.tip.z, bob.x, bob.y, bob.z]}
""")


@pytest.mark.parametrize(("element", "height"), [("cable", 0.04), ("cosserat", 0.03)])
def test_a_scene_with_a_beam_turned_and_shifted_does_the_same(element, height):
    bar = {**BEAMS["sections"]["bar"], "height": height}
    deck = {**BEAMS, "sections": {"bar": bar}, "bodies": {**BEAMS["bodies"], "arm": {**BEAMS["bodies"]["arm"], "element": element}}}
    here, there = values(run(deck)), values(run(posed.moved(deck, R, SHIFT)))
    assert np.ptp(here, axis=1).max() > 0.01
    for k in (0, 3):
        assert there[k : k + 3] == pytest.approx(R @ here[k : k + 3] + SHIFT[:, None], abs=1e-9)


LAID = """
hfsim: 1
gravity: {gravity}
materials: {{soft: {{density: 5540.0, youngs_modulus: 7.0e+6, poisson_ratio: 0.3}}}}
sections: {{strip: {{shape: rectangle, width: 0.02, height: 0.009}}}}
bodies:
{bodies}
joints:
{joints}
initial: {{b: {{angle: {angle}, position: {start}, angular_velocity: {rate}}}}}
solve: {{duration: 0.3, tolerance: 1.0e-9}}
output: {{interval: 0.1, channels: [b.{free}.x, b.{free}.y, b.{free}.v{last}, bob.{last}, energy.total]}}
"""


def laid(dimension, element, turned=False, last_first=False):
    """Return channels of a beam that hangs by its root, or by its tip, with a body at the other end."""
    held, free, angle = ("tip", "root", "180 deg") if turned else ("root", "tip", "0")
    space = dimension == 3
    order = -1 if last_first else 1
    bodies = [
        f"  b: {{type: beam, material: soft, section: strip, length: 1.2, elements: 3, {element}}}",
        f"  bob: {{type: rigid, mass: 0.5, inertia: {[0.01, 0.012, 0.015] if space else 0.01}}}",
    ]
    joints = [
        f"  pin: {{type: {'spherical' if space else 'revolute'}, between: [ground, b.{held}]}}",
        f"  weld: {{type: fixed, between: [b.{free}, bob], angle: {angle}}}",
    ]
    run = simulate(
        parse_deck(
            LAID.format(
                gravity=[0.0, -9.81, 0.0][:dimension], angle=angle, free=free, last="xyz"[dimension - 1],
                start=[1.2 if turned else 0.0, 0.0, 0.0][:dimension], rate=[0.3, 0.2, 1.0] if space else 1.0,
                bodies="\n".join(bodies[::order]), joints="\n".join(joints[::order]),
            )
        ),
        error_estimate=False,
    )  # fmt: skip
    return values(run)


@pytest.mark.parametrize(
    ("dimension", "element"),
    [
        (2, "element: cable"),
        (2, "element: cable, degree: 5, strain: engineering, curvature: exact"),
        (2, "element: cosserat"),
        (2, "element: continuum, section_degree: 2"),
        (3, "element: cosserat"),
        (3, "element: continuum, section_degree: 2"),
    ],
)
def test_which_end_of_a_beam_is_its_root_and_what_comes_first_changes_nothing(dimension, element):
    here = laid(dimension, element)
    assert np.ptp(here[0]) > 0.1
    assert laid(dimension, element, turned=True)[:-1] == pytest.approx(here[:-1], abs=1e-10)
    assert laid(dimension, element, last_first=True) == pytest.approx(here, abs=1e-10)
