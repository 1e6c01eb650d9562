"""Rotations of the plane.

A planar vector (a, b) is handled as the complex number a + ib: turning it by an angle is then one
product for a whole batch of vectors.  Spatial rotations will stand beside these with the same names.
"""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array, ComplexArray

QUARTER_TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])
"""``a @ QUARTER_TURN`` is the planar cross product of the unit normal with ``a``."""


def as_complex(a: Array) -> ComplexArray:
    """View planar vectors as complex numbers, without a copy where memory allows.

    Parameters
    ----------
    a : ndarray, shape (..., 2)

    Returns
    -------
    ndarray of complex, shape (...)
    """
    return np.ascontiguousarray(a, dtype=float).view(np.complex128)[..., 0]


def as_vectors(z: ComplexArray) -> Array:
    """View complex numbers as planar vectors, shape (..., 2); the inverse of `as_complex`."""
    return np.ascontiguousarray(z)[..., None].view(np.float64)


def rotate(angle: Array, a: Array) -> Array:
    """Turn planar vectors ``a`` (..., 2) by ``angle`` (...) [rad]: the product A s' of eq. (2).

    Examples
    --------
    >>> rotate(np.array([np.pi / 2]), np.array([[1.0, 0.0]])).round(12)
    array([[0., 1.]])
    """
    return as_vectors(np.exp(1j * angle) * as_complex(a))


def normal(a: Array) -> Array:
    """Turn planar vectors (..., 2) by a quarter turn: (a, b) becomes (-b, a)."""
    return np.asarray(a @ QUARTER_TURN)


def across(axis: tuple[float, ...]) -> tuple[tuple[float, ...], ...]:
    """Return the directions perpendicular to an axis: one in the plane."""
    x, y = axis
    return ((-y, x),)


def spun(spin: Array, a: Array) -> Array:
    """Return the rates of vectors (..., 2) that turn with angular velocities (..., 1): spin x a."""
    return np.asarray(spin * normal(a))


def lever(a: Array, b: Array) -> Array:
    """Return a x b of planar vectors, shape (..., 1): the moment of a force ``b`` at ``a``."""
    return np.asarray(np.sum(normal(a) * b, axis=-1, keepdims=True))


def wrap(angle: Array) -> Array:
    """Return the angle [rad] within half a turn of zero.

    Examples
    --------
    >>> float(wrap(np.array(7.0)).round(6))
    0.716815
    """
    return np.asarray(angle - 2.0 * np.pi * np.round(np.asarray(angle) / (2.0 * np.pi)))


def freedoms(n_dim: int) -> int:
    """Return how many rigid motions there are: one shift along each axis, one turn in each pair of axes."""
    return n_dim * (n_dim + 1) // 2
