"""Rotations of plane and space.

A planar vector (a, b) is handled as the complex number a + ib: turning it by an angle is then one
product for a whole batch of vectors.  A *turn* has one number in the plane, its angle, and three in space,
a rotation vector; so have spins and moments.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from hfsim.maths.arrays import Array, ComplexArray

_Vectors = TypeVar("_Vectors", Array, ComplexArray)

FIRST = np.eye(3)[0]
"""The first axis in space."""
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


def across(axis: Sequence[float]) -> tuple[tuple[float, ...], ...]:
    """Return directions perpendicular to an axis and to each other: one in the plane, two unit ones in space.

    Examples
    --------
    >>> across((0.0, 0.0, 2.0))
    ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    """
    if len(axis) == 2:
        return ((-axis[1], axis[0]),)
    n = np.asarray(axis) / np.linalg.norm(axis)
    first = np.array([1.0, 0.0, 0.0] if abs(n[0]) < 0.9 else [0.0, 1.0, 0.0])
    first = first - (first @ n) * n
    first /= np.linalg.norm(first)
    return tuple(first.tolist()), tuple(cross(n, first).tolist())


def spun(spin: Array, a: Array) -> Array:
    """Return the rates of vectors (..., n_dim) that turn with angular velocities (..., n_spin): spin x a."""
    return np.asarray(spin * normal(a)) if a.shape[-1] == 2 else cross(spin, a)


def turning(a: Array) -> Array:
    """Return the matrices (..., n_dim, n_spin) by which angular velocities give `spun` of vectors."""
    return normal(a)[..., None] if a.shape[-1] == 2 else -skew(a)


def lever(a: Array, b: Array) -> Array:
    """Return a x b of vectors (..., n_dim), shape (..., n_spin): the moment of a force ``b`` at ``a``."""
    if a.shape[-1] == 3:
        return cross(a, b)
    return np.asarray(np.sum(normal(a) * b, axis=-1, keepdims=True))


def turned(turn: Array, a: Array) -> Array:
    """Turn vectors (..., n_dim) by a turn (n_spin,)."""
    return rotate(turn[0], a).reshape(a.shape) if len(turn) == 1 else np.asarray(a @ rotation(turn).T)


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


# --- space ----------------------------------------------------------------------------------------

_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])
_SKEW = np.array([[0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 0.0]])
"""What the three components of a vector are in its matrix, row after row."""


def dot(a: _Vectors, b: _Vectors) -> _Vectors:
    """Return the products of vectors, (..., 1)."""
    return np.asarray(np.sum(a * b, axis=-1, keepdims=True))


def cross(a: Array, b: Array) -> Array:
    """Return a x b of spatial vectors (..., 3): `numpy.cross` takes several times longer for few."""
    return np.asarray(
        a.take(_NEXT, -1) * b.take(_LAST, -1) - a.take(_LAST, -1) * b.take(_NEXT, -1)
    )


def skew(a: Array) -> Array:
    """Return the matrices (..., 3, 3) with skew(a) b = a x b, of vectors (..., 3)."""
    return np.asarray(a.reshape(-1, 3) @ _SKEW).reshape(*a.shape, 3)


def _squares(turn: Array) -> tuple[Array, Array, Array]:
    """Return |turn| (..., 1, 1), kept from zero, and the first two powers of its matrix."""
    K = skew(turn)
    angle = np.linalg.norm(turn, axis=-1)[..., None, None]
    return np.maximum(angle, 1e-150), K, K @ K


def rotation(turn: Array) -> Array:
    """Return the matrices (..., 3, 3) of rotation vectors (..., 3) (Rodrigues).

    Examples
    --------
    >>> (rotation(np.array([0.0, 0.0, np.pi / 2])) @ [1.0, 0.0, 0.0]).round(12)
    array([0., 1., 0.])
    """
    angle, K, K2 = _squares(turn)
    half = 0.5 * angle
    return np.asarray(np.eye(3) + np.sin(angle) / angle * K + 0.5 * (np.sin(half) / half) ** 2 * K2)


def smallest_rotation(a: Array, b: Array) -> Array:
    """Return the matrices (..., 3, 3) of the smallest rotations from a unit vector (3,) to others (..., 3).

    A half turn is about the first of the directions `across`.

    Examples
    --------
    >>> (smallest_rotation(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])) @ [0.0, 1.0, 2.0]).round(12)
    array([-1.,  0.,  2.])
    """
    about = cross(a, b)
    sine = np.linalg.norm(about, axis=-1, keepdims=True)
    known = about / np.maximum(sine, 1e-12)
    about = np.where(sine > 1e-12, known, across(a)[0])  # type: ignore[arg-type]
    return rotation(np.arctan2(sine, (b @ a)[..., None]) * about)


def smallest_spins(a: Array, b: Array) -> Array:
    """Return the matrices (..., 3, 3) from changes of unit vectors (..., 3) to turns of `smallest_rotation`.

    Examples
    --------
    >>> (smallest_spins(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])) @ [0.0, 0.0, 1.0]).round(12)
    array([ 1., -1.,  0.])
    """
    roll = cross(b, a) / (1.0 + b @ a)[..., None]
    return skew(b) + b[..., :, None] * roll[..., None, :]


def rotation_rates(turn: Array) -> Array:
    """Return the matrices T (..., 3, 3) from rates of rotation vectors to angular velocities, ground axes."""
    angle, K, K2 = _squares(turn)
    half = 0.5 * angle
    large = np.maximum(angle, 1e-3)
    beyond = np.where(angle < large, 1.0 / 6.0 - angle**2 / 120.0, (large - np.sin(large)) / large**3)
    return np.asarray(np.eye(3) + 0.5 * (np.sin(half) / half) ** 2 * K + beyond * K2)


def quaternion(R: Array) -> Array:
    """Return the unit quaternions (..., 4), scalar first and not negative, of matrices (..., 3, 3)."""
    trace = np.trace(R, axis1=-2, axis2=-1)
    diagonal = np.diagonal(R, axis1=-2, axis2=-1)
    squares = np.concatenate([1.0 + trace[..., None], 1.0 + 2.0 * diagonal - trace[..., None]], axis=-1)
    off = R - R.swapaxes(-1, -2)
    on = R + R.swapaxes(-1, -2)
    # four times the products q_i q_j: the row of the largest component gives all without cancellation
    Q = np.zeros((*R.shape[:-2], 4, 4))
    Q[..., range(4), range(4)] = squares
    for k, (i, j) in enumerate(((2, 1), (0, 2), (1, 0))):
        Q[..., 0, k + 1] = Q[..., k + 1, 0] = off[..., i, j]
        Q[..., i + 1, j + 1] = Q[..., j + 1, i + 1] = on[..., i, j]
    best = np.argmax(squares, axis=-1)
    row = np.take_along_axis(Q, best[..., None, None], axis=-2)[..., 0, :]
    row = row / np.linalg.norm(row, axis=-1, keepdims=True)
    return np.asarray(row * np.where(row[..., :1] < 0.0, -1.0, 1.0))


def rotation_of_quaternion(q: Array) -> Array:
    """Return the matrix (3, 3) of a quaternion (4,), scalar first, of any length but zero."""
    w, v = q[0] / np.linalg.norm(q), q[1:] / np.linalg.norm(q)
    K = skew(v)
    return np.asarray(np.eye(3) + 2.0 * w * K + 2.0 * K @ K)


def rotation_vector(R: Array) -> Array:
    """Return the rotation vectors (..., 3), of half a turn at most, of matrices (..., 3, 3).

    Examples
    --------
    >>> rotation_vector(rotation(np.array([0.1, -0.2, 3.0]))).round(12)
    array([ 0.1, -0.2,  3. ])
    """
    q = quaternion(R)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, q[..., :1])
    return np.asarray(np.where(sine > 1e-150, angle / np.maximum(sine, 1e-150), 2.0) * q[..., 1:])
