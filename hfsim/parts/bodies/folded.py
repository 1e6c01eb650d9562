"""Bodies that cannot move."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.mechanics.body import Place, polyline
from hfsim.mechanics.markers import GroundMarker, Marker
from hfsim.mechanics.pose import Pose, Twist


@dataclass(frozen=True)
class FoldedBody:
    """A body that cannot move: it has no coordinates, and its points are points of the ground.

    Attributes
    ----------
    pose : Pose
    """

    name: str
    pose: Pose
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
        x, y = self.pose.placed(np.array(place))
        return GroundMarker((float(x), float(y)), self.pose.angle)

    def placed(self, pose: Pose) -> Array:
        """Return no coordinates."""
        return np.zeros(0)

    def moving(self, pose: Pose, twist: Twist) -> Array:
        """Return no rates."""
        return np.zeros(0)

    def outline(self, x: Array) -> Array:
        """Return the polyline from the origin through the named points."""
        return polyline(self, x)
