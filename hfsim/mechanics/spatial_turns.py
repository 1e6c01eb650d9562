"""Angles about an axis in space: what drivers hold and rotational springs resist; and torques about one.

The axis is one of the first body, and no joint need keep it in the second.  The angle is that of the turn
about it from which a smallest rotation leads to the second body's frame (swing and twist): it is known until
the second body's axis points the other way.  It counts from where the smallest rotation takes the second
body's axis to the first's, if nothing else is said: between bodies that share their third axis it is the one
of the plane.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, ComplexArray
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.maths.rotations import across, cross, dot, smallest_rotation, wrap
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.directions import TANGENT, THIRD, Direction, OfAxes, direction, unit
from hfsim.mechanics.markers import Marker

if TYPE_CHECKING:
    from hfsim.deck.laws import Law
    from hfsim.deck.orientation import OrientationSpec

ACROSS = 1e-9
"""Cosine of the angle between an axis and a tangent up to which they are at right angles."""
LOST = 1e-8
"""Size of z, two where axes agree, below which slopes of its angle fall to zero: at zero it has none."""


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
        line, back = second.n_axes == 1, np.array(self.turn).T
        zero = self._tangent if line else np.array(across(self.axis)[0])
        quarter = cross(np.array(self.axis), zero)
        others = [direction(back @ own) for own in ((zero,) if line else (zero, quarter))]
        return (TurnAbout(first, second, direction(zero), direction(quarter), tuple(others), law=self.law),)

    @property
    def _tangent(self) -> Array:
        """That of B at angle zero, in A's frame."""
        return np.asarray(np.array(self.turn) @ TANGENT)

    def fits(self, first: bool, second: bool) -> bool:
        """Tell whether A has the axis, and B a tangent across it."""
        return not first and not (second and abs(self._tangent @ self.axis) > ACROSS)


def about(axis: Direction | None, facing: Array) -> About:
    """Return the angle about the axis of a joint, as a driver has it."""
    return About.of(axis or THIRD, facing)


class TorqueAbout(NamedTuple):
    """What a motor turns: B about an axis that A carries, whatever the angle.

    Of a line, whose tangent bears no torque about itself, it is the angle about the axis.
    """

    angle: About

    def between(self, first: Marker, second: Marker) -> tuple[Constraint, ...]:
        """Return what is measured for two markers; nothing where the angle has no meaning."""
        if second.n_axes == 1 or not self.angle.fits(first.n_axes == 1, False):
            return self.angle.between(first, second)
        return (SpinAbout(first, second, self.angle.axis),)

    def fits(self, first: bool, second: bool) -> bool:
        """Tell whether A has the axis, and B a tangent across it."""
        return self.angle.fits(first, second)


@frozen
class SpinAbout(OfAxes):
    """The spin of the second body against the first about an axis of that: of no angle it is the rate.

    What acts on it is a torque about the axis, and its opposite.

    Attributes
    ----------
    axis : tuple of float
        Unit vector in A's frame.
    """

    axis: Direction
    counts_turns: ClassVar[bool] = False

    def gap(self, x: Array) -> Array:
        """Return zero: there is no angle."""
        return np.zeros((len(x), 1))

    def jacobian(self, end: int, x: Array) -> Array:
        """Return the derivative of that spin by the rates of one end."""
        row = self.first.turned(x, np.array(self.axis))[:, None] @ self.ends[end].spin_jacobian(x)
        return np.asarray(row if end else -row)

    def stiffness(self, x: Array, multipliers: Array) -> Entries:
        """Return the multiplier times what bends the turns of both ends, and what turns the axis."""
        (a, b), own, pull = self.ends, np.array(self.axis), multipliers[0, 0]
        moment, turning = pull * a.turned(x, own)[0], pull * a.of_support(a.turned_jacobian(x, own))
        parts = [b.spin_stiffness(x, moment), a.spin_stiffness(x, -moment)]
        for marker, sign in ((a, -1.0), (b, 1.0)):
            block = sign * marker.of_support(marker.spin_jacobian(x)).T @ turning
            parts.append(Entries.of_block(marker.support, a.support, block))
        return Entries.joined(parts)

    def reaction(self, x: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return minus the multiplier as a moment about the axis."""
        return np.zeros((len(x), 3)), -multipliers * self.first.turned(x, np.array(self.axis))


@frozen
class TurnAbout(OfAxes):
    """The angle of axes of the second body about the axis of the first follows a law.

    With n = zero + i quarter and o = other - i next it is the angle of z = n . o: both products are the same
    where the bodies share the axis; elsewhere they are those of swing and twist.  A line has no next.

    Attributes
    ----------
    zero, quarter : tuple of float
        Unit vectors in A's frame: from which the angle counts, and where that points after a quarter turn.
    others : tuple of tuple of float
        Where these are in B's frame at angle zero; on a line the first alone.
    """

    wraps: ClassVar[bool] = True
    zero: Direction
    quarter: Direction
    others: tuple[Direction, ...]

    @property
    def axis(self) -> Direction:
        """The axis in A's frame."""
        return direction(cross(np.array(self.zero), np.array(self.quarter)))

    @cached_property
    def _axes(self) -> tuple[tuple[tuple[complex, Array], ...], ...]:
        """Factors and axes of each end, whose sums are n and o."""
        ends = ((1.0, self.zero), (1.0j, self.quarter)), zip((1.0, -1.0j), self.others, strict=False)
        return tuple(tuple((factor, np.array(own)) for factor, own in end) for end in ends)

    @cached_property
    def _sums_of_axes(self) -> tuple[ComplexArray, ...]:
        """Their sums, for markers whose axes are as they are."""
        return tuple(np.asarray(sum(factor * own for factor, own in end)) for end in self._axes)

    def _sum(self, end: int, of: Callable[[Marker, Array], Array]) -> ComplexArray:
        """Return n or o, or what each end's marker says of its axes instead."""
        marker = self.ends[end]
        if marker.alike:
            together: Any = self._sums_of_axes[end]
            return np.asarray(of(marker, together))
        return np.asarray(sum(factor * of(marker, own) for factor, own in self._axes[end]))

    def _both(self, x: Array) -> tuple[ComplexArray, ComplexArray]:
        """Return n and o, shape (n_batch, 3)."""
        n, o = (self._sum(end, lambda marker, own: marker.axis(x, own)) for end in (0, 1))
        return n, o

    def _over(self, x: Array) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return n and o, shape (n_batch, 3), and 1 / z (n_batch, 1), kept finite."""
        n, o = self._both(x)
        z = dot(n, o)
        return n, o, np.asarray(np.conj(z) / np.maximum(z.real**2 + z.imag**2, LOST**2))

    def _slope(self, end: int, x: Array) -> ComplexArray:
        """Return the derivative of n or o by the coordinates of its body, shape (n_batch, 3, k)."""
        return self._sum(end, lambda marker, own: marker.axis_jacobian(x, own))

    def gap(self, x: Array) -> Array:
        """Return the angle [rad], within half a turn."""
        return np.angle(dot(*self._both(x)))

    def residual(self, t: Array, x: Array) -> Array:
        """Return the angle error [rad], within half a turn."""
        return wrap(super().residual(t, x))

    def jacobian(self, end: int, x: Array) -> Array:
        """Return Im dz / z."""
        *both, over = self._over(x)
        return self._by(end, x, both[1 - end] * over)

    def measured(self, x: Array, ends: Sequence[int]) -> tuple[Array, list[Array]]:
        """Return the angle, and Im dz / z by some ends, of axes that are computed once."""
        *both, over = self._over(x)
        return np.angle(dot(*both)), [self._by(end, x, both[1 - end] * over) for end in ends]

    def _by(self, end: int, x: Array, other: ComplexArray) -> Array:
        """Return Im dz / z by one end, of the other end's n or o over z."""
        return np.imag(other[:, None] @ self._slope(end, x))

    def bias(self, x: Array, u: Array) -> Array:
        """Return the angle's second derivative without accelerations, Im (z'' / z - (z' / z)^2)."""
        n, o, over = self._over(x)
        n1, o1 = ((self._slope(end, x) @ u[:, m.columns, None])[..., 0] for end, m in enumerate(self.ends))
        n2, o2 = (self._sum(end, lambda marker, own: marker.axis_bias(x, u, own)) for end in (0, 1))
        once, twice = dot(n1, o) + dot(n, o1), dot(n2, o) + 2.0 * dot(n1, o1) + dot(n, o2)
        return np.imag(twice * over - (once * over) ** 2)

    def stiffness(self, x: Array, multipliers: Array) -> Entries:
        """Return the multiplier times the second derivative, Im (ddz / z - dz dz / z^2)."""
        moment = multipliers[0, 0]
        n, o, over = (part[0] for part in self._over(x))
        by_n, by_o = (marker.of_support(self._slope(end, x)) for end, marker in enumerate(self.ends))
        slope = np.concatenate([o @ by_n, n @ by_o]) * over
        second, k = -np.outer(slope, slope), by_n.shape[1]
        mixed = by_n.T @ by_o * over
        second[:k, k:] += mixed
        second[k:, :k] += mixed.T
        columns = np.concatenate([marker.support for marker in self.ends])
        parts = [Entries.of_block(columns, columns, moment * second.imag)]
        for marker, axes, pull in zip(self.ends, self._axes, (o * over, n * over), strict=True):
            for factor, own in axes:
                parts.append(marker.axis_stiffness(x, own, moment * np.imag(factor * pull)))
        return Entries(*(np.concatenate(kinds) for kinds in zip(*parts, strict=True)))

    def reaction(self, x: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return minus the multiplier times what the angle changes by with small turns of B."""
        n, o, over = self._over(x)
        return np.zeros((len(x), 3)), -multipliers * np.imag(np.cross(o, n) * over)
