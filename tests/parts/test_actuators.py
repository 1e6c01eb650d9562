# ruff: noqa: E501
"""Motors and servos, plane and space: closed forms, work, saturation, the reaction that channels show."""

import numpy as np
import pytest
import yaml
from test_joint_resistances import AXIS, MASS, run, scene, speeds

from hfsim.deck.laws import LinearLaw
from hfsim.errors import DeckError
from hfsim.maths.rotations import rotation_of_quaternion
from hfsim.mechanics.resistances import Control, Push
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

KINDS = [("revolute", False), ("revolute", True), ("prismatic", False), ("prismatic", True)]


def acted(joint, spatial, speed, actuator, **more):
    """The scene of one freedom with an actuator on it, by torque and angle or by force and position."""
    deck = scene(joint, spatial, speed, AXIS)
    turns = joint == "revolute"
    names = {"push": "torque" if turns else "force", "goal": "angle" if turns else "position"}
    entry = {names.get(key, key): value for key, value in actuator.items()}
    entry |= {"between": ["ground", "body"]} | ({"axis": AXIS.tolist()} if spatial else {})
    deck["joints"]["act"] = entry
    deck["output"]["channels"] += [f"joint.{one}" for one in (("force_x", "force_y"))]
    deck["output"]["channels"] += ["act.moment"] if turns and not spatial else [f"act.{'moment' if turns else 'force'}_x"]
    return deck | more


def own_speed(joint, spatial, result):
    v, w = speeds(result, spatial)
    return w if joint == "revolute" else v


@pytest.mark.parametrize(("joint", "spatial"), KINDS)
def test_a_motor_accelerates_by_its_torque(joint, spatial):
    law = {"type": "smooth_step", "from": 0.0, "to": 1.0, "start": 0.2, "end": 0.7}
    result = run(acted(joint, spatial, 0.5, {"type": "motor", "push": 3.0, "law": law}))
    shares = np.clip((result.t - 0.2) / 0.5, 0.0, 1.0)
    impulse = 0.5 * (2.5 * shares**4 - 3.0 * shares**5 + shares**6) + np.maximum(result.t - 0.7, 0.0)
    assert own_speed(joint, spatial, result) == pytest.approx(0.5 + 3.0 / MASS * impulse, abs=1e-7)
    assert result.statistics["energy_drift"] < 1e-8
    factor = shares**3 * (10 - 15 * shares + 6 * shares**2)
    assert result.channels[-1].values == pytest.approx(3.0 * factor * (AXIS[0] if spatial else 1.0), abs=1e-9)


@pytest.mark.parametrize(("joint", "spatial"), KINDS)
def test_a_servo_is_a_damped_oscillator_about_its_law(joint, spatial):
    """From rest to a constant goal, s = g (1 - e^(-a t) (cos w t + a / w sin w t))."""
    k, d, goal = 50.0, 4.0, 0.4
    result = run(acted(joint, spatial, 0.0, {"type": "servo", "goal": goal, "stiffness": k, "damping": d}))
    a = 0.5 * d / MASS
    w = np.sqrt(k / MASS - a * a)
    expected = goal * np.exp(-a * result.t) * (a * a / w + w) * np.sin(w * result.t)
    assert own_speed(joint, spatial, result) == pytest.approx(expected, abs=1e-7)
    assert result.statistics["energy_drift"] < 1e-8


def test_a_servo_that_follows_a_ramp_lags_by_nothing_in_the_end():
    """The rate is controlled too: there is no force in steady motion."""
    ramp = {"type": "constant_rate", "rate": 0.5}
    result = run(acted("prismatic", False, 0.0, {"type": "servo", "goal": ramp, "stiffness": 200.0, "damping": 40.0}))
    assert own_speed("prismatic", False, result)[-1] == pytest.approx(0.5, abs=1e-5)
    assert result.channels[-1].values[-1] == pytest.approx(0.0, abs=1e-4)


def test_a_limit_is_not_exceeded():
    servo = {"type": "servo", "goal": 2.0, "stiffness": 500.0, "damping": 20.0, "limit": 1.5}
    result = run(acted("revolute", False, 0.0, servo))
    torque = result.channels[-1].values
    assert np.abs(torque).max() <= 1.5
    assert own_speed("revolute", False, result)[:8] == pytest.approx(1.5 / MASS * result.t[:8], abs=1e-4)
    assert result.statistics["energy_drift"] < 1e-7


def test_the_pair_acts_on_both_bodies():
    """Two free bodies: momenta stay zero."""
    deck = {
        "hfsim": 1,
        "bodies": {"one": {"type": "rigid", "mass": 1.0, "inertia": 0.5}, "two": {"type": "rigid", "mass": 2.0, "inertia": 0.2}},
        "joints": {
            "pin": {"type": "revolute", "between": ["one", "two"]},
            "act": {"type": "motor", "between": ["one", "two"], "torque": 0.3},
        },
        "initial": {"one": {"velocity": [0.0, 0.0], "position": [0.0, 0.0]}},
        "solve": {"duration": 1.0, "tolerance": 1e-9},
        "output": {"plots": False, "channels": ["one.angular_velocity", "two.angular_velocity", "act.moment", "pin.moment"]},
    }
    result = run(deck)
    one, two, moment, hinge = (channel.values for channel in result.channels)
    assert two == pytest.approx(0.3 / 0.2 * result.t, abs=1e-8)
    assert one == pytest.approx(-0.3 / 0.5 * result.t, abs=1e-8)
    assert moment == pytest.approx(0.3)
    assert hinge == pytest.approx(0.0, abs=1e-12)


def test_a_torque_in_space_is_about_the_axis_however_far_b_tilts():
    """A ball whose spin tilts it through more than half a turn: about the axis it gains T t / J, across it nothing."""
    channels = [f"{name}_{axis}" for name in ("ball.angular_velocity", "act.moment") for axis in "xyz"]
    deck = {
        "hfsim": 1,
        "gravity": [0.0, 0.0, 0.0],
        "bodies": {"ball": {"type": "rigid", "mass": 1.0, "inertia": [1.0, 1.0, 1.0]}},
        "joints": {
            "pivot": {"type": "spherical", "between": ["ground", "ball"]},
            "act": {"type": "motor", "between": ["ground", "ball"], "torque": 2.0, "axis": [0.0, 0.0, 1.0]},
        },
        "initial": {"ball": {"angular_velocity": [3.0, 0.0, 0.0]}},
        "solve": {"duration": 1.2, "tolerance": 1e-9},
        "output": {"plots": False, "channels": channels},
    }
    result = run(deck)
    still = np.zeros_like(result.t)
    for channel, expected in zip(result.channels, (3.0 + still, still, 2.0 * result.t, still, still, 2.0 + still), strict=True):
        assert channel.values == pytest.approx(expected, abs=1e-8), channel.name
    assert result.statistics["energy_drift"] < 1e-9


def test_a_torque_in_space_keeps_the_momentum_of_two_free_bodies():
    """The axis is one of the first body, which tumbles; the work is what kinetic energy gains."""
    of = ("x", "y", "z", "vx", "vy", "vz", "angular_velocity_x", "angular_velocity_y", "angular_velocity_z")
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    body = {"type": "rigid", "inertia": [0.3, 0.3, 0.3]}
    deck = {
        "hfsim": 1,
        "gravity": [0.0, 0.0, 0.0],
        "bodies": {"one": body | {"mass": 1.0, "points": {"p": [0.3, 0.1, 0.0]}}, "two": body | {"mass": 2.0, "points": {"p": [-0.2, 0.0, 0.1]}}},
        "joints": {
            "pivot": {"type": "spherical", "between": ["one.p", "two.p"]},
            "act": {"type": "motor", "between": ["one", "two"], "torque": 0.7, "axis": axis.tolist()},
        },
        "initial": {"one": {"position": [0.0, 0.0, 0.0], "velocity": [0.0, 0.0, 0.0], "angular_velocity": [1.0, -2.0, 0.5]}, "two": {"angular_velocity": [-2.0, 1.0, 1.5]}},
        "solve": {"duration": 1.5, "tolerance": 1e-10},
        "output": {"plots": False, "channels": [*(f"{name}.{one}" for name in ("one", "two") for one in of), *(f"one.quaternion_{one}" for one in "wxyz"), *(f"act.moment_{one}" for one in "xyz")]},
    }
    result = run(deck)
    values = np.array([channel.values for channel in result.channels]).T
    states, turns, moment = values[:, :18].reshape(-1, 2, 3, 3), values[:, 18:22], values[:, 22:]
    mass = np.array([1.0, 2.0])[:, None]
    momentum = (mass * states[:, :, 1]).sum(axis=1)
    spin = (mass * np.cross(states[:, :, 0], states[:, :, 1]) + 0.3 * states[:, :, 2]).sum(axis=1)
    for kept in (momentum, spin):
        assert kept == pytest.approx(np.broadcast_to(kept[0], kept.shape), abs=1e-8)
    assert moment == pytest.approx(0.7 * np.array([rotation_of_quaternion(turn) @ axis for turn in turns]), abs=1e-8)
    assert result.statistics["energy_drift"] < 1e-9


def test_the_moment_of_a_hinge_is_what_it_resists_with():
    deck = scene("revolute", False, 1.5, resisted={"damping": 2.5})
    deck["output"]["channels"].append("joint.moment")
    result = run(deck)
    assert result.channels[-1].values == pytest.approx(-2.5 * speeds(result, False)[1], abs=1e-9)


@pytest.mark.parametrize("one", [Push(3.0), Push(3.0, LinearLaw(0.5, 2.0)), *(Control(LinearLaw(0.1, 2.0), 30.0, d, limit) for d in (0.0, 2.0) for limit in (None, 4.0))])
def test_slopes_are_those_of_the_force(one):
    s, w = (part.ravel() for part in np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-3, 3, 7)))
    t, h = np.full_like(s, 0.7), 1e-6
    by_s, by_w = one.slopes(t, s, w)
    assert by_s == pytest.approx((one.force(t, s + h, w) - one.force(t, s - h, w)) / (2 * h), abs=1e-6)
    assert by_w == pytest.approx((one.force(t, s, w + h) - one.force(t, s, w - h)) / (2 * h), abs=1e-6)
    assert not one.energy(s, s).any()
    assert one.exchanges_power


def test_units_of_a_servo_are_those_of_its_coordinate():
    deck = acted("prismatic", False, 0.0, {"type": "servo", "goal": "4 mm", "stiffness": "1 kN/m", "damping": "5 N s/m", "limit": "2 N"})
    del deck["output"]
    spec = parse_deck(yaml.safe_dump(deck)).deck.joints["act"]
    assert (spec.stiffness, spec.damping, spec.limit) == (1000.0, 5.0, 2.0)
    deck["joints"]["act"]["stiffness"] = "1 N m/rad"
    with pytest.raises(DeckError, match=r"act\.stiffness: must be a stiffness"):
        parse_deck(yaml.safe_dump(deck))
    deck["joints"]["act"]["stiffness"] = 3.0
    loaded = parse_deck(yaml.safe_dump(deck))
    assert parse_deck(yaml.safe_dump(loaded.deck.resolved())).deck.joints["act"] == loaded.deck.joints["act"]


def test_a_body_that_only_a_motor_turns_is_told_to_float():
    deck = acted("prismatic", False, 0.0, {"type": "motor", "push": 1.0})
    del deck["joints"]["joint"], deck["output"], deck["initial"]
    deck["joints"]["act"] = {"type": "motor", "between": ["ground", "body"], "torque": 1.0}
    (told,) = build(parse_deck(yaml.safe_dump(deck))).warnings
    assert "floats, though 'act' turns it" in told
