"""Rotational spring and damper between two frames."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from hfsim.deck.fields import Angle, Between, RotationalDamping, RotationalStiffness
from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.matrices import NOTHING, Entries
from hfsim.maths.rotations import wrap
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.markers import Marker, joint_support
from hfsim.parts.specs import SpringSpec


class RotationalSpec(SpringSpec):
    """Linear spring and damper on the angle of B relative to A."""

    type: Literal["rotational"]
    """Kind of spring."""

    between: Between
    """The two points whose frames it connects, [A, B]."""

    stiffness: RotationalStiffness
    """Stiffness [N m/rad]."""

    damping: RotationalDamping = 0.0
    """Damping [N m s/rad]."""

    rest_angle: Angle = 0.0
    """Angle of B relative to A without moment [rad]."""

    def build(self, first: Marker, second: Marker) -> "RotationalSpring":
        """Return the force between two markers."""
        return RotationalSpring(first, second, self.stiffness, self.damping, self.rest_angle)


@dataclass(frozen=True)
class RotationalSpring(ForcePart):
    """Moment -k (angle - rest) - d angle' on the second body, the opposite on the first.

    The angle counts full turns between rigid bodies; where a beam's slope gives it, it is taken
    within half a turn of the rest angle.
    """

    first: Marker
    second: Marker
    stiffness: float
    damping: float
    rest_angle: float

    @property
    def markers(self) -> tuple[Marker, ...]:
        """Both points."""
        return self.first, self.second

    @cached_property
    def support(self) -> IntArray:
        """Coordinates of both points."""
        return joint_support(self.first, self.second)

    @property
    def uses_rates(self) -> bool:
        """Whether there is a damper."""
        return self.damping > 0.0

    @property
    def quartic(self) -> bool:
        """Whether the angle is a coordinate."""
        return self._keeps_turns and not self.damping

    @property
    def _keeps_turns(self) -> bool:
        return self.first.keeps_turns and self.second.keeps_turns

    def _deflection(self, x: Array) -> Array:
        angle = self.second.angle(x) - self.first.angle(x) - self.rest_angle
        return angle if self._keeps_turns else wrap(angle)

    def _rate(self, x: Array, u: Array) -> Array:
        return np.asarray(
            np.sum(self.second.angle_jacobian(x) * u[:, self.second.columns], axis=-1)
            - np.sum(self.first.angle_jacobian(x) * u[:, self.first.columns], axis=-1)
        )

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add the moments of spring and damper."""
        moment = -self.stiffness * self._deflection(x)
        if self.damping:
            moment = moment - self.damping * self._rate(x, u)
        out[:, self.second.columns] += moment[:, None] * self.second.angle_jacobian(x)
        out[:, self.first.columns] -= moment[:, None] * self.first.angle_jacobian(x)

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return k J^T J and what the angles' second derivatives make of the moment, in one state."""
        if self.damping:
            return super().tangent(t, x, u)
        moment = self.stiffness * float(self._deflection(x)[0])
        turning = self.first.angle_stiffness(x, -moment)
        parts = (self._dyad(x, self.stiffness), self.second.angle_stiffness(x, moment), turning)
        return Entries(*(np.concatenate(kind) for kind in zip(*parts, strict=True)))

    def rate_tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return d J^T J in one state."""
        return self._dyad(x, self.damping) if self.damping else NOTHING

    def _dyad(self, x: Array, factor: float) -> Entries:
        row = np.zeros((1, x.shape[1]))
        row[:, self.second.columns] += self.second.angle_jacobian(x)
        row[:, self.first.columns] -= self.first.angle_jacobian(x)
        row = row[0, self.support]
        return Entries.of_block(self.support, self.support, factor * np.outer(row, row))

    def potential_energy(self, t: Array, x: Array) -> Array:
        """Return 1/2 k deflection^2."""
        return 0.5 * self.stiffness * self._deflection(x) ** 2

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return minus the power lost in the damper."""
        return -self.damping * self._rate(x, u) ** 2
