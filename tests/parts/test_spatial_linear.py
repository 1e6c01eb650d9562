"""The model linear in space: its force against its energy, and the stiffening that it loses."""

import numpy as np
import pytest
from analytical import jacobian
from beam_laws import check_rigid_motions

from hfsim.parts.bodies.linear import LinearElasticForce
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

GAMMA = 4.0
"""Angular velocity of the blade, times its time scale."""
BLADE = """hfsim: 1
gravity: [0.0, 1.0e-4, -1.0e-2]
materials:
  light: {{density: 100.0, youngs_modulus: 4.9e5, axial_damping: {damping}, bending_damping: {damping}}}
sections: {{bar: {{area: 0.01, second_moment: {moment}}}}}
bodies: {{b1: {{type: beam, material: light, section: bar, length: 1.0, elements: 2, element: cable}}}}
joints:
  hinge: {{type: revolute, between: [ground, b1.root]}}
  turn: {{type: driver, between: [ground, b1.root], angle: {{type: constant_rate, rate: {GAMMA}}}}}
initial: {{b1: {{angular_velocity: {GAMMA}}}}}
solve: {{model: linear, duration: 2.2, tolerance: 1.0e-6}}
output: {{interval: 0.005, channels: [b1.tip.deflection_y, b1.tip.deflection_z]}}
"""
FLAP, FREE = 5.58500142088482, 3.51601526850015
"""First flap frequency with the stiffening and without, of a clamped blade (Wright et al. 1982)."""


def deck(damping=0.0):
    return parse_deck(BLADE.format(damping=damping, moment=1.0 / 4.9e5, GAMMA=GAMMA))


def law_and_state(rng, damping=0.0):
    scene = build(deck(damping))
    part = next(one for one in scene.system.forces if isinstance(one, LinearElasticForce))
    x = scene.system.absolute(scene.q[None])[0]
    return scene, part, x + 0.1 * rng.normal(size=len(x))


def test_force_is_the_derivative_of_the_energy(rng):
    _, part, x = law_and_state(rng)
    out = np.zeros((1, len(x)))
    part.add_force(np.zeros(1), x[None], np.zeros_like(out), out)
    slope = jacobian(lambda moved: part.strain_energy(moved)[:, None], x)[0]
    assert out[0] == pytest.approx(-slope, abs=1e-7 * np.abs(slope).max())


def test_nothing_is_lost_without_damping(rng):
    _, part, x = law_and_state(rng)
    assert part.power(np.zeros(1), x[None], rng.normal(size=(1, len(x)))) == pytest.approx(0.0, abs=0.0)


def test_no_rigid_motion_is_resisted_nor_caused(rng):
    scene, part, x = law_and_state(rng, 0.1)
    check_rigid_motions(scene.bodies["b1"], part, x, rng)


@pytest.mark.parametrize(("model", "frequency"), [("exact", FLAP), ("linear", FREE)])
def test_flap_of_a_rotating_blade(model, frequency):
    """Released under weight, the tip is back where it began after a period."""
    result = simulate(deck(), model, error_estimate=False)
    assert result.status == "done", result.reason
    lag, flap = (c.values for c in result.channels)
    about = np.abs(result.t * frequency / (2.0 * np.pi) - 1.0) < 0.2
    period = result.t[about][np.argmax(flap[about])]
    assert 2.0 * np.pi / period == pytest.approx(frequency, rel=0.03)
    # in the plane of rotation it diverges without the stiffening: benchmark S5
    assert np.abs(lag).max() < 0.01 if model == "exact" else np.abs(lag[-1]) > 0.1
