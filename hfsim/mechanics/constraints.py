"""Constraint equations Phi(x, t) = 0 between two markers, of which joints are made.

A joint says what it holds as data, `Shift` and `Turn`; `constraints_of` makes equations of that.  A
constraint is a gap between two markers that follows a target: phi(x) - offset - law(t) = 0.  What each
blocks is said once here, with its Jacobian Phi_x and the bias of phi, the part of its second derivative
that does not come from the accelerations; the rest is common.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, NamedTuple, Protocol

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.maths.rotations import wrap
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.products import Product

if TYPE_CHECKING:
    from hfsim.deck.laws import Law


class Held(Protocol):
    """One thing that a joint holds between the frames of two points, A and B."""

    def between(self, first: Marker, second: Marker) -> tuple[Constraint, ...]:
        """Return the equations for a marker at A and one at B."""

    def fits(self, first: bool, second: bool) -> bool:
        """Tell whether it has a meaning where A, or B, is on a line without sections."""


class Shift(NamedTuple):
    """A joint holds B where A is, or at a distance from A along an axis.

    Attributes
    ----------
    axis : tuple of float, or None
        In A's frame, of any length; None where both points meet.
    law : Law, or None
        Distance over time [m]; zero without it.
    """

    axis: tuple[float, ...] | None = None
    law: Law | None = None

    def between(self, first: Marker, second: Marker) -> tuple[Constraint, ...]:
        """Return the equations for two markers."""
        if self.axis is None:
            return (Coincide(first, second),)
        length = float(np.linalg.norm(self.axis))
        return (Along(first, second, tuple(a / length for a in self.axis), law=self.law),)

    def fits(self, first: bool, second: bool) -> bool:
        """Tell whether the axis is one that A has: on a line the tangent alone."""
        return self.axis is None or not (first and any(self.axis[1:]))


class Turn(NamedTuple):
    """A joint holds how B's frame is turned relative to A's.

    Attributes
    ----------
    angle : float
        [rad]
    law : Law, or None
        What comes to the angle over time [rad].
    """

    angle: float = 0.0
    law: Law | None = None

    def between(self, first: Marker, second: Marker) -> tuple[Constraint, ...]:
        """Return the equations for two markers."""
        return (RelativeAngle(first, second, offset=self.angle, law=self.law),)

    def fits(self, first: bool, second: bool) -> bool:
        """Return True: in the plane, lines have directions."""
        return True


def constraints_of(
    held: Iterable[Held], first: Marker, second: Marker, *against: Marker, item: str = ""
) -> tuple[Constraint, ...]:
    """Return the equations of a joint between two markers, and others against which both are measured."""
    rows = (row for one in held for row in one.between(first, second))
    return tuple(replace(row, item=item, against=against) for row in rows)


@frozen
class Constraint:
    """Rows of Phi that tie a second marker to a first.

    Attributes
    ----------
    offset : float
        Constant part of what the gap between them is to be.
    law : Law, or None
        The part that depends on time, by which the constraint can do work.
    item : str
        Deck path of its joint, such as ``joints.elbow``.
    against : tuple of Marker
        Against which both are measured, if so.
    holds_place, holds_turn : bool
        Whether both points are one; whether the whole turn of the second against the first is the target.
    counts_turns : bool
        Whether the gap, if an angle, goes on beyond half a turn.
    wraps : bool
        Whether full turns do not count in what is missing.
    unit, why_kept : str
        Unit of the gap; why equations of this kind need multipliers where `elimination` leaves them.
    """

    first: Marker
    second: Marker
    offset: float = field(default=0.0, kw_only=True)
    law: Law | None = field(default=None, kw_only=True)
    item: str = field(default="", kw_only=True)
    against: tuple[Marker, ...] = field(default=(), kw_only=True)
    holds_place: ClassVar[bool] = False
    holds_turn: ClassVar[bool] = False
    counts_turns: ClassVar[bool] = True
    wraps: ClassVar[bool] = False
    unit: ClassVar[str] = "m"
    why_kept: ClassVar[str] = "its equations are not linear: they change as bodies move"

    @property
    def ends(self) -> tuple[Marker, ...]:
        """All markers."""
        return self.first, self.second, *self.against

    @property
    def rows(self) -> int:
        """Number of equations."""
        return 1

    @property
    def still(self) -> tuple[bool, ...]:
        """Whether the Jacobian by the body at each end is the same for every state."""
        return False, False

    @property
    def constant(self) -> bool:
        """Whether Phi is a linear function of the coordinates, at all times the same."""
        return all(self.still) and not self.driven

    @property
    def products(self) -> tuple[Product, ...]:
        """Its equations as products of vectors linear in the coordinates; none where they are not."""
        return ()

    @property
    def crossed(self) -> tuple[Product, ...]:
        """The others as products of vectors that are linear but for axes across sections; none likewise."""
        return ()

    @property
    def driven(self) -> bool:
        """Whether it depends on time by itself, so that it can do work."""
        return self.law is not None

    def standing(self) -> Constraint:
        """Return the equation of a joint that holds what the law says at the start."""
        return replace(self, offset=float(self.target(np.zeros(1))[0]), law=None)

    def target(self, t: Array) -> Array:
        """Return what the gap is to be, shape (n_batch,)."""
        return self.offset + (self.law.value(t) if self.law else np.zeros(len(t)))

    def residual(self, t: Array, x: Array) -> Array:
        """Return Phi, shape (n_batch, rows)."""
        gap = self.gap(x)
        return gap - self.target(t)[:, None] if self.offset or self.law else gap

    def rate(self, t: Array) -> Array:
        """Return Phi_t, shape (n_batch, rows)."""
        return -self.law.rate(t)[:, None] if self.law else np.zeros((len(t), self.rows))

    def acceleration(self, t: Array, x: Array, u: Array) -> Array:
        """Return what Phi_x x'' must be, shape (n_batch, rows)."""
        bias = self.bias(x, u)
        return self.law.acceleration(t)[:, None] - bias if self.law else -bias

    def gap(self, x: Array) -> Array:
        """Return phi, shape (n_batch, rows)."""
        raise NotImplementedError

    def jacobian(self, end: int, x: Array) -> Array:
        """Return Phi_x by the coordinates of the body at one end, shape (n_batch or 1, rows, n_columns)."""
        raise NotImplementedError

    def jacobians(self, x: Array) -> tuple[Array, ...]:
        """Return Phi_x by the coordinates of the body at each end."""
        return tuple(self.jacobian(end, x) for end in range(len(self.ends)))

    def measured(self, x: Array, ends: Sequence[int]) -> tuple[Array, list[Array]]:
        """Return phi, and Phi_x by the coordinates of the bodies at some ends."""
        return self.gap(x), [self.jacobian(end, x) for end in ends]

    def bias(self, x: Array, u: Array) -> Array:
        """Return the second time derivative of phi at zero accelerations, shape (n_batch, rows)."""
        raise NotImplementedError

    def stiffness(self, x: Array, multipliers: Array) -> Entries:
        """Return the derivative of Phi_x^T lambda by x in one state, multipliers (1, rows)."""
        raise NotImplementedError

    def reaction(self, x: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return the force [N], (n_batch, n_dim), and moment [N m], (n_batch, n_spin), on the second body."""
        raise NotImplementedError


class _Difference(Constraint):
    """The second marker's place or turn minus the first's."""

    def _of(self, marker: Marker) -> _Quantity:
        raise NotImplementedError

    @cached_property
    def _quantities(self) -> tuple[_Quantity, _Quantity]:
        return self._of(self.first), self._of(self.second)

    @cached_property
    def still(self) -> tuple[bool, bool]:
        """Whether place or turn are linear functions of the coordinates."""
        return self._quantities[0].linear, self._quantities[1].linear

    def jacobian(self, end: int, x: Array) -> Array:
        """Return the Jacobian of one end, that of the first with a minus."""
        J = self._quantities[end].jacobian(x)
        return J if end else -J

    def bias(self, x: Array, u: Array) -> Array:
        """Return the difference of the biases."""
        first, second = self._quantities
        if first.linear:
            return second.bias(x, u)
        return -first.bias(x, u) if second.linear else second.bias(x, u) - first.bias(x, u)

    def stiffness(self, x: Array, multipliers: Array) -> Entries:
        """Return what the second derivatives make of the multipliers."""
        first, second = (one.stiffness(x, multipliers[0]) for one in self._quantities)
        return Entries.joined([second, first._replace(values=-first.values)])


class _Quantity(NamedTuple):
    """Place or turn of a marker, as functions of the state."""

    linear: bool
    jacobian: Callable[[Array], Array]
    bias: Callable[[Array, Array], Array]
    stiffness: Callable[[Array, Array], Entries]


@frozen
class Coincide(_Difference):
    """Both points stay in the same place."""

    holds_place: ClassVar[bool] = True
    why_kept: ClassVar[str] = "its points are no nodes or centres of mass, or it closes a loop"

    @property
    def rows(self) -> int:
        """One for each component of the distance."""
        return self.first.n_dim

    def _of(self, marker: Marker) -> _Quantity:
        return _Quantity(
            marker.linear, marker.position_jacobian, marker.position_bias, marker.position_stiffness
        )

    def gap(self, x: Array) -> Array:
        """Return the distance vector [m]."""
        return self.second.position(x) - self.first.position(x)

    def reaction(self, x: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return minus the multipliers as a force."""
        return -multipliers, np.zeros((len(x), self.first.n_spin))


@frozen
class RelativeAngle(_Difference):
    """The second frame is turned against the first by an offset plus a law of time, in the plane.

    Attributes
    ----------
    counted : bool
        Whether full turns count.
    """

    counted: bool = field(default=False, kw_only=True)
    holds_turn: ClassVar[bool] = True
    unit: ClassVar[str] = "rad"
    why_kept: ClassVar[str] = "it holds an angle alone"

    def _of(self, marker: Marker) -> _Quantity:
        return _Quantity(marker.linear_turn, marker.spin_jacobian, marker.spin_bias, marker.spin_stiffness)

    def gap(self, x: Array) -> Array:
        """Return the relative angle [rad]."""
        return (self.second.angle(x) - self.first.angle(x))[:, None]

    def residual(self, t: Array, x: Array) -> Array:
        """Return the angle error [rad], within half a turn where full ones do not count."""
        missed = super().residual(t, x)
        return missed if self.counted else wrap(missed)

    @property
    def wraps(self) -> bool:  # type: ignore[override]
        """Whether they do not."""
        return not self.counted

    def reaction(self, x: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return minus the multiplier as a moment."""
        return np.zeros((len(x), self.first.n_dim)), -multipliers


@frozen
class Along(Constraint):
    """The distance along a direction fixed to the first body, a unit vector in its frame.

    The direction keeps unit length, whatever becomes of the body's own axes.
    """

    direction: tuple[float, ...]
    why_kept: ClassVar[str] = "it holds a distance along an axis"

    @property
    def still(self) -> tuple[bool, bool]:
        """Whether the axis stands on the ground and the places are linear functions of the coordinates."""
        return self.first.grounded, self.first.grounded and self.second.linear

    @property
    def products(self) -> tuple[Product, ...]:
        """The axis times the distance, in space."""
        axis = self.first.square.linear_axis(np.array(self.direction))
        ends = [marker.linear_place for marker in self.ends]
        if axis is None or ends[0] is None or ends[1] is None or self.constant or self.driven or self.offset:
            return ()
        return (Product(axis, ends[1].minus(ends[0])),)

    def _geometry(self, x: Array) -> tuple[Array, Array]:
        """Return the direction and the distance vector."""
        axis = self.first.square.axis(x, np.array(self.direction))
        return axis, self.second.position(x) - self.first.position(x)

    def gap(self, x: Array) -> Array:
        """Return the distance [m]."""
        axis, gap = self._geometry(x)
        return np.asarray(np.sum(axis * gap, axis=-1, keepdims=True))

    def jacobian(self, end: int, x: Array) -> Array:
        """Return the Jacobian of axis . gap."""
        axis, gap = self._geometry(x)
        row = axis[:, None] @ self.ends[end].position_jacobian(x)
        if end:
            return np.asarray(row)
        return np.asarray(gap[:, None] @ self.first.square.axis_jacobian(x, np.array(self.direction)) - row)

    def bias(self, x: Array, u: Array) -> Array:
        """Return the terms of (axis . gap)'' without accelerations."""
        (a, b), (axis, gap), own = self.ends, self._geometry(x), np.array(self.direction)
        turning = (a.square.axis_jacobian(x, own) @ u[:, a.columns, None])[..., 0]
        parts = axis * (b.position_bias(x, u) - a.position_bias(x, u))
        parts += 2.0 * turning * (b.velocity(x, u) - a.velocity(x, u))
        parts += a.square.axis_bias(x, u, own) * gap
        return np.asarray(np.sum(parts, axis=-1, keepdims=True))

    def stiffness(self, x: Array, multipliers: Array) -> Entries:
        """Return the multiplier times both derivatives, and times what bends axis and places."""
        (a, b), own, pull = self.ends, np.array(self.direction), multipliers[0, 0]
        axis, gap = (pull * one[0] for one in self._geometry(x))
        swung = pull * a.of_support(a.square.axis_jacobian(x, own))
        parts = [a.square.axis_stiffness(x, own, gap)]
        for marker, sign in ((a, -1.0), (b, 1.0)):
            block = sign * swung.T @ marker.of_support(marker.position_jacobian(x))
            parts.append(Entries.of_block(a.support, marker.support, block))
            parts.append(Entries.of_block(marker.support, a.support, block.T))
            parts.append(marker.position_stiffness(x, sign * axis))
        return Entries.joined(parts)

    def reaction(self, x: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return a force along the direction, minus the multiplier in size, acting at the second point."""
        return -multipliers * self._geometry(x)[0], np.zeros((len(x), self.first.n_spin))
