"""Markers in the plane: on bodies that turn by an angle, and on nodes whose slope is a direction."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array, BoolArray, ComplexArray, IntArray
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.maths.rotations import as_complex, as_vectors
from hfsim.mechanics.markers import ROUNDING, LinearMarker, Marker

_PARTS, _SIGNS = np.array([[1, 0], [0, 1]]), np.array([[-1.0, -1.0], [-1.0, 1.0]])
"""Which parts of a complex number, and with which signs, the matrix of -Im(dt dt w) consists of."""


@frozen
class NodalMarker(LinearMarker):
    """A material point of a planar body whose coordinates are absolute nodal vectors.

    Attributes
    ----------
    slope_row : ndarray, shape (n_vectors,)
        Shape row of the slope vector that gives the direction.
    """

    slope_row: Array

    @cached_property
    def slope_columns(self) -> IntArray | None:
        """The coordinates that are the slope vector; None between nodes."""
        return self._vector_columns(self.slope_row)

    @property
    def _involved(self) -> BoolArray:
        return (np.abs(self.place_row) > ROUNDING) | (np.abs(self.slope_row) > ROUNDING)

    def _slope(self, x: Array) -> ComplexArray:
        """Return the slope vector t as a complex number."""
        at = self.slope_columns
        return as_complex(self._combined(x, self.slope_row) if at is None else x[:, at[0] : at[-1] + 1])

    def angle(self, x: Array) -> Array:
        """Return the angle of the slope vector, Im log t."""
        return np.angle(self._slope(x))

    def spin_jacobian(self, x: Array) -> Array:
        """Return the row of Im(dt / t)."""
        turn = as_vectors(1j / self._slope(x).conj())
        at = self.slope_columns
        if at is None:
            return np.asarray((self.slope_row[:, None] * turn[:, None, :]).reshape(len(x), 1, -1))
        first = self.columns.start
        J = np.zeros((len(x), 1, self.columns.stop - first))
        J[:, 0, at[0] - first : at[-1] + 1 - first] = turn
        return J

    def spin_bias(self, x: Array, u: Array) -> Array:
        """Return -Im((t'/t)^2)."""
        rate = self._slope(u) / self._slope(x)
        return np.asarray(-(rate * rate).imag)[:, None]

    def spin_stiffness(self, x: Array, moment: Array) -> Entries:
        """Return the second derivative of Im log t: -Im(dt dt / t^2)."""
        w = as_vectors(moment / self._slope(x) ** 2)[0]
        dyad = self._slope_dyad
        values = (dyad * (w[_PARTS] * _SIGNS)[:, None]).reshape(2 * len(dyad), -1)
        return Entries.of_block(self.support, self.support, values)

    @cached_property
    def _slope_dyad(self) -> Array:
        """Products of entries of the slope row, (k, 1, k, 1)."""
        row = self.slope_row[self._involved]
        return np.outer(row, row)[:, None, :, None]


@frozen
class RigidMarker(Marker):
    """A point of a rigid body with coordinates (x, y, angle)."""

    columns: slice
    offset: tuple[float, ...] = (0.0, 0.0)

    @property
    def linear(self) -> bool:
        """Whether the point is the centre of mass."""
        return self.offset == (0.0, 0.0)

    @property
    def place_columns(self) -> IntArray | None:
        """The two coordinates that are the position; None away from the centre of mass."""
        return self.support[: self.n_dim] if self.linear else None

    def _arm(self, x: Array) -> ComplexArray:
        """Return A c as a complex number."""
        return np.asarray(np.exp(1j * self.angle(x)) * complex(*self.offset))

    def position(self, x: Array) -> Array:
        """Return r + A c."""
        return np.asarray(x[:, self.columns][:, : self.n_dim] + as_vectors(self._arm(x)))

    def position_jacobian(self, x: Array) -> Array:
        """Return (1, A c turned by a quarter)."""
        if self.linear:
            return self._units[:, : self.n_dim]
        J = np.repeat(self._units[:, : self.n_dim], len(x), axis=0)
        J[:, :, -1] = as_vectors(1j * self._arm(x))
        return J

    def position_bias(self, x: Array, u: Array) -> Array:
        """Return the centripetal acceleration."""
        omega = self.angle(u)
        return as_vectors(-omega * omega * self._arm(x))

    def position_stiffness(self, x: Array, force: Array) -> Entries:
        """Return the force times -A c, on the angle."""
        angle = self.support[self.n_dim :]
        return Entries(angle, angle, -(as_vectors(self._arm(x))[:1] @ force))

    def angle(self, x: Array) -> Array:
        """Return the body's angle, with its full turns."""
        return np.asarray(x[:, self.columns.stop - 1])

    def spin_jacobian(self, x: Array) -> Array:
        """Return (0, 0, 1)."""
        return self._units[:, self.n_dim :]

    @cached_property
    def _units(self) -> Array:
        """Unit changes of its place and turn by those of the coordinates, (1, 3, 3)."""
        return np.eye(self.n_dim + self.n_spin)[None]
