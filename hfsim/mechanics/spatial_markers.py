"""Markers in space: on bodies whose coordinates are vectors, and on frames before a scene is assembled.

Axes of a body are vectors among its coordinates: every direction that joints hold is linear in these.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property, lru_cache
from typing import ClassVar

import numpy as np

from hfsim.maths.arrays import Array, BoolArray, IntArray, on_components
from hfsim.maths.differences import FINE, fine_derivative
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import NOTHING, Entries
from hfsim.maths.rotations import (
    FIRST,
    lever,
    rotation,
    rotation_rates,
    skew,
    smallest_rotation,
    smallest_spins,
    turning,
)
from hfsim.mechanics.markers import ROUNDING, LinearMarker, Marker
from hfsim.mechanics.products import LinearVector


@frozen
class VectorMarker(LinearMarker):
    """A material point of a spatial body whose coordinates are absolute vectors.

    Attributes
    ----------
    axis_rows : ndarray, shape (n_axes, n_vectors)
        Shape rows of its axes: all three, of unit length and at right angles; or the first alone, of any
        length, along a line without sections.
    """

    axis_rows: Array
    n_dim: ClassVar[int] = 3
    n_spin: ClassVar[int] = 3

    @property
    def n_axes(self) -> int:  # type: ignore[override]
        """Number of its own axes."""
        return len(self.axis_rows)

    @property
    def _involved(self) -> BoolArray:
        return np.asarray(np.any(np.abs([self.place_row, *self.axis_rows]) > ROUNDING, axis=0))

    def axes(self, x: Array) -> Array:
        """Return its own axes, shape (n_batch, n_axes, 3)."""
        return self._combined(x, self.axis_rows)

    def frame(self, x: Array) -> Array:
        """Return three axes of unit length and at right angles, as columns, shape (n_batch, 3, 3).

        A line has the smallest rotation from the ground's first axis; a half turn is about the second one.
        """
        axes = self.axes(x)
        if self.n_axes == 3:
            return axes.swapaxes(1, 2)
        t = axes[:, 0] / np.linalg.norm(axes[:, 0], axis=-1, keepdims=True)
        return smallest_rotation(FIRST, t)

    def turned(self, x: Array, a: Array) -> Array:
        """Return vectors (3,), given in its axes, in ground axes."""
        return np.asarray(self.frame(x) @ a)

    def turned_jacobian(self, x: Array, a: Array) -> Array:
        """Return the derivative of `turned` by the coordinates, shape (n_batch or 1, 3, n_columns)."""
        return along_line(self, x, a) if self.n_axes == 1 else self.axis_jacobian(x, a)

    def axis(self, x: Array, a: Array) -> Array:
        """Return combinations of its own axes."""
        return np.asarray(np.asarray(a)[: self.n_axes] @ self.axes(x))

    def linear_axis(self, a: Array) -> LinearVector | None:
        """Return combinations of its own axes."""
        return self._linear(np.asarray(a)[: self.n_axes] @ self.axis_rows)

    @property
    def linear_place(self) -> LinearVector | None:
        """Return the position."""
        return self._linear(self.place_row)

    def _linear(self, row: Array) -> LinearVector:
        vectors = np.flatnonzero(np.abs(row) > ROUNDING)
        return LinearVector(self._columns_of(vectors), on_components(row[vectors], 3), np.zeros(3))

    def axis_jacobian(self, x: Array, a: Array) -> Array:
        """Return the same matrix for every state."""
        return on_components(np.asarray(a)[: self.n_axes] @ self.axis_rows, 3)[None]

    @cached_property
    def square(self) -> Marker:
        """Return it with a tangent of unit length where that is its only axis."""
        return self if self.n_axes == 3 else SquareMarker(self)

    def axis_bias(self, x: Array, u: Array, a: Array) -> Array:
        """Return zero: axes are linear in the coordinates."""
        return np.zeros((len(x), 3))

    def axis_stiffness(self, x: Array, a: Array, force: Array) -> Entries:
        """Return nothing, likewise."""
        return NOTHING

    def spin_jacobian(self, x: Array) -> Array:
        """Return the matrix of half the sum of d x d' over its axes, or of t x t' / |t|^2 on a line."""
        axes = self.axes(x)
        weights = 0.5 * axes if self.n_axes == 3 else axes / np.sum(axes * axes, axis=-1, keepdims=True)
        J = self.axis_rows.T @ skew(weights).reshape(len(x), self.n_axes, 9)
        return np.asarray(J.reshape(len(x), -1, 3, 3).swapaxes(1, 2).reshape(len(x), 3, -1))

    def spin_bias(self, x: Array, u: Array) -> Array:
        """Return what is left of its angular acceleration where a line is stretched; else nothing."""
        if self.n_axes == 3:
            return np.zeros((len(x), 3))
        t, rate = self.axes(x)[:, 0], self.axes(u)[:, 0]
        square = np.sum(t * t, axis=-1, keepdims=True)
        return np.asarray(-2.0 * np.sum(t * rate, axis=-1, keepdims=True) / square**2 * lever(t, rate))

    def spin_stiffness(self, x: Array, moment: Array) -> Entries:
        """Return the derivative of moment . spin Jacobian by x in one state, for a moment (3,).

        By differences of the vectors that its axes consist of: these are slopes, of bodies of any size.
        """
        count, vectors = len(self.axis_rows), np.flatnonzero(self._involved)
        columns = slice(0, 3 * count)
        alone = replace(self, columns=columns, place_row=np.zeros(count), axis_rows=np.eye(count))
        axes, every = self._combined(x, self.axis_rows).reshape(-1), np.arange(3 * count)

        def pull(moved: Array) -> Array:
            return np.asarray(moment @ alone.spin_jacobian(moved))

        slopes = fine_derivative(pull, axes, every, np.full(3 * count, FINE))
        rows = on_components(self.axis_rows[:, vectors], 3)
        return Entries.of_block(self.support, self.support, rows.T @ slopes @ rows)


def along_line(line: Marker, x: Array, a: Array) -> Array:
    """Return the derivative of `Marker.turned` of a point with one axis, by the smallest rotation to it."""
    t = line.axis(x, FIRST)
    size = np.linalg.norm(t, axis=-1, keepdims=True)
    e, change = t / size, line.axis_jacobian(x, FIRST) / size[..., None]
    swung = change - e[:, :, None] * (e[:, None] @ change)
    return np.asarray(turning(line.turned(x, a)) @ smallest_spins(FIRST, e) @ swung)


@frozen
class SquareMarker(Marker):
    """A point as what is measured along its axes sees it: with those of its frame.

    Attributes
    ----------
    point : Marker
        Its own axes are of other lengths, or lean on one another.
    """

    point: Marker
    n_dim: ClassVar[int] = 3
    n_spin: ClassVar[int] = 3
    linear_turn: ClassVar[bool] = False

    @property
    def columns(self) -> slice:  # type: ignore[override]
        """Of the point."""
        return self.point.columns

    @property
    def support(self) -> IntArray:
        """Of the point."""
        return self.point.support

    def turned(self, x: Array, a: Array) -> Array:
        """Return vectors (3,), given in its frame, in ground axes."""
        return self.point.turned(x, a)

    def spin_jacobian(self, x: Array) -> Array:
        """Return that of the frame."""
        return self.point.spin_jacobian(x)

    def spin_bias(self, x: Array, u: Array) -> Array:
        """Return that of the frame."""
        return self.point.spin_bias(x, u)

    def spin_stiffness(self, x: Array, moment: Array) -> Entries:
        """Return that of the frame."""
        return self.point.spin_stiffness(x, moment)

    def turned_jacobian(self, x: Array, a: Array) -> Array:
        """Return that of the point."""
        return self.point.turned_jacobian(x, a)


@frozen
class FrameMarker(Marker):
    """A point of a frame in space with coordinates (x, y, z, rotation vector), before a scene is assembled.

    Attributes
    ----------
    place : tuple of float
        Its place in the frame [m].
    centre : ndarray, shape (3, 3)
        How the frame is turned where the rotation vector is zero; that is in ground axes.
    n_axes : int
        How many of its axes joints may hold.
    """

    columns: slice
    place: tuple[float, ...]
    centre: Array
    n_axes: int = 3  # type: ignore[misc]
    n_dim: ClassVar[int] = 3
    n_spin: ClassVar[int] = 3
    linear: ClassVar[bool] = False
    linear_turn: ClassVar[bool] = False
    """Rotation vectors are not."""

    def _turn(self, x: Array) -> Array:
        return np.asarray(x[:, self.columns][:, 3:])

    def _arm(self, x: Array) -> Array:
        return self.turned(x, np.array(self.place))

    def position(self, x: Array) -> Array:
        """Return r + A c."""
        return np.asarray(x[:, self.columns][:, :3] + self._arm(x))

    def position_jacobian(self, x: Array) -> Array:
        """Return (1, - (A c) x T)."""
        J = np.repeat(np.eye(3, 6)[None], len(x), axis=0)
        J[:, :, 3:] = -skew(self._arm(x)) @ _rates_at(self._turn(x).tobytes())
        return J

    def turned(self, x: Array, a: Array) -> Array:
        """Return vectors (3,), given in the frame, in ground axes."""
        return np.asarray(_rotation_at(self._turn(x).tobytes()) @ (self.centre @ a))

    def spin_jacobian(self, x: Array) -> Array:
        """Return (0, T)."""
        return np.concatenate([np.zeros((len(x), 3, 3)), _rates_at(self._turn(x).tobytes())], axis=2)


@lru_cache(maxsize=256)
def _rotation_at(turn: bytes) -> Array:
    """Return the matrices of rotation vectors: the same for all points of a frame."""
    return rotation(np.frombuffer(turn).reshape(-1, 3))


@lru_cache(maxsize=256)
def _rates_at(turn: bytes) -> Array:
    return rotation_rates(np.frombuffer(turn).reshape(-1, 3))
