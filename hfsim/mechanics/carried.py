"""Increments as seen from axes that bodies carry along, for Newton corrections.

Rows that keep axes orthonormal, and the stiffness of a beam between its own nodes, are nearly the same in all
states there, however far the bodies have turned; the mass matrix of vectors nearly so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, IntArray, Places, run_of
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import cross, skew
from hfsim.maths.traced import changeable
from hfsim.mechanics.leading import Leading
from hfsim.mechanics.reduction import Reduction

_NONE = np.zeros((0, 2, 3), dtype=np.intp)
_OPPOSITE = 1e-14
"""What keeps the axis finite about which a direction turns to its opposite."""


class Carried(NamedTuple):
    """Vectors of a body that are seen from frames which it carries along.

    Attributes
    ----------
    vectors : ndarray of int, shape (n_vectors, 3)
        Columns of x of the vectors.
    owners : ndarray of int, shape (n_vectors,)
        The frame from which each is seen: one of a section, or, behind them, of a direction.
    sections : ndarray of int, shape (n_sections, 2, 3)
        Columns of the last axes of a frame, of unit length and at right angles; the first follows.
    directions : ndarray of int, shape (n_directions, 2, 3)
        Columns of what a direction is the difference of, -1 for zero; its frame turns along the shortest way.
    positions : ndarray of int, shape (n_positions, 3)
        Columns of positions each of which leads the next one along.
    """

    vectors: IntArray
    owners: IntArray
    sections: IntArray
    directions: IntArray
    positions: IntArray

    @classmethod
    def by_sections(cls, vectors: IntArray, stride: int, first: int, positions: IntArray) -> Carried:
        """Return vectors (n_vectors, 3) of nodes as sections see them.

        Parameters
        ----------
        stride : int
            Vectors from node to node.
        first : int
            Place among them of the last two axes of the section.
        positions : ndarray of int, shape (n_positions, 3)
        """
        nodes = np.arange(0, len(vectors), stride)
        sections = vectors[nodes[:, None] + first + np.arange(2)]
        return cls(vectors, np.arange(len(vectors)) // stride, sections, _NONE, positions)

    @classmethod
    def by_directions(cls, vectors: IntArray, stride: int) -> Carried:
        """Return vectors (n_vectors, 3) of a line: places and what is inside elements as chords see them.

        Each node has a place and then a slope, which sees itself.
        """
        places, slopes = vectors[::stride], vectors[1::stride]
        chords = np.stack([places[1:], places[:-1]], axis=1)
        own = np.stack([slopes, np.full_like(slopes, -1)], axis=1)
        element, kind = np.divmod(np.arange(1, len(vectors)), stride)
        owners = np.where(kind == 0, element - 1, np.where(kind == 1, element + len(chords), element))
        return cls(vectors[1:], owners, _NONE, np.concatenate([chords, own]), places)


@frozen
class CarriedIncrements:
    """Increments of a state in space, those of some vectors as their frames see them.

    Places are relative to those that lead them along.  A geometry are the frames of all vectors,
    (n_batch, n_vectors, 3, 3), with axes as columns.

    Attributes
    ----------
    vectors : ndarray of int, shape (n_vectors, 3)
        Columns of the state.
    owners : ndarray of int, shape (n_vectors,)
        The frame of each vector: of the sections, then of the directions.
    sections, directions : ndarray of int, shape (n_sections, 2, 3), (n_directions, 2, 3)
        As in `Carried`.
    before : ndarray, shape (n_directions, 3)
        Directions whose frames are the axes of the ground.
    """

    reduction: Reduction
    leading: Leading | None
    vectors: IntArray
    owners: IntArray
    sections: IntArray
    directions: IntArray
    before: Array
    holds_arrays: ClassVar[bool] = True

    @classmethod
    def of(cls, parts: Sequence[Carried], reduction: Reduction) -> CarriedIncrements:
        """Return the increments of the free coordinates of a reduction."""
        vectors = reduction.numbers[np.concatenate([part.vectors for part in parts])]
        sections, directions = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("sections", "directions")
        )
        owners, of_sections, of_directions = [], 0, len(sections)
        for part in parts:
            count = len(part.sections)
            behind = of_directions - count
            owners.append(part.owners + np.where(part.owners < count, of_sections, behind))
            of_sections, of_directions = of_sections + count, of_directions + len(part.directions)
        free = (vectors >= 0).all(axis=1)
        leading = Leading.of([part.positions for part in parts], reduction)
        before = np.zeros((len(directions), 3))
        own = vectors[free], np.concatenate(owners)[free]
        return cls(reduction, leading, *own, sections, directions, before)

    def from_state(self, q: Array) -> CarriedIncrements:
        """Return the same with the directions of a state (n,) as those from which frames turn."""
        if not len(self.directions):
            return self
        return replace(self, before=self._directed(self.reduction.expand(q[None]))[0])

    @cached_property
    def _columns(self) -> Places:
        return run_of(self.vectors.ravel())

    def geometry(self, q: Array) -> Array:
        """Return the frame of each vector."""
        x, frames = self.reduction.expand(q), []
        if len(self.sections):
            second = _unit(x[:, self.sections[:, 0]])
            first = _unit(cross(second, x[:, self.sections[:, 1]]))
            frames.append(np.stack([first, second, cross(first, second)], axis=-1))
        if len(self.directions):
            frames.append(_turned(self.before, self._directed(x)))
        return (frames[0] if len(frames) == 1 else np.concatenate(frames, axis=1)).take(self.owners, axis=1)

    def _directed(self, x: Array) -> Array:
        """Return the directions at coordinates (n_batch, n_x), of unit length."""
        x = np.concatenate([x, np.zeros((len(x), 1))], axis=1)
        return _unit(x[:, self.directions[:, 0]] - x[:, self.directions[:, 1]])

    def to_natural(self, at: Array, dq: Array) -> Array:
        """Return changes of the states as the frames see them."""
        return self._seen(at.swapaxes(-1, -2), dq if self.leading is None else self.leading.relative(dq))

    def from_natural(self, at: Array, y: Array) -> Array:
        """Return changes as they are from those that the frames see."""
        changes = self._seen(at, y)
        return changes if self.leading is None else self.leading.absolute(changes)

    advance = from_natural

    def to_natural_forces(self, at: Array, f: Array) -> Array:
        """Return forces on what frames see: the transpose of `from_natural`."""
        return self._seen(at.swapaxes(-1, -2), f if self.leading is None else self.leading.forces(f))

    def rates(self, at: Array, v: Array, a: Array) -> tuple[Array, Array, Array]:
        """Return velocities and accelerations as frames that stand still see them, and zero."""
        return self.to_natural(at, v), self.to_natural(at, a), np.zeros_like(a)

    def turning(self, at: Array, v: Array) -> None:
        """Return None: frames stand still."""

    def _seen(self, at: Array, changes: Array) -> Array:
        out = changeable(changes)
        own = changes[:, self._columns].reshape(len(changes), *at.shape[1:3], 1)
        out[:, self._columns] = (at @ own).reshape(len(changes), -1)
        return out


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.sqrt(np.sum(vectors * vectors, axis=-1, keepdims=True)))


def _turned(before: Array, after: Array) -> Array:
    """Return the rotations (n_batch, n, 3, 3) that turn unit vectors into others, the shortest way."""
    axis, cosine = cross(before, after), np.sum(before * after, axis=-1)[..., None, None]
    outer = axis[..., None] * axis[..., None, :]
    return np.asarray(cosine * np.eye(3) + skew(axis) + outer / (1.0 + _OPPOSITE + cosine))
