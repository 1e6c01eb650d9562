"""Markers: points of bodies with a direction, as joints, springs, loads and channels see them.

A marker answers, for a batch of absolute coordinates x (n_batch, n) and their rates u: where it is,
how it is turned, how both depend on the coordinates of its body, and the part of their second
derivative that does not come from the accelerations (the *bias*).  Only the columns of its own body
appear in its Jacobians.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from hfsim.maths.arrays import Array, ComplexArray, IntArray, distinct
from hfsim.maths.matrices import NOTHING, Entries
from hfsim.maths.rotations import as_complex, as_vectors


class Marker(Protocol):
    """A point with a direction on a body."""

    @property
    def columns(self) -> slice:
        """Coordinates of its body in x; empty for the ground."""

    @property
    def support(self) -> IntArray:
        """Those of its body's coordinates that position and angle depend on, as columns of x."""

    @property
    def linear(self) -> bool:
        """Whether the position is a linear function of the coordinates."""

    @property
    def keeps_turns(self) -> bool:
        """Whether the angle counts full turns."""

    def position(self, x: Array) -> Array:
        """Return the position [m], shape (n_batch, 2)."""

    def position_jacobian(self, x: Array) -> Array:
        """Return its derivative by the body's coordinates, shape (n_batch or 1, 2, n_columns)."""

    def position_bias(self, x: Array, u: Array) -> Array:
        """Return its second time derivative at zero accelerations [m/s^2], shape (n_batch, 2)."""

    def angle(self, x: Array) -> Array:
        """Return the angle of its direction [rad], shape (n_batch,); full turns may be lost."""

    def angle_jacobian(self, x: Array) -> Array:
        """Return its derivative by the body's coordinates, shape (n_batch or 1, n_columns)."""

    def angle_bias(self, x: Array, u: Array) -> Array:
        """Return its second time derivative at zero accelerations [rad/s^2], shape (n_batch,)."""

    def position_stiffness(self, x: Array, force: Array) -> Entries:
        """Return force . d2r/dx2 in one state, for a force (2,) on the point."""

    def angle_stiffness(self, x: Array, moment: float) -> Entries:
        """Return moment times d2 angle/dx2 in one state."""


ROUNDING = 1e-13
"""Entries of shape rows that are zero but for rounding."""


def joint_support(*markers: Marker) -> IntArray:
    """Return the coordinates that any of some markers depends on, as columns of x."""
    return distinct(np.concatenate([marker.support for marker in markers]))


@dataclass(frozen=True)
class GroundMarker:
    """A point of the ground, or of a body welded to it, turned by an angle [rad]; it never moves."""

    place: tuple[float, float] = (0.0, 0.0)
    turn: float = 0.0
    columns: slice = field(default_factory=lambda: slice(0, 0))
    linear: bool = True
    keeps_turns: bool = True

    @property
    def support(self) -> IntArray:
        """Return no columns."""
        return np.zeros(0, dtype=np.intp)

    def position(self, x: Array) -> Array:
        """Return the fixed place."""
        return np.broadcast_to(np.array(self.place), (len(x), 2))

    def position_jacobian(self, x: Array) -> Array:
        """Return an empty matrix."""
        return np.zeros((1, 2, 0))

    def position_bias(self, x: Array, u: Array) -> Array:
        """Return zero."""
        return np.zeros((len(x), 2))

    def angle(self, x: Array) -> Array:
        """Return the fixed angle."""
        return np.full(len(x), self.turn)

    def angle_jacobian(self, x: Array) -> Array:
        """Return an empty row."""
        return np.zeros((1, 0))

    def angle_bias(self, x: Array, u: Array) -> Array:
        """Return zero."""
        return np.zeros(len(x))

    def position_stiffness(self, x: Array, force: Array) -> Entries:
        """Return nothing."""
        return NOTHING

    def angle_stiffness(self, x: Array, moment: float) -> Entries:
        """Return nothing."""
        return NOTHING


@dataclass(frozen=True)
class NodalMarker:
    """A material point of a body whose coordinates are absolute nodal vectors.

    Attributes
    ----------
    columns : slice
    place_row, slope_row : ndarray, shape (n_vectors,)
        Shape rows of the position and of the slope vector that gives the direction.
    """

    columns: slice
    place_row: Array
    slope_row: Array
    linear: bool = True
    keeps_turns: bool = False

    @cached_property
    def support(self) -> IntArray:
        """Columns of the nodal vectors with an entry in either row."""
        involved = (np.abs(self.place_row) > ROUNDING) | (np.abs(self.slope_row) > ROUNDING)
        return np.asarray(self.columns.start + np.flatnonzero(np.repeat(involved, 2)))

    @cached_property
    def place_columns(self) -> IntArray | None:
        """The two coordinates that are the position; None between nodes."""
        return self._vector_columns(self.place_row)

    @cached_property
    def slope_columns(self) -> IntArray | None:
        """The two coordinates that are the slope vector; None between nodes."""
        return self._vector_columns(self.slope_row)

    def _vector_columns(self, row: Array) -> IntArray | None:
        k = int(np.argmax(np.abs(row)))
        rest = row.copy()
        rest[k] -= 1.0
        alone = np.abs(rest).max() <= ROUNDING
        return self.columns.start + 2 * k + np.arange(2) if alone else None

    def _nodes(self, x: Array) -> Array:
        return x[:, self.columns].reshape(len(x), -1, 2)

    def position(self, x: Array) -> Array:
        """Return N x."""
        return np.asarray(self.place_row @ self._nodes(x))

    def position_jacobian(self, x: Array) -> Array:
        """Return N, the same for every state."""
        return self._place_jacobian

    @cached_property
    def _place_jacobian(self) -> Array:
        return np.kron(self.place_row, np.eye(2))[None]

    def position_bias(self, x: Array, u: Array) -> Array:
        """Return zero: the position is linear."""
        return np.zeros((len(x), 2))

    def _slope(self, x: Array) -> ComplexArray:
        """Return the slope vector t as a complex number."""
        at = self.slope_columns
        if at is not None:
            return as_complex(x[:, at[0] : at[0] + 2])
        return as_complex(self.slope_row @ self._nodes(x))

    def angle(self, x: Array) -> Array:
        """Return the angle of the slope vector, Im log t."""
        return np.angle(self._slope(x))

    def angle_jacobian(self, x: Array) -> Array:
        """Return the row of Im(dt / t)."""
        turn = as_vectors(1j / self._slope(x).conj())
        at = self.slope_columns
        if at is None:
            return np.asarray((self.slope_row[:, None] * turn[:, None, :]).reshape(len(x), -1))
        J = np.zeros((len(x), self.columns.stop - self.columns.start))
        J[:, at[0] - self.columns.start : at[0] - self.columns.start + 2] = turn
        return J

    def angle_bias(self, x: Array, u: Array) -> Array:
        """Return -Im((t'/t)^2)."""
        rate = self._slope(u) / self._slope(x)
        return np.asarray(-(rate * rate).imag)

    def position_stiffness(self, x: Array, force: Array) -> Entries:
        """Return nothing: the position is linear."""
        return NOTHING

    def angle_stiffness(self, x: Array, moment: float) -> Entries:
        """Return the second derivative of Im log t: -Im(dt dt / t^2)."""
        w = moment / complex(self._slope(x)[0]) ** 2
        turn = np.array([[-w.imag, -w.real], [-w.real, w.imag]])
        row = self.slope_row[(self.support[::2] - self.columns.start) // 2]
        block = (row[:, None, None, None] * row[:, None]) * turn[:, None]
        k = len(self.support)
        return Entries.of_block(self.support, self.support, block.reshape(k, k))


@dataclass(frozen=True)
class RigidMarker:
    """A point of a rigid body with coordinates (x, y, angle)."""

    columns: slice
    offset: tuple[float, float] = (0.0, 0.0)
    keeps_turns: bool = True

    @property
    def support(self) -> IntArray:
        """The three coordinates."""
        return np.arange(self.columns.start, self.columns.stop)

    @property
    def place_columns(self) -> IntArray | None:
        """The two coordinates that are the position; None away from the centre of mass."""
        return self.columns.start + np.arange(2) if self.linear else None

    @property
    def linear(self) -> bool:
        """Whether the point is the centre of mass."""
        return self.offset == (0.0, 0.0)

    def _arm(self, x: Array) -> ComplexArray:
        """Return A c as a complex number."""
        return np.asarray(np.exp(1j * x[:, self.columns.start + 2]) * complex(*self.offset))

    def position(self, x: Array) -> Array:
        """Return r + A c."""
        i = self.columns.start
        return np.asarray(x[:, i : i + 2] + as_vectors(self._arm(x)))

    def position_jacobian(self, x: Array) -> Array:
        """Return (1, A c turned by a quarter)."""
        if self.linear:
            return np.eye(2, 3)[None]
        J = np.zeros((len(x), 2, 3))
        J[:, 0, 0] = J[:, 1, 1] = 1.0
        J[:, :, 2] = as_vectors(1j * self._arm(x))
        return J

    def position_bias(self, x: Array, u: Array) -> Array:
        """Return the centripetal acceleration."""
        omega = u[:, self.columns.start + 2]
        return as_vectors(-omega * omega * self._arm(x))

    def angle(self, x: Array) -> Array:
        """Return the body's angle, with its full turns."""
        return np.asarray(x[:, self.columns.start + 2])

    def angle_jacobian(self, x: Array) -> Array:
        """Return (0, 0, 1)."""
        return np.array([[0.0, 0.0, 1.0]])

    def angle_bias(self, x: Array, u: Array) -> Array:
        """Return zero."""
        return np.zeros(len(x))

    def position_stiffness(self, x: Array, force: Array) -> Entries:
        """Return the force times -A c, on the angle."""
        angle = self.support[2:]
        return Entries(angle, angle, np.array([-float(as_vectors(self._arm(x))[0] @ force)]))

    def angle_stiffness(self, x: Array, moment: float) -> Entries:
        """Return nothing: the angle is a coordinate."""
        return NOTHING
