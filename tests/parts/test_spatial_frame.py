"""Hybrid coordinates in space: the map against differences, both charts, motions that change charts."""

from functools import cache

import numpy as np
import pytest

from hfsim.integrators import Trajectory
from hfsim.integrators._trajectory import RECENT, Segment
from hfsim.marching.integration import run_integration
from hfsim.parts.bodies.spatial_frame import EDGE, SpatialFrameChart
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

VECTORS, STRIDE = 7, 3
N = 2 * VECTORS * 3
CHART = SpatialFrameChart(slice(2, 2 + N), 2, STRIDE)
TURNING = """hfsim: 1
gravity: [0.0, 0.0, -9.81]
materials: {soft: {density: 1000.0, youngs_modulus: 7.0e6}}
sections: {bar: {area: 4.0e-4, second_moment: 1.333e-8}}
bodies: {b1: {type: beam, material: soft, section: bar, length: 1.0, elements: 2, element: cable}}
joints: {ball: {type: spherical, between: [ground, b1.root]}}
initial: {b1: {angle: 0.3, angular_velocity: [2.0, 1.0, 12.0]}}
solve: {model: exact, duration: 0.8, tolerance: 1.0e-9}
output: {channels: [b1.tip.x, b1.tip.y, b1.tip.z]}
"""


def blocks(q):
    return q[:, CHART.columns].reshape(len(q), 2, VECTORS, 3)


def states(rng, size=1.0, count=6):
    """States of two beams, in either chart."""
    q = rng.normal(size=(count, N + 4))
    root = blocks(q)[:, :, 1].copy()
    root[..., 1:] *= size
    root[..., 0] = np.sign(root[..., 0]) * (1.0 + 0.3 * np.abs(root[..., 0]))
    return put(q, root)


def put(q, root):
    """Write vectors of the root, (n_batch, 2, 3), into states."""
    vectors = blocks(q).copy()
    vectors[:, :, 1] = root
    q[:, CHART.columns] = vectors.reshape(len(q), -1)
    return q


@pytest.mark.parametrize("size", [1.0, 1e-3, 0.0])
def test_rates_and_accelerations_against_differences(size, rng):
    q, v, a = states(rng, size), rng.normal(size=(6, N + 4)), rng.normal(size=(6, N + 4))
    h = 1e-5

    def place(s):
        return CHART.absolute(CHART.frames(q + s * v + 0.5 * s * s * a))

    def rate(s):
        return CHART.absolute_velocity(CHART.frames(q + s * v + 0.5 * s * s * a), v + s * a)

    frames = CHART.frames(q)
    u = (place(h) - place(-h)) / (2.0 * h)
    assert CHART.absolute_velocity(frames, v) == pytest.approx(u, abs=1e-8)
    ax = np.zeros_like(q)
    ax[:, CHART.columns] = (rate(h) - rate(-h)) / (2.0 * h)
    assert CHART.relative_acceleration(frames, v, ax) == pytest.approx(a[:, CHART.columns], abs=1e-6)


def test_the_map_is_inverted_in_both_charts(rng):
    q, v = states(rng, 0.8), rng.normal(size=(6, N + 4))
    frames, x, u = CHART.frames(q), np.zeros_like(q), np.zeros_like(q)
    x[:, CHART.columns], u[:, CHART.columns] = CHART.absolute(frames), CHART.absolute_velocity(frames, v)
    assert CHART.hybrid(x, q) == pytest.approx(q[:, CHART.columns], abs=1e-13)
    assert CHART.hybrid_velocity(frames, u) == pytest.approx(v[:, CHART.columns], abs=1e-12)
    other = np.zeros_like(q)
    other[:, CHART.columns] = CHART.hybrid(x, -q)
    assert np.all(blocks(other)[:, :, 1, 0] * blocks(q)[:, :, 1, 0] < 0.0)
    assert CHART.absolute(CHART.frames(other)) == pytest.approx(x[:, CHART.columns], abs=1e-12)
    best = np.zeros_like(q)
    best[:, CHART.columns] = CHART.hybrid(x, np.zeros_like(q))
    assert np.linalg.norm(blocks(best)[:, :, 1, 1:], axis=-1).max() <= 0.5 * np.pi + 1e-12


def test_the_frame_s_first_axis_is_along_the_root_slope(rng):
    q = states(rng)
    frames, x = CHART.frames(q), np.zeros_like(q)
    x[:, CHART.columns] = CHART.absolute(frames)
    slope = blocks(x)[:, :, 1]
    assert frames.turn[..., 0] == pytest.approx(slope / np.linalg.norm(slope, axis=-1, keepdims=True))
    assert np.allclose(frames.turn @ frames.turn.swapaxes(-1, -2), np.eye(3), rtol=0.0, atol=1e-14)
    assert np.linalg.det(frames.turn) == pytest.approx(1.0)


def test_only_beams_beyond_the_edge_go_over(rng):
    q = states(rng, 0.1)
    root = blocks(q)[:, :, 1].copy()
    root[2, 1, 1:] = [EDGE + 0.01, 0.0]
    put(q, root)
    near = CHART.better(q).reshape(blocks(q).shape)
    changed = np.argwhere(near[:, :, 1, 0] != blocks(q)[:, :, 1, 0])
    assert changed.tolist() == [[2, 1]]


@cache
def motion(method, coordinates, **solve):
    changes = {"coordinates": coordinates, "method": method, **solve}
    deck = parse_deck(TURNING, "deck", [f"solve.{key}={value}" for key, value in changes.items()])
    assert bool(build(deck).system.charts) == (coordinates == "frame")
    result = simulate(deck, error_estimate=False)
    assert result.status == "done", result.reason
    return np.stack([c.values for c in result.channels], axis=1)


@pytest.mark.parametrize(
    ("method", "solve", "tolerance"),
    [("gauss", {}, 1e-9), ("gear", {"tolerance": 1e-6}, 1e-3)],
)
def test_exact_is_ancf_over_more_than_a_turn(method, solve, tolerance):
    reference, found = motion("gauss", "absolute", tolerance=1e-10), motion(method, "frame", **solve)
    assert np.ptp(np.unwrap(np.arctan2(reference[:, 1], reference[:, 0]))) > 2.0 * np.pi
    assert found == pytest.approx(reference, abs=tolerance)


def test_no_step_begins_beyond_the_edge_of_a_chart():
    loaded = parse_deck(TURNING, "deck", ["solve.coordinates=frame", "solve.tolerance=1e-5"])
    path = run_integration(build(loaded), loaded.deck.solve).trajectory
    roots = np.array([step.q[3:6] for step in path.segments])
    assert np.linalg.norm(roots[:, 1:], axis=1).max() <= EDGE
    assert {*np.sign(roots[:, 0])} == {-1.0, 1.0}


@pytest.mark.parametrize("change", [3, 4])
def test_steps_are_not_joined_across_a_change_of_charts(change):
    count, rate = RECENT + 7, np.array([0.1])
    places = [np.array([0.1 * k - 3.0 * (k >= change)]) for k in range(count + 1)]
    steps = [Segment(float(k), 1.0, place, rate, np.zeros((1, 1))) for k, place in enumerate(places[:-1])]
    path = Trajectory(0.0, float(count), places[-1], rate, list(steps))
    times = np.linspace(0.05, 6.95, 70)
    before = path.at(times)[0]
    path.condense()
    assert len(path.segments) == count - 2
    assert path.at(times)[0] == pytest.approx(before, abs=1e-12)
