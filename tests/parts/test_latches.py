"""Latches: what holds a hinge or a slide for good from when it comes to its place."""

from functools import cache

import numpy as np
import pytest
import yaml
from natively import both, native
from scipy.integrate import solve_ivp
from solved import parsed

import hfsim
from hfsim.commands.init import starters
from hfsim.errors import DeckError
from hfsim.marching.integration import run_integration
from hfsim.mechanics import events
from hfsim.output.modes import state_warnings
from hfsim.scene.build import build
from hfsim.studies.static import run_static

PLACE, STIFFNESS, DAMPING = 0.5 * np.pi, 500.0, 0.5
FLAP = """
hfsim: 1
bodies: {flap: {type: rigid, mass: 4.0, inertia: 0.4, points: {edge: [-0.5, 0]}}}
joints:
  hinge: {type: revolute, between: [ground, flap.edge], latch: {angle: 90 deg, stiffness: 500, damping: 0.5}}
springs: {drive: {type: rotational, between: [ground, flap], stiffness: 0.2, rest_angle: 120 deg}}
initial: {hinge: {angle: 0.0}}
solve: {duration: 4.0}
output: {interval: 0.05, channels: [hinge.angle, hinge.torque, energy.total]}
"""
METHODS = {"gauss": 1e-7, "radau": 1e-7, "explicit": 1e-8, "energy": 1e-7, "gear": 1e-3}
METHODS["generalized_alpha"] = 0.05
"""And how far the angle may be off [rad]."""
IN_SPACE = """
hfsim: 1
gravity: [0.0, 0.0, 0.0]
materials: {nylon: {density: 1150, youngs_modulus: 3 GPa, poisson_ratio: 0.4, bending_damping: 1.0e-3}}
sections: {rod: {shape: circle, diameter: 3 cm}}
bodies:
  base: {type: rigid, mass: 5.0, inertia: [0.2, 0.3, 0.4], points: {side: [0.3, 0.1, 0.2]}}
  boom: {type: beam, material: nylon, section: rod, length: 0.8, elements: 1}
  ring: {type: rigid, mass: 0.5, inertia: [0.01, 0.01, 0.01]}
joints:
  hinge:
    type: revolute
    between: [base.side, boom.root]
    axis: [0, 1, 1]
    latch: {angle: 170 deg, stiffness: 200, damping: 1}
  sleeve:
    type: cylindrical
    between: [boom.tip, ring]
    axis: [1, 0, 0]
    sliding: {latch: {distance: 0.2, stiffness: 2000, damping: 2}}
    turning: {latch: {angle: -40 deg, stiffness: 5}}
springs:
  drive: {type: rotational, between: [base.side, boom.root], axis: [0, 1, 1], stiffness: 1, rest_angle: 4.4}
initial:
  base: {angular_velocity: [0.1, 0, 0.3]}
  sleeve: {distance: 0.0, distance_rate: 0.5, angle: 0.0, angular_velocity: -2.0}
solve: {duration: 1.5, tolerance: 1.0e-8}
output: {interval: 0.1, channels: [hinge.angle, sleeve.distance, sleeve.angle, momentum.linear_x]}
"""
AT_ITS_PLACE = {"initial.hinge.angle": "90 deg"}


@cache
def reference():
    """When the flap catches [s], and the angle as a function of the time from there on."""
    inertia, rest = 0.4 + 4.0 * 0.5**2, np.radians(120)

    def rates(t, y, held):
        latch = STIFFNESS * (y[0] - PLACE) + DAMPING * y[1] if held else 0.0
        return [y[1], -(0.2 * (y[0] - rest) + latch) / inertia]

    def there(t, y, held):
        return y[0] - PLACE

    there.terminal = True
    exact = {"rtol": 1e-12, "atol": 1e-13, "method": "DOP853"}
    before = solve_ivp(rates, (0.0, 4.0), [0.0, 0.0], events=there, args=(False,), **exact)
    after = solve_ivp(rates, (before.t[-1], 4.0), before.y[:, -1], dense_output=True, args=(True,), **exact)
    return before.t[-1], after.sol


@pytest.mark.parametrize("method", METHODS)
def test_a_flap_is_held_from_when_it_comes_to_its_place(method):
    caught, angle = reference()
    tolerance = 1e-7 if METHODS[method] > 1e-7 else 1e-9
    changes = {"solve.method": method, "solve.tolerance": tolerance}
    run = hfsim.run(parsed(FLAP), changes, error_estimate=False, diagnosis=False)
    assert run.statistics["latches"] == {"joints.hinge": pytest.approx(caught, abs=0.1 * METHODS[method])}
    later = run.t > caught
    assert later.sum() > 9 and (run["hinge.torque"][~later] == 0.0).all()
    np.testing.assert_allclose(run["hinge.angle"][later], angle(run.t[later])[0], atol=METHODS[method])
    s, w = angle(run.t[later])
    torque = -(STIFFNESS * (s - PLACE) + DAMPING * w)
    np.testing.assert_allclose(run["hinge.torque"][later], torque, atol=2.0 * STIFFNESS * METHODS[method])


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
def test_a_place_at_the_end_of_a_swing_catches(tolerance):
    """Which is passed by, and left again, within a small share of a step."""
    text = FLAP.replace("angle: 90 deg, stiffness: 500", "angle: 0.2998, stiffness: 500")
    text = text.replace("stiffness: 0.2, rest_angle: 120 deg", "stiffness: 10").replace(
        "{angle: 0.0}", "{angle: -0.3}"
    )
    changes = {"solve.method": "gauss", "solve.tolerance": tolerance, "solve.duration": 8.0}
    run = hfsim.run(parsed(text), changes, error_estimate=False, diagnosis=False)
    caught = (np.pi - np.arccos(0.2998 / 0.3)) / np.sqrt(10.0 / 1.4)
    assert run.statistics["latches"] == {"joints.hinge": pytest.approx(caught, abs=1e-4)}


def test_energy_goes_into_the_latch_and_its_damper_alone():
    run = hfsim.run(parsed(FLAP), {"solve.tolerance": 1e-9}, diagnosis=False)
    assert run.statistics["energy_drift"] < 1e-9
    assert run.statistics["error_estimate"] < 1e-5
    assert run["energy.total"][run.t < 3.4] == pytest.approx(run["energy.total"][0])
    assert run["energy.total"][-1] < 0.95 * run["energy.total"][0]


def test_fixed_steps_catch_at_the_end_of_the_one_that_passes():
    caught, _ = reference()
    run = hfsim.run(parsed(FLAP), {"solve.method": "gauss", "solve.step": 0.01}, error_estimate=False)
    assert 0.0 <= run.statistics["latches"]["joints.hinge"] - caught < 0.01 + 1e-9


def test_a_second_run_of_a_scene_begins_with_open_latches():
    scene = build(parsed(FLAP))
    first, second = (run_integration(scene, scene.deck.solve) for _ in range(2))
    assert len(first.trajectory.segments) == len(second.trajectory.segments)
    np.testing.assert_array_equal(first.trajectory.q, second.trajectory.q)
    half = [one for one in first.trajectory.segments if one.t < 2.0][-1]
    again = run_integration(scene, scene.deck.solve, start=(half.t, half.q, half.v))
    assert again.trajectory.q == pytest.approx(first.trajectory.q, abs=1e-5)


def caught_in_space(**changes):
    changes = {"solve.duration": 0.8, **changes}  # all have caught
    return hfsim.run(parsed(IN_SPACE), changes, error_estimate=False, diagnosis=False)


@native
def test_latches_in_space_catch_in_the_kernel_as_in_numpy(monkeypatch):
    one, other = both(monkeypatch, lambda: caught_in_space(**{"solve.tolerance": 1e-6}))
    assert one.statistics["native_steps"] > 10 and other.statistics["native_steps"] == 0
    caught = one.statistics["latches"]
    assert caught == pytest.approx(other.statistics["latches"], abs=1e-9)
    assert None not in caught.values() and len(caught) == 3
    for name in ("hinge.angle", "sleeve.distance", "sleeve.angle"):
        np.testing.assert_allclose(one[name], other[name], atol=1e-8)


def test_latches_in_space_feed_nothing_and_hold():
    run = caught_in_space()
    assert run.statistics["energy_drift"] < 1e-7
    np.testing.assert_allclose(run["momentum.linear_x"], run["momentum.linear_x"][0], atol=1e-7)
    assert run["sleeve.distance"][-1] == pytest.approx(0.2, abs=0.02)
    assert run["sleeve.angle"][-1] == pytest.approx(np.radians(-40), abs=0.4)


def test_what_starts_at_its_place_is_held_and_what_never_comes_there_is_open():
    held = hfsim.modes(parsed(FLAP), AT_ITS_PLACE)
    assert held.frequencies[0] == pytest.approx(np.sqrt(500.2 / 1.4) / (2 * np.pi), rel=1e-4)
    loose = hfsim.modes(parsed(FLAP))
    assert loose.frequencies[0] == pytest.approx(np.sqrt(0.2 / 1.4) / (2 * np.pi), rel=1e-4)
    run = hfsim.run(parsed(FLAP), {"solve.duration": 1.0}, error_estimate=False)
    assert run.statistics["latches"] == {"joints.hinge": None}


def test_a_rest_beyond_an_open_latch_is_told():
    beyond = run_static(parsed(FLAP))
    assert beyond.final["hinge.angle"] == pytest.approx(np.radians(120))
    assert "joints.hinge rests beyond the place of its latch" in "".join(beyond.statistics["warnings"])
    told = "".join(state_warnings(hfsim.modes(parsed(FLAP), about="equilibrium")))
    assert "joints.hinge rests beyond the place of its latch" in told
    held = hfsim.static(parsed(FLAP), AT_ITS_PLACE)
    assert held.final["hinge.angle"] == pytest.approx((500 * PLACE + 0.2 * np.radians(120)) / 500.2)
    assert not held.statistics["warnings"]


def test_latches_go_along_where_models_change():
    deck = yaml.safe_load(FLAP.replace("solve: {", "solve: {model: auto, model_error: 1.0e-4, "))
    deck["materials"] = {"nylon": {"density": 1150, "youngs_modulus": 3e9}}
    deck["sections"] = {"strip": {"shape": "rectangle", "width": 0.05, "height": 0.01}}
    arm = {"type": "beam", "material": "nylon", "section": "strip", "length": 1.0, "elements": 2}
    deck["bodies"]["arm"] = arm
    deck["joints"]["mount"] = {"type": "fixed", "between": ["flap", "arm.root"]}
    deck["solve"]["duration"] = 6.0
    auto = hfsim.run(parsed(deck), error_estimate=False)
    exact = hfsim.run(parsed(deck), {"solve.model": "exact"}, error_estimate=False)
    assert auto.statistics["auto"]["switches"]
    caught = [one.statistics["latches"]["joints.hinge"] for one in (auto, exact)]
    assert caught[0] == pytest.approx(caught[1], abs=1e-2)
    assert auto["hinge.angle"][-1] == pytest.approx(PLACE, abs=0.05)


def test_a_step_that_ends_before_the_place_by_its_error_is_followed_by_one_that_reaches_it(monkeypatch):
    monkeypatch.setattr(events, "ROUNDS", 0)
    run = hfsim.run(parsed(FLAP), {"solve.tolerance": 1e-9}, error_estimate=False)
    assert 0.0 < run.statistics["latches"]["joints.hinge"] - reference()[0] < 0.1


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ("{stiffness: 1}", "joints.hinge.latch.angle: missing key"),
        ("{angle: 90, stiffness: 1}", "90 rad are 14.3 turns"),
        ("{angle: 1, stiffness: 0}", "joints.hinge.latch.stiffness: must be greater than 0"),
        ("{distance: 1, stiffness: 1}", "joints.hinge.latch.distance: unknown key"),
    ],
)
def test_what_is_wrong_of_a_latch_is_told(entry, told):
    text = FLAP.replace("{angle: 90 deg, stiffness: 500, damping: 0.5}", entry)
    try:
        found = "".join(build(parsed(text)).warnings)
    except DeckError as error:
        found = str(error)
    assert told in found


@pytest.mark.parametrize(("method", "tolerance"), [("gauss", 1e-6), ("gauss", 1e-8), ("radau", 1e-8)])
def test_steps_that_end_where_a_latch_catches_keep_the_velocities(method, tolerance):
    """They may be ever so short: accelerations that follow from places are rounding there."""
    changes = {"solve.method": method, "solve.tolerance": tolerance, "solve.duration": 4.0}
    run = hfsim.run(parsed(starters()["solar_array"]), changes, error_estimate=False, diagnosis=False)
    assert sum(one is not None for one in run.statistics["latches"].values()) == 2
    assert abs(run["momentum.angular"][-1]) < 1e-6
