"""Brakes: friction whose level is scaled by a law of time."""

from pathlib import Path

import numpy as np
import pytest

from hfsim.errors import DeckError
from hfsim.integrators._replayed import Replay
from hfsim.marching.integration import run_integration
from hfsim.maths import kernel
from hfsim.output import api
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck

ROOT = Path(__file__).parents[2]
STEP = "{type: smooth_step, from: 0.0, to: 1.0, start: 0.5, end: 0.7}"
DIP = "{times: [0, 1.5, 1.5001, 1.5002, 3], values: [1, 1, -1, 1, 1], interpolation: linear}"
WHEEL = f"""
hfsim: 1
bodies: {{b: {{type: rigid, mass: 10.0, inertia: 0.5}}}}
joints:
  axle: {{type: revolute, between: [ground, b], friction: {{torque: 20.0, velocity: 0.01, law: {STEP}}}}}
initial: {{b: {{angular_velocity: 600 rpm}}}}
solve: {{duration: 3.0, tolerance: 1.0e-8}}
output: {{interval: 0.1, channels: [b.angular_velocity, axle.torque, axle.power]}}
"""
CART = (
    WHEEL.replace("revolute", "prismatic").replace("torque: 20.0", "force: 400.0")
    .replace("angular_velocity: 600 rpm", "velocity: [20 m/s, 0]").replace("axle.torque", "axle.force")
    .replace("b.angular_velocity", "b.vx")
)


@pytest.mark.parametrize(
    ("deck", "channel", "begun", "slowing"),
    [(WHEEL, "b.angular_velocity", 20 * np.pi, 40.0), (CART, "b.vx", 20.0, 40.0)],
)
def test_a_brake_slows_down_by_the_integral_of_its_law_and_holds(deck, channel, begun, slowing):
    run = api.run(parse_deck(deck), error_estimate=False, diagnosis=False)
    t, rate = run.t, run[channel]
    np.testing.assert_allclose(rate[t <= 0.5], begun, rtol=1e-12)
    later = (t > 0.69) & (t < 0.6 + 0.95 * begun / slowing)
    assert later.sum() >= 3
    np.testing.assert_allclose(rate[later], begun - slowing * (t[later] - 0.6), atol=1e-5)
    assert abs(rate[-1]) < 1e-9
    np.testing.assert_allclose(run["axle.power"][t <= 0.5], 0.0, atol=1e-12)


def test_steps_end_where_the_law_begins_and_the_kernel_calls_no_python(monkeypatch):
    monkeypatch.setattr(kernel, "KERNEL", "native")
    law = "joints.hinge.friction.law={type: sine, amplitude: 0.5, frequency: 10, offset: 1, start: 0.2}"
    scene = build(load_deck(ROOT / "cases/door.yaml", ["solve.duration=0.5", law]))
    done = run_integration(scene, scene.deck.solve)
    assert done.stop is None and 0.2 in done.trajectory.step_ends().tolist()
    kept = [one for kept in scene.recordings.values() for one in kept.values()]
    steps = [one.recorded for one in kept if isinstance(one, Replay)]
    assert steps and all(one.calls == [] for one in steps)


@pytest.mark.parametrize(
    ("law", "told"),
    [
        ("{type: sine, amplitude: 1, frequency: 2}", "is -1 at "),
        ("{type: sine, amplitude: 1.001, frequency: 2000, offset: 1}", "is -0.001 at "),
        ("{type: smooth_step, from: 0, to: -1, start: 1, end: 2}", "is -1 at "),
        ("{times: [0, 1, 2, 4], values: [0, 0, 1, 0]}", "is -0.22 at "),
        (DIP, "is -1 at 1.5 "),
        ("{expression: 1 - t}", "is -2 at 3 s, and friction never drives (at least 0 at all times)"),
    ],
)
def test_a_factor_that_becomes_negative_is_refused(law, told):
    with pytest.raises(DeckError) as caught:
        parse_deck(WHEEL.replace(STEP, law), "wheel.yaml")
    assert f"wheel.yaml:5:94: error: joints.axle.friction.law: {told}" in str(caught.value)


def test_beyond_its_end_a_table_has_no_factor_to_be_told():
    table = "{times: [0, 1, 2], values: [1, 2, 0.5], interpolation: linear}"
    with pytest.raises(DeckError) as caught:
        parse_deck(WHEEL.replace(STEP, table), "wheel.yaml")
    assert "covers 0 s to 2 s" in str(caught.value) and "1 error." in str(caught.value)


@pytest.mark.parametrize(
    "law", ["0.5", "{type: sine, amplitude: 1, frequency: 2000, offset: 1}", "{expression: t}"]
)
def test_a_factor_that_is_never_negative_is_taken(law):
    parse_deck(WHEEL.replace(STEP, law))
