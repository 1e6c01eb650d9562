"""Spring and damper along the line between two points."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from hfsim.deck.fields import Between, Damping, NonNegativeLength, Stiffness
from hfsim.maths.arrays import Array
from hfsim.mechanics.markers import Marker
from hfsim.parts.forces._base import Spring
from hfsim.parts.specs import SpringSpec


class TwoPointSpec(SpringSpec):
    """Linear spring and damper on the distance of two points."""

    carries = True

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

    def build(self, first: Marker, second: Marker, start: Array) -> "TwoPointSpring":
        """Return the force between two markers of a scene with coordinates (n,) at the start."""
        spring = TwoPointSpring(first, second, self.stiffness, self.damping, 0.0)
        rest = float(spring.measured(start[None])[0][0]) if self.rest_length is None else self.rest_length
        return replace(spring, rest=rest)


@dataclass(frozen=True)
class TwoPointSpring(Spring):
    """Tension k (distance - rest) + d distance' along the line between two points."""

    def measured(self, x: Array) -> tuple[Array, list[Array]]:
        """Return how much longer the distance is; where the points meet, it has no direction."""
        gap = self.second.position(x) - self.first.position(x)
        distance = np.sqrt(np.sum(gap * gap, axis=-1))
        direction = (gap / np.where(distance == 0.0, 1.0, distance)[:, None])[:, None]
        rows: list[Array] = [
            sign * (direction @ marker.position_jacobian(x))[:, 0] for sign, marker in self._ends
        ]
        return np.asarray(distance - self.rest), rows
