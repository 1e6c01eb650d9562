"""Bodies that cannot move."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.rotations import rotate
from hfsim.mechanics.body import Place, polyline
from hfsim.mechanics.markers import GroundMarker, Marker


@dataclass(frozen=True)
class FoldedBody:
    """A body that cannot move: it has no coordinates, and its points are points of the ground.

    Attributes
    ----------
    origin : tuple of float
        Place of its origin [m].
    angle : float
        Angle of its frame, full turns included [rad].
    """

    name: str
    origin: Place
    angle: float
    points: dict[str, Place]
    columns: slice = field(default_factory=lambda: slice(0, 0))

    @property
    def angle_column(self) -> int | None:
        """None: it has no coordinates."""
        return None

    @property
    def position_columns(self) -> IntArray:
        """None."""
        return np.zeros((0, 2), dtype=np.intp)

    def marker(self, place: Place) -> Marker:
        """Return a point of the ground."""
        x, y = np.array(self.origin) + rotate(np.array([self.angle]), np.array(place))[0]
        return GroundMarker((float(x), float(y)), self.angle)

    def placed(self, origin: Array, angle: float) -> Array:
        """Return no coordinates."""
        return np.zeros(0)

    def moving(self, angle: float, velocity: Array, omega: float) -> Array:
        """Return no rates."""
        return np.zeros(0)

    def outline(self, x: Array) -> Array:
        """Return the polyline from the origin through the named points."""
        return polyline(self, x)
