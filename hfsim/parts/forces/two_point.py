"""Spring and damper along the line between two points."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from hfsim.deck.fields import Between, Damping, NonNegativeLength, Stiffness
from hfsim.maths.arrays import Array, IntArray
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.markers import Marker, joint_support
from hfsim.parts.specs import SpringSpec


class TwoPointSpec(SpringSpec):
    """Linear spring and damper on the distance of two points."""

    type: Literal["two_point"]
    """Kind of spring."""

    between: Between
    """The two points, [A, B]."""

    stiffness: Stiffness
    """Stiffness [N/m]."""

    damping: Damping = 0.0
    """Damping [N s/m]."""

    rest_length: NonNegativeLength | None = None
    """Distance without force [m]; without it, the distance at the start."""

    def build(self, first: Marker, second: Marker, distance: float) -> "TwoPointSpring":
        """Return the force between two markers that are a distance [m] apart at the start."""
        rest = distance if self.rest_length is None else self.rest_length
        return TwoPointSpring(first, second, self.stiffness, self.damping, rest)


@dataclass(frozen=True)
class TwoPointSpring(ForcePart):
    """Tension k (distance - rest) + d distance' along the line between two points."""

    first: Marker
    second: Marker
    stiffness: float
    damping: float
    rest_length: float

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

    def _line(self, x: Array) -> tuple[Array, Array]:
        """Return the distance and the unit vector from the first to the second point (zero if they meet)."""
        gap = self.second.position(x) - self.first.position(x)
        distance = np.sqrt(np.sum(gap * gap, axis=-1))
        return distance, gap / np.where(distance == 0.0, 1.0, distance)[:, None]

    def _jacobians(self, x: Array, direction: Array) -> tuple[Array, Array]:
        """Return the derivatives of the distance by the coordinates of the first and second body."""
        row = direction[:, None, :]
        first = (row @ self.first.position_jacobian(x))[:, 0]
        return -first, (row @ self.second.position_jacobian(x))[:, 0]

    def _rate(self, x: Array, u: Array, direction: Array) -> Array:
        first, second = self._jacobians(x, direction)
        return np.asarray(
            np.sum(first * u[:, self.first.columns], -1) + np.sum(second * u[:, self.second.columns], -1)
        )

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add the tension to both bodies."""
        distance, direction = self._line(x)
        tension = self.stiffness * (distance - self.rest_length)
        if self.damping:
            tension = tension + self.damping * self._rate(x, u, direction)
        first, second = self._jacobians(x, direction)
        out[:, self.first.columns] -= tension[:, None] * first
        out[:, self.second.columns] -= tension[:, None] * second

    def potential_energy(self, t: Array, x: Array) -> Array:
        """Return 1/2 k (distance - rest)^2."""
        return 0.5 * self.stiffness * (self._line(x)[0] - self.rest_length) ** 2

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return minus the power lost in the damper."""
        return -self.damping * self._rate(x, u, self._line(x)[1]) ** 2
