"""Angles about an axis in space: what drivers hold and rotational springs resist.

The axis is one of the first body, and no joint need keep it in the second.  The angle counts from where the
smallest rotation takes the second body's axis to the first's, if nothing else is said: between bodies that
share their third axis it is the one of the plane.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.matrices import Entries
from hfsim.maths.rotations import across, cross, lever, smallest_rotation, wrap
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.directions import TANGENT, Direction, OfAxes, direction, unit
from hfsim.mechanics.markers import Marker

if TYPE_CHECKING:
    from hfsim.deck.laws import Law
    from hfsim.deck.orientation import OrientationSpec

ACROSS = 1e-9
"""Cosine of the angle between an axis and a tangent up to which they are at right angles."""


class About(NamedTuple):
    """A joint or a driver holds by what angle B is turned against A about an axis of A.

    Attributes
    ----------
    axis : tuple of float
        Unit vector in A's frame.
    turn : tuple of tuple of float
        Rows of the matrix that takes vectors in B's frame to A's at angle zero.
    law : Law or None
        The angle over time [rad].
    """

    axis: Direction
    turn: tuple[Direction, ...]
    law: Law | None = None

    @classmethod
    def of(
        cls, axis: Direction, facing: Array, law: Law | None = None, zero: OrientationSpec | None = None
    ) -> About:
        """Return it for an axis in A's frame and a matrix (3, 3) from B's frame to A's at any angle.

        Angle zero is where B's frame is nearest to an orientation against A's, or without one to that of A.
        """
        own, nearest = np.asarray(unit(axis)), np.eye(3) if zero is None else zero.matrix
        turn = nearest @ smallest_rotation(facing.T @ own, nearest.T @ own)
        return cls(direction(own), tuple(direction(row) for row in turn), law)

    def between(self, first: Marker, second: Marker) -> tuple[Constraint, ...]:
        """Return one equation; none on a line whose tangent is not across the axis, or for A on a line."""
        if not self.fits(first.n_axes == 1, second.n_axes == 1):
            return ()
        zero = self._tangent if second.n_axes == 1 else np.array(across(self.axis)[0])
        pair = direction(zero), direction(cross(np.array(self.axis), zero))
        return (TurnAbout(first, second, *pair, direction(np.array(self.turn).T @ zero), law=self.law),)

    @property
    def _tangent(self) -> Array:
        """That of B at angle zero, in A's frame."""
        return np.asarray(np.array(self.turn) @ TANGENT)

    def fits(self, first: bool, second: bool) -> bool:
        """Tell whether A has the axis, and B a tangent across it."""
        return not first and not (second and abs(self._tangent @ self.axis) > ACROSS)


@dataclass(frozen=True, eq=False)
class TurnAbout(OfAxes):
    """The angle of an axis of the second body in the plane of two axes of the first follows a law.

    With c and s the products of the second body's axis with both it is Im log (c + i s).

    Attributes
    ----------
    zero, quarter : tuple of float
        Unit vectors in A's frame: from which the angle counts, and where that points after a quarter turn.
    other : tuple of float
        Unit vector in B's frame.
    """

    zero: Direction
    quarter: Direction
    other: Direction

    def _axes(self, x: Array) -> tuple[Array, Array, Array]:
        first, second = self.ends
        return (
            first.axis(x, np.array(self.zero)),
            first.axis(x, np.array(self.quarter)),
            second.axis(x, np.array(self.other)),
        )

    def _parts(self, x: Array) -> tuple[Array, Array]:
        """Return cosine and sine, times lengths, shape (n_batch, 1) each."""
        zero, quarter, other = self._axes(x)
        return np.sum(zero * other, axis=-1, keepdims=True), np.sum(quarter * other, axis=-1, keepdims=True)

    def gap(self, x: Array) -> Array:
        """Return the angle [rad], within half a turn."""
        c, s = self._parts(x)
        return np.arctan2(s, c)

    def residual(self, t: Array, x: Array) -> Array:
        """Return the angle error [rad], within half a turn."""
        return wrap(super().residual(t, x))

    def jacobian(self, end: int, x: Array) -> Array:
        """Return (c ds - s dc) / (c^2 + s^2)."""
        (c, s), (zero, quarter, other) = self._parts(x), self._axes(x)
        square = c * c + s * s
        if end:
            return np.asarray(
                ((c * quarter - s * zero) / square)[:, None]
                @ self.second.axis_jacobian(x, np.array(self.other))
            )
        J = self.first.axis_jacobian(x, np.array(self.quarter)) * (c / square)[..., None]
        J = J - self.first.axis_jacobian(x, np.array(self.zero)) * (s / square)[..., None]
        return np.asarray(other[:, None] @ J)

    def bias(self, x: Array, u: Array) -> Array:
        """Return the terms of the angle's second derivative without accelerations."""
        (c, s), (zero, quarter, other) = self._parts(x), self._axes(x)
        first, second = self.ends

        def rate(marker: Marker, own: Direction) -> Array:
            return np.asarray((marker.axis_jacobian(x, np.array(own)) @ u[:, marker.columns, None])[..., 0])

        def total(a: Array) -> Array:
            return np.asarray(np.sum(a, axis=-1, keepdims=True))

        zero1, quarter1, other1 = rate(first, self.zero), rate(first, self.quarter), rate(second, self.other)
        zero2, quarter2 = (first.axis_bias(x, u, np.array(own)) for own in (self.zero, self.quarter))
        other2 = second.axis_bias(x, u, np.array(self.other))
        c1, s1 = total(zero1 * other + zero * other1), total(quarter1 * other + quarter * other1)
        c2 = total(zero2 * other + 2.0 * zero1 * other1 + zero * other2)
        s2 = total(quarter2 * other + 2.0 * quarter1 * other1 + quarter * other2)
        square, growth = c * c + s * s, 2.0 * (c * c1 + s * s1)
        return np.asarray((c * s2 - s * c2) / square - (c * s1 - s * c1) * growth / square**2)

    def stiffness(self, x: Array, multipliers: Array) -> Entries:
        """Return the multiplier times the second derivative, Im(ddz / z - dz dz / z^2) with z = c + i s."""
        c, s = (float(part[0, 0]) for part in self._parts(x))
        z = complex(c, s)
        (zero, quarter, other), (of_zero, of_quarter, of_other) = self._axes(x), self._slopes(x)
        of_first, of_second = of_zero + 1j * of_quarter, of_other.astype(complex)
        slope = np.concatenate([other[0] @ of_first, (zero[0] + 1j * quarter[0]) @ of_second])
        second = -np.outer(slope, slope) / z**2
        k = of_first.shape[1]
        cross_term = of_first.T @ of_second / z
        second[:k, k:] += cross_term
        second[k:, :k] += cross_term.T
        columns, moment = np.concatenate([self.first.support, self.second.support]), float(multipliers[0, 0])
        parts = [Entries.of_block(columns, columns, moment * second.imag)]
        pull = moment / (c * c + s * s)
        parts.append(self.first.axis_stiffness(x, np.array(self.zero), -pull * s * other[0]))
        parts.append(self.first.axis_stiffness(x, np.array(self.quarter), pull * c * other[0]))
        across_it = pull * (c * quarter[0] - s * zero[0])
        parts.append(self.second.axis_stiffness(x, np.array(self.other), across_it))
        return Entries(*(np.concatenate(kinds) for kinds in zip(*parts, strict=True)))

    def _slopes(self, x: Array) -> Iterator[Array]:
        """Yield the derivatives (3, k) of its axes by the coordinates that each end depends on."""
        owners = (self.first, self.first, self.second)
        for marker, own in zip(owners, (self.zero, self.quarter, self.other), strict=True):
            yield marker.axis_jacobian(x, np.array(own))[0][:, marker.support - marker.columns.start]

    def reaction(self, x: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return minus the multiplier as a moment about the axis."""
        zero, quarter, _ = self._axes(x)
        return np.zeros((len(x), 3)), -multipliers * lever(zero, quarter)
