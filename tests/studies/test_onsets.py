"""Where rotors begin to grow, and what grows: against roots of their own equations."""

import numpy as np
import pytest

import hfsim
from hfsim.scene.loading import parse_deck

SLOT = """hfsim: 1
name: slot
bodies:
  hub: {type: rigid, mass: 1.0, inertia: 1.0, points: {q: [-1, 0]}}
  p: {type: rigid, mass: 2.0, inertia: 0.1}
joints:
  axle: {type: revolute, between: [ground, hub]}
  slot: {type: prismatic, between: [hub, p], axis: [1, 0], damping: DAMPING}
springs: {k: {type: two_point, between: [hub.q, p], stiffness: 1000.0, rest_length: 1.0}}
initial: {hub: {angular_velocity: 1.0}}
solve: {duration: 1.0}
"""


def slot(damping):
    """Return a mass in a radial slot: s^2 + (c / 2) s + 500 - W^2 = 0."""
    return parse_deck(SLOT.replace("DAMPING", str(damping)))


def growth_in_a_slot(damping, rate):
    """Return the largest real part of its roots [1/s]."""
    return max(np.roots([1.0, 0.5 * damping, 500.0 - rate**2]).real)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("rates", [[20, 25], [25, 30], [0, 25], [20, 22.5], [20, 28.123]], ids=str)
def test_what_grows_at_just_the_size_of_its_stiffness_is_found(rates):
    """The shift at which the inverse is taken was an eigenvalue: it was told that something has no mass."""
    found = hfsim.campbell(slot(0.0), rates)
    for rate, modes in zip(rates, found.founds, strict=True):
        grows = [growth_in_a_slot(0.0, rate)] if rate**2 > 500.0 else []
        assert [mode.growth for mode in modes.unstable] == pytest.approx(grows, rel=1e-9)
