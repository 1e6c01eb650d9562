"""Spring and damper along the line between two points."""

from typing import Annotated, Literal

import numpy as np

from hfsim.deck.fields import Between, Force, NonNegativeLength, Stiffness, table_of
from hfsim.maths.arrays import Array
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.ties import DistanceTie
from hfsim.parts.forces._spring import CoordinateSpringSpec
from hfsim.parts.resistances import SlidingResistanceSpec


class TwoPointSpec(SlidingResistanceSpec, CoordinateSpringSpec):
    """Spring and damper on the distance of two points."""

    carries = True
    measures = (("m", ""),)
    limits = ("force",)

    type: Literal["two_point"]
    """Kind of spring."""

    between: Between
    """The two points, [A, B]."""

    stiffness: Stiffness = 0.0
    """Stiffness [N/m]."""

    rest_length: NonNegativeLength | None = None
    """Distance without force, but for the preload [m]; without it, the distance at the start."""

    preload: Force = 0.0
    """Tension at the rest length [N]."""

    table: Annotated[tuple[tuple[float, float], ...], table_of("length", "force")] | None = None
    """Instead of stiffness and preload: rows [stretch from the rest length, tension], between them monotone
    cubics, beyond them straight lines [m, N]."""

    def build(self, first: Marker, second: Marker, start: Array) -> DistanceTie:
        """Return the force between two markers of a scene with coordinates (n,) at the start."""
        rest = self.rest_length
        if rest is None:
            rest = float(DistanceTie(first, second, ()).measured(np.zeros(1), start[None])[0][0])
        return DistanceTie(first, second, self.from_rest(rest))
