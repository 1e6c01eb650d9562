"""Tables of one period, which repeat at all times."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from hfsim.deck.table_spec import TableSpec
from hfsim.errors import DeckError
from hfsim.integrators._replayed import Replay
from hfsim.marching.integration import run_integration
from hfsim.maths import kernel
from hfsim.output import api
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck

ROOT = Path(__file__).parents[2]
TIMES = [0.1, 0.15, 0.3, 0.42, 0.6]
VALUES = [0.5, 2.0, -1.0, 0.7, 0.5]
DECK = f"""
hfsim: 1
bodies: {{b: {{type: rigid, mass: 2, inertia: 0.1}}, c: {{type: rigid, mass: 1, inertia: 1}}}}
joints:
  rail: {{type: prismatic, between: [ground, b]}}
  cam: {{type: driver, between: [ground, c], angle: {{times: {TIMES}, values: {VALUES}, periodic: true}}}}
loads:
  push: {{type: force, at: b, force: [1, 0], law: {{times: {TIMES}, values: {VALUES}, periodic: true}}}}
solve: {{duration: 4.0, tolerance: 1.0e-8}}
output: {{channels: [b.x, b.vx, c.angle]}}
"""


def law(**more):
    return TableSpec(times=TIMES, values=VALUES, periodic=True, **more).build()


def test_values_rates_and_accelerations_repeat_and_do_not_jump():
    periodic, t = law(), np.linspace(-1.3, 2.7, 60).reshape(3, 20)
    for order, one in enumerate((periodic.value, periodic.rate, periodic.acceleration)):
        spline = CubicSpline(TIMES, VALUES, bc_type="periodic")
        np.testing.assert_allclose(one(t), spline(t, order), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(one(t + 0.5), one(t), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(one(0.1 + 1e-9), one(0.1 - 1e-9), atol=1e-3)
    straight = law(interpolation="linear")
    np.testing.assert_allclose(straight.value(t), np.interp(0.1 + (t - 0.1) % 0.5, TIMES, VALUES), atol=1e-12)


def test_a_spline_that_begins_with_a_jump_is_not_told_to_become_one():
    for more, table in (("", False), (", interpolation: linear", True)):
        with pytest.raises(DeckError, match="its rate jumps") as caught:
            parse_deck(DECK.replace("periodic: true}", f"periodic: true, start: 0.1{more}}}", 1))
        assert ("a table with interpolation: cubic" in str(caught.value)) is table


@pytest.mark.parametrize("order", [0, 2])
@pytest.mark.parametrize("more", [{}, {"interpolation": "linear"}, {"start": 0.37}])
def test_it_is_smooth_and_monotone_between_breaks(more, order):
    periodic = law(**more)
    derivative = periodic.value if order == 0 else periodic.acceleration
    breaks = periodic.breaks(order, 2.0)
    assert len(breaks) and breaks.min() > 0.0 and breaks.max() < 2.0
    for a, b in pairwise(np.unique([0.0, *breaks, 2.0])):
        if b - a > 1e-9:
            change = np.diff(derivative(np.linspace(a + 1e-12, b - 1e-12, 50)))
            assert (change >= -1e-9).all() or (change <= 1e-9).all()


def test_loads_and_drivers_follow_it_through_all_periods():
    run = api.run(parse_deck(DECK), error_estimate=False, diagnosis=False)
    spline = CubicSpline(TIMES, VALUES, bc_type="periodic")
    v, x, push = 0.0, 0.0, spline.integrate(0.1, 0.6) / 2.0
    for _ in range(8):
        x, v = x + 0.5 * v + shift(spline) / 2.0, v + push
    assert run["b.vx"][-1] == pytest.approx(v, abs=1e-9)
    assert run["b.x"][-1] == pytest.approx(x, abs=1e-8)
    assert np.unwrap(run["c.angle"]) == pytest.approx(spline(run.t), abs=1e-9)


def test_the_kernel_repeats_it_without_python(monkeypatch):
    monkeypatch.setattr(kernel, "KERNEL", "native")
    law = "{times: [0, 0.1, 0.2], values: [0, 1, 0], periodic: true}"
    push = f"loads.push={{type: force, at: leaf, force: [0, 1], law: {law}}}"
    scene = build(load_deck(ROOT / "cases/door.yaml", ["solve.duration=0.5", push]))
    assert run_integration(scene, scene.deck.solve).stop is None
    kept = [one for kept in scene.recordings.values() for one in kept.values()]
    steps = [one.recorded for one in kept if isinstance(one, Replay)]
    assert steps and all(one.calls == [] for one in steps)


def shift(spline):
    """The second integral over half a second from 0 on."""
    t, w = np.polynomial.legendre.leggauss(8)
    edges = np.unique([0.0, 0.5, *TIMES[:-1]])
    total = 0.0
    for a, b in pairwise(edges):
        s = 0.5 * (a + b) + 0.5 * (b - a) * t
        total += 0.5 * (b - a) * np.sum(w * (0.5 - s) * spline(s))
    return total


def test_the_last_value_is_the_first_and_nothing_else_is_asked(tmp_path):
    with pytest.raises(DeckError) as caught:
        parse_deck(DECK.replace("0.7, 0.5]", "0.7, 0.6]"), "cam.yaml")
    message = str(caught.value)
    assert "joints.cam.angle.values.4: a period ends with its first value, 0.5, not 0.6" in message
    assert "(repeat the first value at the end)" in message
    assert message.count("error: ") == 2
    (tmp_path / "gust.csv").write_text("t,f\n0,1\n1,2\n2,3\n")
    (tmp_path / "deck.yaml").write_text(
        DECK.replace(f"law: {{times: {TIMES}, values: {VALUES},", "law: {table: gust.csv,")
    )
    with pytest.raises(DeckError, match=r"gust.csv:4:3: error: loads.push.law.values.2: a period ends"):
        load_deck(tmp_path / "deck.yaml")
    (tmp_path / "gust.csv").write_text("t,f\n0,1\n1,2\n2,1\n")
    deck = load_deck(tmp_path / "deck.yaml").deck
    assert deck.resolved()["loads"]["push"]["law"]["periodic"] is True


def test_too_many_points_are_refused():
    with pytest.raises(DeckError, match=r"law.times: makes 1e\+07 points in the run"):
        parse_deck(DECK, overrides=["solve.duration=1e6", "joints.cam=null"])
