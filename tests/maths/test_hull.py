"""Edges of what points enclose, drawn in one go."""

from itertools import pairwise, product

import numpy as np
import pytest

from hfsim.maths.hull import wire
from hfsim.maths.rotations import rotation

CORNERS = np.array(list(product((-1.0, 1.0), (-2.0, 2.0), (-0.1, 0.1))))
TURN = rotation(np.array([0.3, -0.8, 0.5]))


def edges(points):
    return {frozenset(pair) for pair in pairwise(wire(points))}


@pytest.mark.parametrize("inside", [np.zeros((0, 3)), [[0.0, 0.0, 0.0], [0.5, -1.5, 0.1]]])
def test_a_box_has_its_twelve_edges(inside):
    """Not the diagonals of its faces, nor points in them or inside; whichever way it is turned."""
    points = np.vstack([CORNERS, inside]) @ TURN.T + np.array([3.0, 1.0, -2.0])
    lengths = [np.linalg.norm(np.subtract(*points[list(edge)])) for edge in edges(points)]
    assert sorted(lengths) == pytest.approx([0.2] * 4 + [2.0] * 4 + [4.0] * 4)
    assert set(wire(points)) == set(range(8))


def test_a_plate_is_drawn_around():
    """In whatever order its corners are named."""
    points = np.array([[0.0, 0, 0], [2, 1, 0], [2, 0, 0], [0, 1, 0], [1, 0.5, 0]]) @ TURN.T
    walk = wire(points)
    assert len(walk) == 5 and walk[0] == walk[-1] == 0
    assert edges(points) == set(map(frozenset, [(0, 2), (2, 1), (1, 3), (3, 0)]))


def test_a_bar_runs_from_end_to_end():
    points = np.outer([0.0, -0.5, 1.0, 0.2], TURN[0])
    assert wire(points) in ([1, 0, 3, 2], [2, 3, 0, 1])


def test_one_place_is_one_point():
    assert wire(np.ones((1, 3))) == wire(np.ones((3, 3))) == [0]


def test_many_points_take_no_time():
    rng = np.random.default_rng(3)
    ball = rng.normal(size=(200, 3))
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    assert len(edges(ball)) == 3 * 200 - 6
    assert len(wire(ball)) < 2 * (3 * 200 - 6)
