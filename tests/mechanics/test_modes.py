"""Modes of linearised systems against closed forms, and of large systems against those of small ones."""

import numpy as np
import pytest

from hfsim.mechanics.modes import LargeModes, Modes, analytic_modes, modes_at_rest, modes_by_differences
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

BOB = """hfsim: 1
gravity: [0.0, -9.81]
bodies:
  bob: {{type: rigid, mass: 2.0, inertia: 0.3, points: {{pivot: [0.0, 0.7]}}}}
joints:
  pin: {{type: revolute, between: [ground, bob.pivot]}}
springs:
  coil: {{type: rotational, between: [ground, bob], stiffness: 5.0, damping: {damping}}}
solve: {{duration: 1.0}}
"""
BEAM = """hfsim: 1
materials: {steel: {density: 7800.0, youngs_modulus: 2.0e11}}
sections: {bar: {shape: rectangle, width: 0.02, height: 0.02}}
bodies:
  arm: {type: beam, material: steel, section: bar, length: 1.0, elements: 64}
joints:
  clamp: {type: fixed, between: [ground, arm.root]}
solve: {duration: 1.0}
"""
INERTIA = 0.3 + 2.0 * 0.7**2
STIFFNESS = 5.0 + 2.0 * 9.81 * 0.7


def modes_of(text, find, *settings):
    scene = build(parse_deck(text, overrides=settings))
    return find(scene.system, 0.0, scene.q, scene.v)


def analytic(system, t, q, v):
    return analytic_modes(system, t, q, v, 1000)


def at_rest(system, t, q, v):
    return modes_at_rest(system, t, q)


@pytest.mark.parametrize("find", [analytic, at_rest, modes_by_differences])
@pytest.mark.parametrize("damping", [0.0, 0.4])
@pytest.mark.parametrize("keep", ["solve.keep_all=true", "solve.keep_all=false"])
def test_a_pendulum_swings_at_its_own_frequency(find, damping, keep):
    modes = modes_of(BOB.format(damping=damping), find, keep)
    expected = np.roots([INERTIA, damping, STIFFNESS])
    assert np.sort_complex(modes.eigenvalues()) == pytest.approx(np.sort_complex(expected), rel=1e-5)
    frequency, shape = modes.fastest()
    assert frequency == pytest.approx(np.sqrt(STIFFNESS / INERTIA), rel=1e-6)
    assert np.abs(shape).max() == pytest.approx(1.0)


def test_a_clamped_beam_swings_as_euler_says_and_large_systems_as_small_ones():
    small = modes_of(BEAM, analytic, "bodies.arm.elements=8")
    low_order = "bodies.arm.elements=8", "solve.model=lowOrder"
    one, other = (modes_of(BEAM, find, *low_order).fastest()[0] for find in (at_rest, modes_by_differences))
    assert one == pytest.approx(other, rel=1e-7)
    bending = np.sqrt(2.0e11 * 0.02**4 / 12 / (7800.0 * 0.02**2))
    slowest = np.abs(small.eigenvalues().imag).min()
    assert slowest == pytest.approx(1.875104**2 * bending, rel=1e-4)
    scene = build(parse_deck(BEAM))
    large = analytic_modes(scene.system, 0.0, scene.q, scene.v, 0)
    assert isinstance(large, LargeModes)
    whole = Modes.of(large.equations)
    assert large.fastest()[0] == pytest.approx(whole.fastest()[0], rel=1e-8)
    found, every = (np.sort(np.abs(one.eigenvalues().imag)) for one in (large, whole))
    assert found[[0, 2, 4]] == pytest.approx(every[[0, 2, 4]], rel=1e-3)
