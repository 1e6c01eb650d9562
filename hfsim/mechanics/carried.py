"""Increments as seen from axes that bodies carry along, for Newton corrections.

Rows that keep axes orthonormal, and the stiffness of a beam between its own nodes, are nearly the same in all
states there, however far the bodies have turned; the mass matrix of vectors is exactly so.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, IntArray, Places, run_of
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import cross
from hfsim.maths.traced import changeable
from hfsim.mechanics.reduction import Reduction


class Carried(NamedTuple):
    """Vectors of a body that are seen from axes among them.

    Attributes
    ----------
    vectors : ndarray of int, shape (n_frames, k, 3)
        Columns of x of the vectors seen from each frame.
    axes : ndarray of int, shape (n_frames, 2, 3)
        Columns of the last axes of the frame, of unit length and at right angles; the first follows.
    """

    vectors: IntArray
    axes: IntArray


@frozen
class CarriedIncrements:
    """Increments of a state in space, those of some vectors as their frames see them.

    A geometry are the frames of all vectors, (n_batch, n_vectors, 3, 3), with axes as columns.

    Attributes
    ----------
    vectors : ndarray of int, shape (n_vectors, 3)
        Columns of the state.
    axes : ndarray of int, shape (n_frames, 2, 3)
    owners : ndarray of int, shape (n_vectors,)
        The frame of each vector.
    """

    vectors: IntArray
    axes: IntArray
    owners: IntArray

    @classmethod
    def of(cls, parts: Sequence[Carried], reduction: Reduction) -> CarriedIncrements:
        """Return the increments of the free coordinates of a reduction."""
        number = np.full(len(reduction.offset), -1)
        number[reduction.rows] = np.arange(len(reduction.rows))
        axes = number[np.concatenate([part.axes for part in parts])]
        counts = np.concatenate([np.full(len(part.vectors), part.vectors.shape[1]) for part in parts])
        vectors = number[np.concatenate([part.vectors.reshape(-1, 3) for part in parts])]
        free = (vectors >= 0).all(axis=1)
        return cls(vectors[free], axes, np.repeat(np.arange(len(axes)), counts)[free])

    @cached_property
    def _columns(self) -> Places:
        return run_of(self.vectors.ravel())

    def geometry(self, q: Array) -> Array:
        """Return the frame of each vector."""
        y = _unit(q[:, self.axes[:, 0]])
        x = _unit(cross(y, q[:, self.axes[:, 1]]))
        return np.stack([x, y, cross(x, y)], axis=-1).take(self.owners, axis=1)

    def to_natural(self, at: Array, dq: Array) -> Array:
        """Return changes of the states as the frames see them."""
        return self._turned(at.swapaxes(-1, -2), dq)

    def from_natural(self, at: Array, y: Array) -> Array:
        """Return changes as they are from those that the frames see."""
        return self._turned(at, y)

    advance = from_natural
    to_natural_forces = to_natural

    def rates(self, at: Array, v: Array, a: Array) -> tuple[Array, Array, Array]:
        """Return velocities and accelerations as frames that stand still see them, and zero."""
        return self.to_natural(at, v), self.to_natural(at, a), np.zeros_like(a)

    def turning(self, at: Array, v: Array) -> None:
        """Return None: frames stand still."""

    def _turned(self, at: Array, changes: Array) -> Array:
        out = changeable(changes)
        own = changes[:, self._columns].reshape(len(changes), *at.shape[1:3], 1)
        out[:, self._columns] = (at @ own).reshape(len(changes), -1)
        return out


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.sqrt(np.sum(vectors * vectors, axis=-1, keepdims=True)))
