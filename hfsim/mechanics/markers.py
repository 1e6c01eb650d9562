"""Markers: points of bodies with a frame there, as joints, springs, loads and channels see them.

A marker answers, for a batch of absolute coordinates x (n_batch, n) and their rates u: where it is,
how it is turned, how both depend on the coordinates of its body, and the part of their second
derivative that does not come from the accelerations (the *bias*).  Only the columns of its own body
appear in its Jacobians.
"""

from __future__ import annotations

from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, TypeVar

import numpy as np

from hfsim.maths.arrays import Array, BoolArray, ComplexArray, IntArray, distinct, on_components
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import NOTHING, Entries
from hfsim.maths.rotations import lever, rotate, spun, turning
from hfsim.mechanics.pose import Pose
from hfsim.mechanics.products import LinearVector

if TYPE_CHECKING:
    from hfsim.mechanics.crossed import CrossedVector

_Matrix = TypeVar("_Matrix", Array, ComplexArray)


class Marker:
    """A point of a body with a frame; a kind of marker says what differs from one that never moves.

    Attributes
    ----------
    n_dim, n_spin : int
        Numbers of a vector, and axes to turn about.
    n_axes : int
        How many of its own axes it has: one where it is on a line without sections in space.
    nodal : bool
        Whether the coordinates of its body are nodal vectors.
    alike : bool
        Whether `axis` of a sum of vectors, be they complex, is the sum of theirs.
    linear_turn, keeps_turns : bool
        Whether its turn is a linear function of the coordinates; whether the angle counts full turns.
    lead : float
        Angle from its first axis to the vector of ``slope_columns`` in the plane [rad].
    columns : slice
        Coordinates of its body in x; empty for the ground.
    offset : tuple of float, or None
        Its place in the axes of a rigid body with the coordinates ``support``; None on other bodies.
    """

    n_dim: ClassVar[int] = 2
    n_spin: ClassVar[int] = 1
    n_axes: ClassVar[int] = 2
    nodal: ClassVar[bool] = False
    alike: ClassVar[bool] = True
    linear_turn: ClassVar[bool] = True
    keeps_turns: ClassVar[bool] = True
    lead: ClassVar[float] = 0.0
    columns: slice
    offset: tuple[float, ...] | None = None

    @property
    def grounded(self) -> bool:
        """Whether it is a point of the ground."""
        return bool(self.columns.start == self.columns.stop)

    @property
    def support(self) -> IntArray:
        """Coordinates of its body that place and turn depend on, as columns of x."""
        return np.arange(self.columns.start, self.columns.stop)

    @property
    def linear(self) -> bool:
        """Whether its place is a linear function of the coordinates."""
        return True

    @property
    def place_columns(self) -> IntArray | None:
        """Coordinates that are its place, shape (n_dim,), where there are such."""
        return None

    @property
    def slope_columns(self) -> IntArray | None:
        """Coordinates that are the vector by which it turns, shape (n_dim,), where there are such."""
        return None

    def position(self, x: Array) -> Array:
        """Return the position [m], shape (n_batch, n_dim)."""
        raise NotImplementedError

    def position_jacobian(self, x: Array) -> Array:
        """Return its derivative by the body's coordinates, shape (n_batch or 1, n_dim, n_columns)."""
        raise NotImplementedError

    def position_bias(self, x: Array, u: Array) -> Array:
        """Return its second time derivative at zero accelerations [m/s^2], shape (n_batch, n_dim)."""
        return np.zeros((len(x), self.n_dim))

    def position_stiffness(self, x: Array, force: Array) -> Entries:
        """Return force . d2r/dx2 in one state, for a force (n_dim,) on the point."""
        return NOTHING

    def angle(self, x: Array) -> Array:
        """Return the angle of its first axis in the plane [rad], shape (n_batch,); full turns may be lost."""
        raise NotImplementedError

    def turned(self, x: Array, a: Array) -> Array:
        """Return vectors (n_dim,), given in its axes, in ground axes, shape (n_batch, n_dim)."""
        return rotate(self.angle(x), a)

    def turned_jacobian(self, x: Array, a: Array) -> Array:
        """Return the derivative of `turned` by the coordinates, shape (n_batch, n_dim, n_columns)."""
        return turning(self.turned(x, a)) @ self.spin_jacobian(x)

    def frame(self, x: Array) -> Array:
        """Return its axes, of unit length and at right angles, as columns, shape (n_batch, n_dim, n_dim)."""
        return np.stack([self.turned(x, axis) for axis in np.eye(self.n_dim)], axis=-1)

    def axis(self, x: Array, a: Array) -> Array:
        """Return vectors as `turned`, but as long as its own axes are: what joints hold directions of."""
        return self.turned(x, a)

    def axis_jacobian(self, x: Array, a: Array) -> Array:
        """Return the derivative of `axis` by the coordinates, shape (n_batch or 1, n_dim, n_columns)."""
        return turning(self.axis(x, a)) @ self.spin_jacobian(x)

    def axis_bias(self, x: Array, u: Array, a: Array) -> Array:
        """Return its second time derivative at zero accelerations, shape (n_batch, n_dim)."""
        spin, axis = self.spin(x, u), self.axis(x, a)
        return spun(self.spin_bias(x, u), axis) + spun(spin, spun(spin, axis))

    def linear_axis(self, a: Array) -> LinearVector | None:
        """Return `axis` as a linear function of the coordinates in space; None where it is not."""
        return None

    def crossed_axis(self, a: Array) -> CrossedVector | None:
        """Return `axis` as such a function with products of two others; None where it is not."""
        from hfsim.mechanics.crossed import CrossedVector

        linear = self.linear_axis(a)
        return None if linear is None else CrossedVector.without(linear)

    @property
    def linear_place(self) -> LinearVector | None:
        """The position as a linear function of the coordinates in space; None where it is not."""
        return None

    @property
    def section(self) -> Array:
        """Axes of its section, undeformed, in its own frame, as columns, in space."""
        return np.eye(3)

    @property
    def oblique(self) -> Marker:
        """The same point with axes, of any length and angle, that are linear in the coordinates.

        The third is along the third axis of its section, the second in the plane of the last two; a first may
        lack.
        """
        return self

    @property
    def square(self) -> Marker:
        """The same point with axes of unit length and at right angles, along which distances are measured.

        They are those of `frame`, but linear in the coordinates where its own are square in every state.
        """
        return self

    def axis_stiffness(self, x: Array, a: Array, force: Array) -> Entries:
        """Return force . d2(axis)/dx2 in one state for a vector (n_dim,), of an axis that turns."""
        moment = lever(self.turned(x, a), force[None])[0]
        change = lever(self.turned_jacobian(x, a)[0].T, force).T
        return Entries.joined([self.spin_stiffness(x, moment), self.on_turn(x, change)])

    def spin_jacobian(self, x: Array) -> Array:
        """Return the derivative of its turn by the coordinates, shape (n_batch or 1, n_spin, n_columns)."""
        raise NotImplementedError

    def spin_bias(self, x: Array, u: Array) -> Array:
        """Return its angular acceleration at zero accelerations [rad/s^2], shape (n_batch, n_spin)."""
        return np.zeros((len(x), self.n_spin))

    def spin_stiffness(self, x: Array, moment: Array) -> Entries:
        """Return the derivative of moment . spin Jacobian by x in one state, for a moment (n_spin,)."""
        return NOTHING

    def on_place(self, x: Array, change: Array) -> Entries:
        """Return what changes of a force on the point, (n_dim, n_columns), make in one state."""
        return self._onto(self.position_jacobian(x), change)

    def on_turn(self, x: Array, change: Array) -> Entries:
        """Return what changes of a moment, (n_spin, n_columns), make in one state."""
        return self._onto(self.spin_jacobian(x), change)

    def _onto(self, J: Array, change: Array) -> Entries:
        block = self.of_support(J).T @ self.of_support(change[None])
        return Entries.of_block(self.support, self.support, block)

    def of_support(self, J: _Matrix) -> _Matrix:
        """Return the columns of what it depends on, (k, n_support), of a Jacobian (1, k, n_columns)."""
        kept: _Matrix = J[0][:, self.support - self.columns.start]
        return kept

    def velocity(self, x: Array, u: Array) -> Array:
        """Return the velocity [m/s], shape (n_batch, n_dim)."""
        return np.asarray((self.position_jacobian(x) @ u[:, self.columns, None])[..., 0])

    def spin(self, x: Array, u: Array) -> Array:
        """Return the angular velocity [rad/s], shape (n_batch, n_spin)."""
        return np.asarray((self.spin_jacobian(x) @ u[:, self.columns, None])[..., 0])

    def acceleration(self, x: Array, u: Array, a: Array) -> Array:
        """Return the acceleration [m/s^2], shape (n_batch, n_dim), at accelerations (n_batch, n_x)."""
        return self.velocity(x, a) + self.position_bias(x, u)

    def angular_acceleration(self, x: Array, u: Array, a: Array) -> Array:
        """Return the angular acceleration [rad/s^2], shape (n_batch, n_spin), at such."""
        return self.spin(x, a) + self.spin_bias(x, u)


ROUNDING = 1e-13
"""Entries of shape rows that are zero but for rounding."""


def joint_support(*markers: Marker) -> IntArray:
    """Return the coordinates that any of some markers depends on, as columns of x."""
    return distinct(np.concatenate([np.zeros(0, dtype=np.intp), *(marker.support for marker in markers)]))


@frozen
class GroundMarker(Marker):
    """A point of the ground, or of a body welded to it; it never moves."""

    pose: Pose
    columns: slice = field(default_factory=lambda: slice(0, 0))

    @property
    def n_dim(self) -> int:  # type: ignore[override]
        """Of the space it is in."""
        return len(self.pose.origin)

    @property
    def n_spin(self) -> int:  # type: ignore[override]
        """Of the space it is in."""
        return len(self.pose.turn)

    @property
    def n_axes(self) -> int:  # type: ignore[override]
        """All of the space it is in."""
        return self.n_dim

    def position(self, x: Array) -> Array:
        """Return the fixed place."""
        return np.broadcast_to(self.pose.origin, (len(x), self.n_dim))

    def position_jacobian(self, x: Array) -> Array:
        """Return an empty matrix."""
        return np.zeros((1, self.n_dim, 0))

    def linear_axis(self, a: Array) -> LinearVector | None:
        """Return a constant in space."""
        return LinearVector.constant(np.asarray(a) @ self._axes) if self.n_dim == 3 else None

    @property
    def linear_place(self) -> LinearVector | None:
        """A constant in space."""
        return LinearVector.constant(self.pose.origin) if self.n_dim == 3 else None

    def angle(self, x: Array) -> Array:
        """Return the fixed angle."""
        return np.full(len(x), self.pose.angle)

    def turned(self, x: Array, a: Array) -> Array:
        """Return the fixed vectors."""
        own = np.asarray(a)
        fixed = own @ self._axes if self.n_dim == 3 else self.pose.turned(own)
        return np.repeat(fixed[None], len(x), axis=0)

    @cached_property
    def _axes(self) -> Array:
        """Its axes as rows."""
        return self.pose.turned(np.eye(self.n_dim))

    def spin_jacobian(self, x: Array) -> Array:
        """Return an empty matrix."""
        return np.zeros((1, self.n_spin, 0))


@frozen
class LinearMarker(Marker):
    """A material point of a body whose coordinates are absolute vectors, positions and directions.

    Attributes
    ----------
    place_row : ndarray, shape (n_vectors,)
        Shape row of the position.
    """

    columns: slice
    place_row: Array
    linear_turn: ClassVar[bool] = False
    keeps_turns: ClassVar[bool] = False
    nodal: ClassVar[bool] = True

    @property
    def _involved(self) -> BoolArray:
        """Which vectors place or directions depend on."""
        raise NotImplementedError

    @cached_property
    def support(self) -> IntArray:
        """Columns of the vectors with an entry in any row."""
        return self._columns_of(np.flatnonzero(self._involved))

    @cached_property
    def place_columns(self) -> IntArray | None:
        """The coordinates that are the position; None between nodes."""
        return self._vector_columns(self.place_row)

    def _columns_of(self, vectors: IntArray) -> IntArray:
        """Return the columns of vectors, one vector after the other."""
        first = self.columns.start + self.n_dim * vectors
        return np.asarray(first[:, None] + np.arange(self.n_dim)).ravel()

    def _vector_columns(self, row: Array) -> IntArray | None:
        k = int(np.argmax(np.abs(row)))
        rest = row.copy()
        rest[k] -= 1.0
        return self._columns_of(np.array([k])) if np.abs(rest).max() <= ROUNDING else None

    def _combined(self, x: Array, row: Array) -> Array:
        """Return combinations of the vectors, shape (n_batch, ..., n_dim), for rows (..., n_vectors)."""
        return np.asarray(row @ x[:, self.columns].reshape(len(x), -1, self.n_dim))

    def position(self, x: Array) -> Array:
        """Return N x."""
        return self._combined(x, self.place_row)

    def position_jacobian(self, x: Array) -> Array:
        """Return N, the same for every state."""
        return self._place_jacobian

    @cached_property
    def _place_jacobian(self) -> Array:
        return on_components(self.place_row, self.n_dim)[None]
