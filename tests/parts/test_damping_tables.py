"""Dampers whose force a table tells by the rate: shock absorbers, valves."""

import numpy as np
import pytest
from natively import both, native
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator
from solved import parsed

import hfsim
from hfsim.errors import DeckError

ROWS = [[-1.0, -900.0], [-0.2, -400.0], [0.0, 0.0], [0.2, 150.0], [1.0, 300.0]]
CAR = f"""
hfsim: 1
gravity: [0.0, 0.0]
bodies: {{body: {{type: rigid, mass: 300.0, inertia: 1.0}}}}
joints:
  strut: {{type: prismatic, between: [ground, body], axis: [0, 1], damping_table: {ROWS}}}
springs: {{coil: {{type: two_point, between: [ground.low, body], stiffness: 15000.0, rest_length: 1.0}}}}
ground: {{points: {{low: [0.0, -1.0]}}}}
initial: {{strut: {{distance: 0.1, distance_rate: -2.0}}}}
solve: {{duration: 3.0, tolerance: 1.0e-9}}
output: {{interval: 0.05, channels: [strut.distance, strut.force, strut.power, energy.total]}}
"""


def test_a_shock_absorber_resists_by_its_table_and_straight_on_beyond():
    run = hfsim.run(parsed(CAR))
    inner = PchipInterpolator(*np.array(ROWS).T)

    def damper(w):
        inside = np.clip(w, -1.0, 1.0)
        return inner(inside) + inner.derivative()(inside) * (w - inside)

    def rates(t, y):
        return [y[1], -(15000.0 * y[0] + damper(y[1])) / 300.0]

    exact = solve_ivp(rates, (0.0, 3.0), [0.1, -2.0], t_eval=run.t, rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(run["strut.distance"], exact.y[0], atol=2e-7)
    np.testing.assert_allclose(run["strut.force"], -damper(exact.y[1]), atol=2e-3)
    assert (run["strut.power"] <= 1e-9).all() and (np.diff(run["energy.total"]) <= 1e-9).all()
    assert run.statistics["energy_drift"] < 1e-9


@native
def test_it_is_the_same_in_the_kernel_and_in_space(monkeypatch):
    text = """
hfsim: 1
gravity: [0.0, 0.0, -9.81]
bodies: {arm: {type: rigid, mass: 2.0, inertia: [0.1, 0.2, 0.3], points: {end: [-0.5, 0.0, 0.0]}}}
joints:
  pin:
    type: revolute
    between: [ground, arm.end]
    axis: [0, 1, 0]
    damping_table: [[-100 rpm, -2], [0, 0], [100 rpm, 5]]
springs: {band: {type: two_point, between: [ground.side, arm], stiffness: 9, damping_table: [[0, 0], [1, 3]]}}
ground: {points: {side: [0.0, 1.0, 0.5]}}
solve: {duration: 1.0, tolerance: 1.0e-8}
output: {interval: 0.1, channels: [pin.angle, pin.torque, band.force]}
"""
    one, other = both(monkeypatch, lambda: hfsim.run(parsed(text), error_estimate=False))
    assert one.statistics["native_steps"] and not other.statistics["native_steps"]
    for name in one.units:
        np.testing.assert_allclose(one[name], other[name], atol=1e-7)
    assert one.statistics["energy_drift"] < 1e-7


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        ("[[-1, -3], [1, 3]]", "damping_table: a damper has no force at rest (a row [0, 0] must be there)"),
        ("[[-1, 3], [0, 0], [1, 3]]", "damping_table.0: 3 at the rate -1 would drive, and a damper resists"),
        ("[[0, 0], [1, 3], [2, 2]]", "damping_table.2: the force falls at the end of the table"),
        ("[[0, 0], [1 rad/s, 3]]", "damping_table.1: must be a velocity [m/s]"),
    ],
)
def test_a_table_that_would_drive_is_refused(rows, told):
    with pytest.raises(DeckError) as caught:
        parsed(CAR.replace(str(ROWS), rows))
    assert f"joints.strut.{told}" in str(caught.value)
