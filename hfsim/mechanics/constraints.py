"""Constraint equations Phi(x, t) = 0 between two markers, of which joints are made.

A joint is a list of these: what each blocks is said once here, with its Jacobian Phi_x, its explicit
time derivative Phi_t and the right-hand side of the acceleration equation (paper, eq. 37), which is
minus everything in Phi'' that does not come from the accelerations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Protocol

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.matrices import Entries
from hfsim.maths.rotations import normal, rotate, wrap
from hfsim.mechanics.force import difference
from hfsim.mechanics.markers import Marker, joint_support

if TYPE_CHECKING:
    from hfsim.deck.laws import Law


class Constraint(Protocol):
    """Rows of Phi that tie a second marker to a first."""

    @property
    def first(self) -> Marker:
        """Marker on the first body."""

    @property
    def second(self) -> Marker:
        """Marker on the second body."""

    @property
    def item(self) -> str:
        """Deck path of its joint, such as ``joints.elbow``."""

    @property
    def rows(self) -> int:
        """Number of equations."""

    @property
    def constant(self) -> bool:
        """Whether the Jacobian is the same for every state and time."""

    @property
    def driven(self) -> bool:
        """Whether it depends on time by itself, so that it can do work."""

    def residual(self, t: Array, x: Array) -> Array:
        """Return Phi, shape (n_batch, rows)."""

    def jacobians(self, x: Array) -> tuple[Array, Array]:
        """Return Phi_x by the coordinates of the first and the second body, (n_batch or 1, rows, n)."""

    def rate(self, t: Array) -> Array:
        """Return Phi_t, shape (n_batch, rows)."""

    def acceleration(self, t: Array, x: Array, u: Array) -> Array:
        """Return what Phi_x x'' must be, shape (n_batch, rows)."""

    def stiffness(self, x: Array, multipliers: Array) -> Entries:
        """Return the derivative of Phi_x^T lambda by x in one state, multipliers (1, rows)."""

    def reaction(self, x: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return the force [N], (n_batch, 2), and moment [N m], (n_batch,), on the second body."""


def _both(second: Entries, first: Entries) -> Entries:
    """Return the difference of the second's and the first's."""
    first = first._replace(values=-first.values)
    return Entries(*(np.concatenate(pair) for pair in zip(second, first, strict=True)))


def geometric_stiffness(constraint: Constraint, x: Array, multipliers: Array) -> Entries:
    """Return the derivative of Phi_x^T lambda by x in one state, multipliers (1, rows); by differences."""
    markers = constraint.first, constraint.second

    def force(moved: Array) -> Array:
        out = np.zeros_like(moved)
        for marker, J in zip(markers, constraint.jacobians(moved), strict=True):
            out[:, marker.columns] += (multipliers @ J)[:, 0]
        return out

    return difference(force, x, joint_support(*markers))


@dataclass(frozen=True)
class Coincide:
    """Both points stay in the same place."""

    first: Marker
    second: Marker
    rows: int = 2
    item: str = ""
    why_kept: ClassVar[str] = "not at nodes or centres of mass, or it closes a loop"

    @property
    def constant(self) -> bool:
        """Whether both positions are linear functions of the coordinates."""
        return self.first.linear and self.second.linear

    @property
    def driven(self) -> bool:
        """Return False."""
        return False

    def residual(self, t: Array, x: Array) -> Array:
        """Return the distance vector [m]."""
        return self.second.position(x) - self.first.position(x)

    def jacobians(self, x: Array) -> tuple[Array, Array]:
        """Return the position Jacobians, the first with a minus."""
        return -self.first.position_jacobian(x), self.second.position_jacobian(x)

    def rate(self, t: Array) -> Array:
        """Return zero: no explicit time."""
        return np.zeros((len(t), 2))

    def acceleration(self, t: Array, x: Array, u: Array) -> Array:
        """Return the difference of the position biases."""
        return self.first.position_bias(x, u) - self.second.position_bias(x, u)

    def stiffness(self, x: Array, multipliers: Array) -> Entries:
        """Return what the positions' second derivatives make of the multipliers."""
        force = multipliers[0]
        return _both(self.second.position_stiffness(x, force), self.first.position_stiffness(x, force))

    def reaction(self, x: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return minus the multipliers as a force."""
        return -multipliers, np.zeros(len(x))


@dataclass(frozen=True)
class RelativeAngle:
    """The second direction is turned against the first by an offset plus a law of time."""

    first: Marker
    second: Marker
    offset: float
    law: Law | None = None
    rows: int = 1
    item: str = ""
    why_kept: ClassVar[str] = "an angle between moving bodies is not linear in the coordinates"

    @property
    def constant(self) -> bool:
        """Return False: the angle of a slope vector is not linear."""
        return False

    @property
    def driven(self) -> bool:
        """Whether there is a law of time."""
        return self.law is not None

    def residual(self, t: Array, x: Array) -> Array:
        """Return the angle error [rad], within half a turn."""
        target = self.offset + (self.law.value(t) if self.law else 0.0)
        return wrap(self.second.angle(x) - self.first.angle(x) - target)[:, None]

    def jacobians(self, x: Array) -> tuple[Array, Array]:
        """Return the angle Jacobians, the first with a minus."""
        return -self.first.angle_jacobian(x)[:, None, :], self.second.angle_jacobian(x)[:, None, :]

    def rate(self, t: Array) -> Array:
        """Return minus the rate of the law."""
        return -self.law.rate(t)[:, None] if self.law else np.zeros((len(t), 1))

    def acceleration(self, t: Array, x: Array, u: Array) -> Array:
        """Return the difference of the angle biases plus the law's acceleration."""
        target = self.first.angle_bias(x, u) - self.second.angle_bias(x, u)
        return np.asarray(target + self.law.acceleration(t) if self.law else target)[:, None]

    def stiffness(self, x: Array, multipliers: Array) -> Entries:
        """Return what the angles' second derivatives make of the multiplier."""
        moment = float(multipliers[0, 0])
        return _both(self.second.angle_stiffness(x, moment), self.first.angle_stiffness(x, moment))

    def reaction(self, x: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return minus the multiplier as a moment."""
        return np.zeros((len(x), 2)), -multipliers[:, 0]


@dataclass(frozen=True)
class Along:
    """The distance along a direction fixed to the first body follows a law of time, or stays zero."""

    first: Marker
    second: Marker
    direction: tuple[float, float]
    law: Law | None = None
    rows: int = 1
    item: str = ""
    why_kept: ClassVar[str] = "the direction turns: not linear in the coordinates"

    @property
    def constant(self) -> bool:
        """Return False: the direction turns."""
        return False

    @property
    def driven(self) -> bool:
        """Whether there is a law of time."""
        return self.law is not None

    def _geometry(self, x: Array) -> tuple[Array, Array, Array]:
        axis = rotate(self.first.angle(x), np.array(self.direction))
        return axis, normal(axis), self.second.position(x) - self.first.position(x)

    def residual(self, t: Array, x: Array) -> Array:
        """Return the distance error [m]."""
        axis, _, gap = self._geometry(x)
        target = self.law.value(t) if self.law else 0.0
        return np.asarray(np.sum(axis * gap, axis=-1) - target)[:, None]

    def jacobians(self, x: Array) -> tuple[Array, Array]:
        """Return the Jacobians of axis . gap."""
        axis, side, gap = self._geometry(x)
        lever = np.sum(side * gap, axis=-1)[:, None]
        first = -(axis[:, None, :] @ self.first.position_jacobian(x))[:, 0]
        first = first + lever * self.first.angle_jacobian(x)
        second = (axis[:, None, :] @ self.second.position_jacobian(x))[:, 0]
        return first[:, None, :], second[:, None, :]

    def rate(self, t: Array) -> Array:
        """Return minus the rate of the law."""
        return -self.law.rate(t)[:, None] if self.law else np.zeros((len(t), 1))

    def acceleration(self, t: Array, x: Array, u: Array) -> Array:
        """Return minus the terms of (axis . gap)'' without accelerations, plus the law's."""
        axis, side, gap = self._geometry(x)
        a, b = self.first, self.second
        spin = _apply(a.angle_jacobian(x), u[:, a.columns])
        gap_rate = _apply(b.position_jacobian(x), u[:, b.columns]) - _apply(
            a.position_jacobian(x), u[:, a.columns]
        )
        gap_bias = b.position_bias(x, u) - a.position_bias(x, u)
        bias = np.sum(axis * gap_bias + 2.0 * spin[:, None] * side * gap_rate, axis=-1)
        bias += np.sum(side * gap, -1) * a.angle_bias(x, u) - spin**2 * np.sum(axis * gap, -1)
        return np.asarray(self.law.acceleration(t) - bias if self.law else -bias)[:, None]

    def stiffness(self, x: Array, multipliers: Array) -> Entries:
        """Return the derivative by differences."""
        return geometric_stiffness(self, x, multipliers)

    def reaction(self, x: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return a force along the direction, minus the multiplier in size, acting at the second point."""
        return -multipliers * self._geometry(x)[0], np.zeros(len(x))


def _apply(J: Array, u: Array) -> Array:
    """Return J u for Jacobians (n_batch or 1, ..., n) and rates (n_batch, n)."""
    if J.ndim == 2:
        return np.asarray(np.sum(J * u, axis=-1))
    return np.asarray((J @ u[..., None])[..., 0])


def unit(axis: tuple[float, ...]) -> tuple[float, float]:
    """Return a planar direction with length one."""
    length = float(np.hypot(axis[0], axis[1]))
    return axis[0] / length, axis[1] / length
