"""Edges of forces: found along tried steps, and what steps that end there are worth."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

from hfsim.mechanics.edges import Edges
from hfsim.mechanics.friction import SLIDING, Friction
from hfsim.mechanics.resistances import LinearSpring, Stop
from hfsim.mechanics.tabled import TableSpring
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
    latch = TableSpring.through([[-0.5, 0.0], [0.0, 0.0], [0.01, 200.0], [0.02, 0.0], [2.0, 0.0]], 1.0)
    assert latch.edges == pytest.approx((1.0, 1.02))
    smooth = [[s, 100.0 * s + 40.0 * s**3] for s in np.linspace(-1.0, 1.0, 21)]
    assert TableSpring.through(smooth, 1.0).edges == ()
    noise = 0.02 * np.random.default_rng(1).standard_normal(100)
    measured = [[s, s + off] for s, off in zip(np.linspace(-1.0, 1.0, 100), noise, strict=True)]
    assert TableSpring.through(measured, 1.0).edges == ()


class Part:
    """A force with edges where a coordinate is at given values."""

    has_edges, events = True, ()

    def __init__(self, *values):
        self.values = np.array(values)

    def edges(self, t, x, u):
        return x[:, :1] - self.values


class Along(NamedTuple):
    """A step along a path, which stands in place of each term of the series."""

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
    return Along(1.0, 2.0, None, None, (path,) * 9)


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


@pytest.mark.parametrize("beyond", [1e-2, 1e-5])
def test_an_edge_that_is_touched_between_two_looks_is_found(beyond):
    """A path that turns round at 3 just behind it, here away from where it is looked at."""
    step = step_along(lambda t: 3.0 - (t - 1.777) ** 2)
    found = edges_of(3.0 - beyond).first(step)
    assert 0.777 - beyond**0.5 <= found < 0.777
    assert edges_of(3.0 + beyond).first(step) == step.h


CIRCLING = """
hfsim: 1
gravity: [0.0, 0.0]
bodies: {b: {type: rigid, mass: 1.0, inertia: 0.1, points: {a: [-0.5, 0.0], e: [0.5, 0.0]}}}
joints: {pin: {type: revolute, between: [ground, b.a]}}
springs: {k: {type: two_point, between: [ground, b.e], SPRING}}
initial: {b: {angular_velocity: 3.0}}
solve: {duration: 5.0}
output: {channels: [b.x]}
"""


@pytest.mark.parametrize(
    "spring",
    ["stops: {upper: 1.0, stiffness: 1.0e5}",
     "rest_length: 1.0, table: [[-0.5, -10.0], [0.0, 0.0], [0.5, 100.0]]"],
)  # fmt: skip
@pytest.mark.parametrize(("method", "most"), [("auto", 100), ("gauss", 100), ("gear", 300)])
def test_what_moves_along_an_edge_does_not_meet_it_in_every_step(spring, method, most):
    """Its distance from the pin is that of the stop, or of the bend, but for rounding."""
    deck = parse_deck(CIRCLING.replace("SPRING", spring), "circling", [f"solve.method={method}"])
    run = simulate(deck, error_estimate=False)
    assert run.statistics["steps"] < most and run.statistics["rejected"] < 20


BARRIER = """
hfsim: 1
gravity: [0.0, 0.0]
bodies: {cart: {type: rigid, mass: 1.0, inertia: 0.1}}
joints: {rail: {type: prismatic, between: [ground, cart]}}
springs: {latch: {type: two_point, between: [ground, cart], rest_length: 1.0,
                  table: [[-0.5, 0.0], [0.0, 0.0], [0.01, 200.0], [0.02, 0.0], [2.0, 0.0]]}}
initial: {cart: {position: [0.6, 0.0], velocity: [1.0, 0.0]}}
solve: {duration: 2.0}
output: {channels: [cart.x]}
"""
THROWN = """
hfsim: 1
gravity: [0.0, -9.81]
bodies: {cart: {type: rigid, mass: 1.0, inertia: 0.1}}
joints: {rail: {type: prismatic, between: [ground, cart], axis: [0, 1],
                stops: {upper: 127.0, stiffness: 1.0e+5, transition: 1.0e-4}}}
initial: {cart: {velocity: [0.0, 50.0]}}
solve: {duration: 10.2}
output: {channels: [cart.y]}
"""


@pytest.mark.parametrize("method", ["auto", "gauss", "radau", "energy", "explicit"])
def test_no_step_passes_through_a_table(method):
    """It stores 1 J, more than the cart has, within 20 mm; steps were of metres."""
    run = simulate(parse_deck(BARRIER, "barrier", [f"solve.method={method}"]), error_estimate=False)
    assert run.final["cart.x"] == pytest.approx(-0.5784, abs=1e-3)


@pytest.mark.parametrize("method", ["auto", "gauss", "radau", "explicit"])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-8])
def test_no_step_passes_by_a_stop_that_is_hardly_touched(method, tolerance):
    """It turns round at 127.421 m; without the stop it falls to -0.316 m."""
    settings = ["joints.rail.stops.upper=127.4", f"solve.method={method}", f"solve.tolerance={tolerance}"]
    run = simulate(parse_deck(THROWN, "thrown", settings), error_estimate=False)
    assert run.final["cart.y"] == pytest.approx(-6.449, abs=0.02)


@pytest.mark.parametrize(
    ("method", "tolerance"), [("generalized_alpha", 1e-3), ("gear", 1e-9), ("gear", 1e-11)]
)
def test_few_steps_are_made_before_and_behind_a_stop(method, tolerance):
    """None of them ever shorter up to the edge, and none of the length that the contact asked for."""
    settings = [f"solve.method={method}", f"solve.tolerance={tolerance}", "solve.max_steps=400"]
    run = simulate(parse_deck(THROWN, "thrown", settings), error_estimate=False)
    assert run.status == "done" and run.statistics["rejected"] < 100


def test_long_steps_do_not_blur_contacts():
    """Without its edges the swing's energy is off by 2e-3 at this tolerance."""
    result = simulate(parse_deck(DECK), error_estimate=False)
    assert result.statistics["energy_drift"] < 1e-10
    assert result.statistics["steps"] < 150


def test_scenes_without_edges_are_not_looked_at():
    scene = build(parse_deck(DECK.replace("stops: {lower: -120 deg, stiffness: 1.0e4}", "damping: 0.1")))
    assert not any(part.has_edges for part in scene.system.forces)
