"""Runs of any duration: slow motions in a slower unit of time are solved by the same steps."""

import numpy as np
import pytest

from hfsim.marching.integration import run_integration
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck


def strip(T, moment, damping):
    """A strip bent by a moment at its end, T times as slowly as in seconds."""
    return f"""
hfsim: 1
materials:
  rubber:
    {{density: 1000.0, youngs_modulus: {1e6 / T**2}, axial_damping: {0.05 * damping * T}, bending_damping: {5 * damping * T}}}
sections: {{strip: {{shape: rectangle, width: 0.1, height: 0.01}}}}
bodies: {{b: {{type: beam, material: rubber, section: strip, length: 1.0, elements: 4}}}}
joints: {{clamp: {{type: fixed, between: [ground, b.root]}}}}
loads:
  bend:
    {{type: moment, at: b.tip, moment: {moment / T**2}, law: {{type: smooth_step, from: 0, to: 1, start: 0, end: {10 * T}}}}}
solve: {{duration: {40 * T}, tolerance: 1.0e-5}}
"""  # noqa: E501


def damped(T):
    return strip(T, 0.025, 1)


def undamped(T):
    return strip(T, 0.01, 0)


def top(T):
    """A heavy top, whose derivative is taken at every stage."""
    return f"""
hfsim: 1
gravity: [0.0, 0.0, {-9.81 / T**2}]
bodies: {{top: {{type: rigid, mass: 1.0, inertia: [0.02, 0.02, 0.01], points: {{foot: [0.0, 0.0, -0.3]}}}}}}
joints: {{ball: {{type: spherical, between: [ground, top.foot]}}}}
initial: {{top: {{orientation: {{axis: [1, 0, 0], angle: 0.5}}, angular_velocity: [0.0, 0.0, {10 / T}]}}}}
solve: {{duration: {40 * T}, tolerance: 1.0e-5, method: gauss}}
"""


def cost(done):
    counts = done.problem.counts
    return counts.steps, counts.rejected, counts.iterations


@pytest.mark.parametrize("scene", [damped, undamped, top])
def test_a_slow_run_takes_the_steps_of_a_fast_one(scene):
    """Ended by what a velocity does in half a second, iterations left 34 tolerances in a roll-up of weeks."""
    fast, slow = (build(parse_deck(scene(T))) for T in (1.0, 128.0))
    one, other = (run_integration(built, built.deck.solve) for built in (fast, slow))
    assert cost(one) == cost(other)
    assert other.trajectory.q == pytest.approx(one.trajectory.q, abs=1e-7)


@pytest.mark.parametrize("scene", [damped, top])
def test_what_was_recorded_in_a_short_run_is_none_of_a_long_one(scene):
    text = scene(4.0)
    used, fresh = build(parse_deck(text)), build(parse_deck(text))
    run_integration(used, used.deck.solve.model_copy(update={"duration": 10.0}))
    one, other = (run_integration(built, built.deck.solve) for built in (used, fresh))
    assert cost(one) == cost(other)
    assert np.array_equal(one.trajectory.q, other.trajectory.q)


def cantilever(k):
    """A silicon cantilever that a force shakes through six periods, all of it k times as small and fast."""
    return f"""
hfsim: 1
materials: {{si: {{density: 2330, youngs_modulus: 160 GPa, bending_damping: {1e-5 * k}}}}}
sections: {{s: {{shape: rectangle, width: {0.05 * k}, height: {0.05 * k}}}}}
bodies: {{b: {{type: beam, material: si, section: s, length: {k}, elements: 3}}}}
joints: {{j: {{type: fixed, between: [ground, b.root]}}}}
loads:
  shake: {{type: force, at: b.tip, force: [0, {1e5 * k * k}], law: {{expression: "sin(60 * pi * t / {k})"}}}}
solve: {{duration: {0.2 * k}, tolerance: 1.0e-5}}
"""


@pytest.mark.parametrize("method", ["radau", "gauss"])
def test_a_small_scene_takes_the_steps_of_a_large_one(method):
    """Ended by what a velocity does in half a second, iterations in microseconds took 240 times the steps."""
    decks = (parse_deck(cantilever(k)).with_solve({"method": method}) for k in (2.0**-4, 2.0**-13))
    large, small = map(build, decks)
    one, other = (run_integration(built, built.deck.solve) for built in (large, small))
    assert other.trajectory.t_end == pytest.approx(0.2 * 2.0**-13) and cost(one)[0] < 150
    assert cost(other)[0] == pytest.approx(cost(one)[0], rel=0.05) and cost(other)[1] < 5
    assert other.trajectory.q[-2:] == pytest.approx(one.trajectory.q[-2:], abs=1e-6)
