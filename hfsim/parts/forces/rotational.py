"""Rotational spring and damper between two frames, in space about an axis."""

from typing import Annotated, Literal

import numpy as np

from hfsim.deck.fields import Angle, Axis, Between, Moment, Orientation, RotationalStiffness, table_of
from hfsim.maths.arrays import Array
from hfsim.mechanics.constraints import Held, Turn
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.ties import GapTie, tie_on
from hfsim.parts.forces._spring import CoordinateSpringSpec
from hfsim.parts.resistances import TurningResistanceSpec


class RotationalSpec(TurningResistanceSpec, CoordinateSpringSpec):
    """Spring and damper on the angle of B relative to A, in space about an axis fixed in A."""

    vectors = ("axis",)
    spatial = ("axis", "orientation")
    angles = ("rest_angle",)
    measures = (("rad", ""),)
    limits = ("moment",)

    type: Literal["rotational"]
    """Kind of spring."""

    between: Between
    """The two points whose frames it connects, [A, B]."""

    stiffness: RotationalStiffness = 0.0
    """Stiffness [N m/rad]."""

    rest_angle: Angle = 0.0
    """Angle of B relative to A without moment, but for the preload [rad]."""

    preload: Moment = 0.0
    """Moment at the rest angle that turns B back against A [N m]."""

    table: Annotated[tuple[tuple[float, float], ...], table_of("angle", "moment")] | None = None
    """Instead of stiffness and preload: rows [angle from the rest angle, moment that turns back], between
    them monotone cubics, beyond them straight lines [rad, N m]."""

    axis: Axis | None = None
    """Axis in A's frame, in space [-]; [0, 0, 1] without it."""

    orientation: Orientation | None = None
    """Orientation of B's frame relative to A's where the angle is zero, in space; without it the smallest
    rotation that takes the axis in B to that in A. The axis in B is what lies along A's at the start."""

    @property
    def framed(self) -> tuple[str, ...]:
        """Both points."""
        return self.between

    @property
    def rest_turn(self) -> float:
        """The rest angle."""
        return self.rest_angle

    def build(self, first: Marker, second: Marker, start: Array) -> GapTie:
        """Return the moment between two markers; the angle counts full turns."""
        angle = self._angle(first, second, start)
        return tie_on(angle, first, second, self.from_rest(self.rest_angle))

    def _angle(self, first: Marker, second: Marker, start: Array) -> Held:
        if first.n_dim == 2:
            return Turn()
        from hfsim.mechanics.directions import THIRD
        from hfsim.mechanics.spatial_turns import About

        own, other = (np.array([one.turned(start[None], e)[0] for e in np.eye(3)]) for one in (first, second))
        return About.of(self.axis or THIRD, own @ other.T, zero=self.orientation)
