"""The shipped door: servo, friction, stop and latch in one hinge, against an equation of its own."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator

from hfsim.scene.loading import load_deck
from hfsim.simulate import simulate

DOOR = Path(__file__).parents[2] / "cases" / "door.yaml"
DEG = np.pi / 180
LATCH = np.array([[-DEG, -40.0], [0.0, 0.0], [DEG, 12.0], [3 * DEG, 3.0], [6 * DEG, 0.0], [120 * DEG, 0.0]])
RAIL = 0.5 * 2700 * np.pi * 0.005**2
INERTIA = 1.35 + 20 * 0.45**2 + RAIL * (0.5**2 / 12 + 0.9**2 + 0.25**2)
CURVE = PchipInterpolator(*LATCH.T)
MORE = ["solve.tolerance=1e-8", "solve.duration=2.0"]
CHANNELS = "output.channels=[leaf.angle, leaf.angular_velocity, hinge.moment, opener.moment]"


def torques(t, s, w):
    """Return those of the hinge, the servo and the latch."""
    missing, slower = 0.9 * (1 - np.cos(1.5 * t)) - s, 1.35 * np.sin(1.5 * t) - w
    servo = 40 * np.tanh((80 * missing + 20 * slower) / 40)
    depth = np.maximum((s - 1.5) / 1e-3, 0.0)
    y = np.minimum(depth, 1.0)
    push = 20.0 * (y**3 * (1 - 0.5 * y) + depth - y) * (0.5 * w + np.sqrt(1 + (0.5 * w) ** 2))
    inside = np.clip(s, -DEG, None)
    latch = CURVE(inside) + CURVE(inside, 1) * (s - inside)
    return -push - 1.5 * np.tanh(w / 0.01) - 0.5 * w, servo, -latch


def test_the_door_is_one_equation_of_motion_where_its_rail_is_rigid():
    run = simulate(load_deck(DOOR, ["solve.model=rigid", CHANNELS, *MORE]), error_estimate=False)
    angle, rate, hinge, opener = (channel.values for channel in run.channels)
    path = solve_ivp(
        lambda t, y: [y[1], sum(torques(t, *y)) / INERTIA],
        (0.0, 2.0),
        [0.0, 0.0],
        method="DOP853",
        rtol=1e-9,
        atol=1e-11,
        t_eval=run.t,
        max_step=0.005,
    )
    s, w = path.y
    assert angle == pytest.approx(s, abs=2e-6)
    assert rate == pytest.approx(w, abs=2e-4)
    of_hinge, of_servo, _ = torques(run.t, angle, rate)
    assert hinge == pytest.approx(of_hinge, abs=1e-7 * np.abs(of_hinge).max())
    assert opener == pytest.approx(of_servo, abs=1e-7 * 40)
    assert angle.max() == pytest.approx(1.518532, abs=3e-4)
    assert np.abs(of_servo).max() > 25.0 and np.abs(of_hinge).max() > 300.0


@pytest.mark.slow
def test_the_door_rings_and_keeps_account():
    """Its rail strikes with it, and hardly changes what the door does."""
    run = simulate(load_deck(DOOR), error_estimate=False)
    assert run["leaf.angle"].max() == pytest.approx(1.5184, abs=3e-4)
    assert run["leaf.angle"][-1] == pytest.approx(0.051195, abs=2e-4)
    assert np.abs(run["rail.tip.deflection"]).max() > 1e-3
    assert run.statistics["energy_drift"] < 1e-3
