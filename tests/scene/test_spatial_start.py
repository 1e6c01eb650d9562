# ruff: noqa: E501
"""Starts in space: what is not stated of places, orientations and rates follows from the joints."""

import numpy as np
import pytest

from hfsim.errors import DeckError
from hfsim.maths.rotations import rotation
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

BODIES = """hfsim: 1
gravity: [0.0, 0.0, 0.0]
ground: {points: {o: [1.0, 2.0, 3.0]}}
bodies:
  hub: {type: rigid, mass: 1.0, inertia: [0.1, 0.2, 0.2], points: {rim: [0.5, 0.0, 0.0]}}
  arm: {type: rigid, mass: 1.0, inertia: [0.1, 0.2, 0.2], points: {root: [-0.4, 0.0, 0.1], tip: [0.4, 0.0, 0.0]}}
  bob: {type: rigid, mass: 1.0, inertia: [0.1, 0.2, 0.2], points: {hook: [0.0, 0.0, 0.3]}}
joints:
"""
AXLE = "  axle: {type: revolute, between: [ground.o, hub]}\n"
ELBOW = "  elbow: {type: revolute, between: [hub.rim, arm.root], axis: [0.0, 1.0, 0.0]}\n"
WELD = "  weld: {type: fixed, between: [hub.rim, arm.root]}\n"
WRIST = "  wrist: {type: revolute, between: [arm.tip, bob.hook], axis: [1.0, 0.0, 0.0]}\n"
MOTOR = "  motor: {type: driver, between: [ground.o, hub], angle: {type: constant_rate, rate: 3.0, start: 0.4}}\n"
CRANK = "  crank: {type: driver, between: [hub.rim, arm.root], axis: [0.0, 1.0, 0.0], angle: {type: constant_rate, rate: 2.0, start: -0.3}}\n"


def scene(joints, initial="", solve="solve: {duration: 1.0}\n"):
    return build(parse_deck(f"{BODIES}{joints}{initial and f'initial: {{{initial}}}'}\n{solve}output: {{channels: [bob.x]}}\n", "start.yaml"))


def turns(built):
    return {name: pose.turned(np.eye(3)).T for name, pose in built.assembly.poses.items()}


def spins(built):
    return {name: twist.spin for name, twist in built.assembly.twists.items()}


@pytest.mark.parametrize("turn", [[0.0, 0.0, 0.8], [0.0, 0.0, -2.5]])
def test_unstated_orientations_follow_along_hinges(turn):
    """About each axis as little as can be from the axes of the ground."""
    text = f"hub: {{orientation: {{rotation_vector: {turn}}}}}"
    built = scene(AXLE + ELBOW + WRIST, text)
    R, hub = turns(built), rotation(np.array(turn))
    y = hub @ [0.0, 1.0, 0.0]
    assert R["hub"] == pytest.approx(hub, abs=1e-12)
    assert R["arm"] @ [0.0, 1.0, 0.0] == pytest.approx(y, abs=1e-12)
    angle = np.arccos(0.5 * (np.trace(R["arm"]) - 1.0))
    assert angle == pytest.approx(np.arccos(y[1]), abs=1e-9)
    assert R["bob"] @ [1.0, 0.0, 0.0] == pytest.approx(R["arm"] @ [1.0, 0.0, 0.0], abs=1e-12)
    assert not built.assembly.changes


def test_driven_hinges_give_orientations_and_rates():
    built = scene(AXLE + MOTOR + ELBOW + CRANK + "  hold: {type: fixed, between: [arm.tip, bob.hook]}\n")
    hub = rotation(np.array([0.0, 0.0, 0.4]))
    arm = hub @ rotation(np.array([0.0, -0.3, 0.0]))
    R, w = turns(built), spins(built)
    for name, expected in (("hub", hub), ("arm", arm), ("bob", arm)):
        assert R[name] == pytest.approx(expected, abs=1e-12), name
    spin = np.array([0.0, 0.0, 3.0]) + hub @ [0.0, 2.0, 0.0]
    assert w["arm"] == pytest.approx(spin, abs=1e-12) and w["bob"] == pytest.approx(spin, abs=1e-12)
    tip = arm @ [0.4, 0.0, 0.0]
    place = np.array([1.0, 2.0, 3.0]) + hub @ [0.5, 0.0, 0.0] - arm @ [-0.4, 0.0, 0.1] + tip
    assert built.assembly.poses["bob"].origin == pytest.approx(place - arm @ [0.0, 0.0, 0.3], abs=1e-12)


@pytest.mark.parametrize(
    ("joint", "expected"),
    [
        (WELD, [0.0, 0.0, 2.0]),
        (ELBOW, [0.0, 0.0, 2.0]),
        (ELBOW.replace("[0.0, 1.0, 0.0]", "[0.0, 0.0, 1.0]"), [0.0, 0.0, 0.0]),
        (ELBOW.replace("[0.0, 1.0, 0.0]", "[0.0, 1.0, 1.0]"), [0.0, -1.0, 1.0]),
        ("  ball: {type: spherical, between: [hub.rim, arm.root]}\n", [0.0, 0.0, 0.0]),
        ("  cardan: {type: universal, between: [hub.rim, arm.root], axes: [[1, 0, 0], [0, 1, 0]]}\n", [0.0, 0.0, 2.0]),
    ],
)
def test_one_stated_rate_goes_on_as_far_as_joints_hold_it(joint, expected):
    """The rest of a spin that is not stated stays zero, as in the plane: none is made up where none is needed."""
    built = scene(AXLE + joint + WRIST, "hub: {angular_velocity: [0.0, 0.0, 2.0]}")
    w = spins(built)
    assert w["hub"] == pytest.approx([0.0, 0.0, 2.0], abs=1e-12)
    assert w["arm"] == pytest.approx(expected, abs=1e-10)
    across = np.array([1.0, 0.0, 0.0])
    relative = w["bob"] - w["arm"]
    assert relative - across * (relative @ across) == pytest.approx(np.zeros(3), abs=1e-10)
    assert w["bob"] @ across == pytest.approx(0.0, abs=1e-10)
    velocity = np.cross(w["hub"], [0.5, 0.0, 0.0]) - np.cross(w["arm"], [-0.4, 0.0, 0.1])
    assert built.assembly.twists["arm"].velocity == pytest.approx(velocity, abs=1e-10)


def test_a_rate_that_a_hinge_does_not_allow_is_named_with_its_size():
    with pytest.raises(DeckError) as refusal:
        scene(AXLE, "hub: {angular_velocity: [0.0, 1.5, 2.0]}")
    (problem,) = refusal.value.problems
    assert (problem.path, problem.line) == ("joints.axle", 9)
    assert "1.5 rad/s" in problem.message


def test_a_position_that_contradicts_a_joint_is_named_with_its_size():
    with pytest.raises(DeckError) as refusal:
        scene(AXLE, "hub: {position: [1.0, 2.0, 4.0]}")
    (problem,) = refusal.value.problems
    assert problem.path == "joints.axle"
    assert "by 1 m" in problem.message
