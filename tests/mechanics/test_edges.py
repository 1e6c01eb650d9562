"""Edges of forces: found along tried steps, and what steps that end there are worth."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

from hfsim.mechanics.edges import Edges
from hfsim.mechanics.resistances import SLIDING, Friction, LinearSpring, Stop
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

DECK = """
hfsim: 1
gravity: [0.0, -9.81]
bodies: {bar: {type: rigid, mass: 1.0, inertia: 0.0833, points: {top: [-0.5, 0.0]}}}
joints: {pin: {type: revolute, between: [ground, bar.top], stops: {lower: -120 deg, stiffness: 1.0e4}}}
solve: {duration: 5.0, tolerance: 1.0e-8, method: gauss}
output: {plots: false, channels: [bar.angle, energy.total]}
"""


def test_edges_are_those_of_the_laws():
    stop = Stop(0.4, -1.0, 200.0, 0.0, 0.1)
    assert stop.edges == pytest.approx((0.4, 0.3))
    assert Friction(2.0, 0.1).rate_edges == pytest.approx((-0.1 * SLIDING, 0.1 * SLIDING))
    assert LinearSpring(3.0, 1.0).edges == LinearSpring(3.0, 1.0).rate_edges == ()


class Part:
    """A force with edges where a coordinate is at given values."""

    has_edges = True

    def __init__(self, *values):
        self.values = np.array(values)

    def edges(self, t, x, u):
        return x[:, :1] - self.values


class Along(NamedTuple):
    """A step along a path, which stands in place of the series."""

    t: float
    h: float
    q: None
    v: None
    series: tuple[Callable]

    def at(self, times):
        x = self.series[0](times)[:, None]
        return x, 0.0 * x

    def inside(self, shares):
        return self.at(self.t + self.h * shares)


def step_along(path):
    return Along(1.0, 2.0, None, None, (path,))


def edges_of(*values):
    same = SimpleNamespace(absolute=lambda q: q, absolute_velocity=lambda q, v: v, forces=(Part(*values),))
    return Edges(same)


@pytest.mark.parametrize("share", [0.01, 0.2, 0.5, 0.83, 0.99, 0.9999])
def test_the_first_edge_is_found(share):
    """To a millionth of the step, on its far side."""
    edges = edges_of(9.0, 1.0 + 2.0 * share, 3.5)
    found = edges.first(step_along(lambda t: t))
    assert 2.0 * share <= found <= 2.0 * (share + 1e-6)


def test_what_is_at_the_ends_is_no_edge_inside():
    step = step_along(lambda t: t)
    assert edges_of(1.0 + 1e-4, 3.0 - 1e-7).first(step) == step.h
    assert Edges().first(step) == step.h
    assert edges_of(-2.0).first(step) == step.h


def test_of_two_edges_close_to_each_other_the_first_counts():
    found = edges_of(1.603, 1.601).first(step_along(lambda t: t))
    assert 0.6 < found < 0.603


def test_long_steps_do_not_blur_contacts():
    """Without its edges the swing's energy is off by 2e-3 at this tolerance."""
    result = simulate(parse_deck(DECK), error_estimate=False)
    assert result.statistics["energy_drift"] < 1e-10
    assert result.statistics["steps"] < 150


def test_scenes_without_edges_are_not_looked_at():
    scene = build(parse_deck(DECK.replace("stops: {lower: -120 deg, stiffness: 1.0e4}", "damping: 0.1")))
    assert not any(part.has_edges for part in scene.system.forces)
