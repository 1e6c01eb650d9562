"""Momentum and the centre of mass: closed forms of rigid bodies, and what no joint inside changes."""

import numpy as np
import pytest
from solved import solved

FLYING = """
hfsim: 1
gravity: [GRAVITY]
materials: {rubber: {density: 1150.0, youngs_modulus: 5.0e7}}
sections: {strip: {shape: rectangle, width: 5 cm, height: 3 cm}}
bodies:
  a: {type: beam, material: rubber, section: strip, length: 0.6, elements: 1}
  b: {type: rigid, mass: 0.5, inertia: INERTIA}
joints: {pin: {type: revolute, between: [a.tip, b]}}
initial: {a: {position: POSITION, velocity: VELOCITY, angular_velocity: SPIN}, b: {angular_velocity: OTHER}}
solve: {model: MODEL, duration: 0.5, tolerance: 1.0e-9}
output: {interval: 0.05, plots: false, channels: [CHANNELS]}
"""
PLANE = {"GRAVITY": "0.0, -2.0", "INERTIA": "0.01", "POSITION": "[1.0, 2.0]", "VELOCITY": "[1.0, 0.5]"}
PLANE |= {"SPIN": "9.0", "OTHER": "-3.0"}
SPACE = {"GRAVITY": "0.0, -2.0, 0.0", "INERTIA": "[0.01, 0.02, 0.015]", "POSITION": "[1.0, 2.0, 3.0]"}
SPACE |= {"VELOCITY": "[1.0, 0.5, -0.2]", "SPIN": "[0.0, 0.0, 9.0]", "OTHER": "[0.0, 0.0, -3.0]"}
BEAM = 1150.0 * 0.05 * 0.03 * 0.6


def flight(words, model):
    axes = "xyz" if words is SPACE else "xy"
    angular = [f"angular_{axis}" for axis in "xyz"] if words is SPACE else ["angular"]
    channels = [*(f"momentum.linear_{axis}" for axis in axes), *(f"momentum.{one}" for one in angular)]
    channels += [f"centre_of_mass.{axis}" for axis in axes]
    text = FLYING
    for old, new in (words | {"MODEL": model, "CHANNELS": ", ".join(channels)}).items():
        text = text.replace(old, new)
    values, run = solved(text)
    linear, angular, centre = np.split(values, [len(axes), len(axes) + len(angular)], axis=1)
    return run.t, linear, angular, centre


CASES = [(PLANE, model) for model in ("exact", "linear", "lowOrder", "rigid")]
CASES += [(SPACE, model) for model in ("exact", "linear", "rigid")]


@pytest.mark.parametrize(("words", "model"), CASES)
def test_the_centre_falls_and_moments_of_the_weight_add_up(words, model):
    t, linear, angular, centre = flight(words, model)
    mass, n_dim = BEAM + 0.5, linear.shape[1]
    start = np.array([1.0, 2.0, 3.0][:n_dim]) + np.eye(n_dim)[0] * (0.3 * BEAM + 0.6 * 0.5) / mass
    # the beam turns at 9 rad/s about its root, which has the velocity that is stated
    rate = np.array([1.0, 0.5, -0.2][:n_dim]) + np.eye(n_dim)[1] * 9.0 * (start[0] - 1.0)
    fall = np.eye(n_dim)[1] * -2.0
    way = start + t[:, None] * rate + 0.5 * t[:, None] ** 2 * fall
    assert centre == pytest.approx(way, abs=2e-6)
    assert linear == pytest.approx(mass * (rate + t[:, None] * fall), abs=2e-6)
    weight = np.cross(way, mass * fall) if n_dim == 3 else (way[:, 0] * mass * fall[1])[:, None]
    steps = 0.5 * (weight[1:] + weight[:-1]) * 0.05
    gained = np.concatenate([np.zeros((1, weight.shape[1])), np.cumsum(steps, axis=0)])
    # the moment is a quadratic of time, whose trapezoids err by the cube of their length
    assert angular - angular[0] == pytest.approx(gained, abs=1e-3)
    spin = 9.0 * (BEAM * 0.6**2 / 12.0) - 3.0 * (0.01 if n_dim == 2 else 0.015)
    apart = BEAM * 0.5 / mass * 0.3**2 * 9.0
    expected = spin + apart + mass * (start[0] * rate[1] - start[1] * rate[0])
    assert angular[0, -1] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("more", ["", ", weld.force_x"])
def test_the_centre_is_that_of_all_bodies_whatever_else_is_asked_for(more):
    """Those that are welded to the ground weigh too, though they need no coordinates."""
    text = f"""
hfsim: 1
gravity: [0.0, 0.0]
ground: {{points: {{there: [1.0, 0.5]}}}}
bodies: {{a: {{type: rigid, mass: 1.0, inertia: 0.1}}, b: {{type: rigid, mass: 3.0, inertia: 0.1}}}}
joints: {{weld: {{type: fixed, between: [ground.there, b]}}}}
initial: {{a: {{position: [0.0, 0.0], velocity: [0.4, 0.0]}}}}
solve: {{duration: 0.1}}
output: {{interval: 0.1, channels: [centre_of_mass.x, centre_of_mass.y{more}]}}
"""
    values, _ = solved(text)
    assert values[:, :2] == pytest.approx(np.array([[0.75, 0.375], [0.76, 0.375]]), abs=1e-12)
