"""What the mechanics need to know of a body, whatever its kind and model."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.pose import Pose, Twist

Place = tuple[float, float]


class Body(Protocol):
    """A body of an assembled scene."""

    @property
    def name(self) -> str:
        """Name in the deck."""

    @property
    def columns(self) -> slice:
        """Its coordinates in x."""

    @property
    def angle_column(self) -> int | None:
        """Column of `System.arranged` that is its frame angle with all turns; None where slopes give it."""

    @property
    def points(self) -> dict[str, Place]:
        """Named points in the undeformed body frame [m]."""

    @property
    def position_columns(self) -> IntArray:
        """Coordinates that are positions, shape (n, 2), that of the origin first; none in body frames."""

    def marker(self, place: Place) -> Marker:
        """Return the marker of a material point."""

    def placed(self, pose: Pose) -> Array:
        """Return the coordinates of the undeformed body in a place, (n_columns,)."""

    def moving(self, pose: Pose, twist: Twist) -> Array:
        """Return the rates of the undeformed body in rigid motion, (n_columns,)."""

    def outline(self, x: Array) -> Array:
        """Return points along the body for pictures, shape (n_batch, n_points, 2)."""


def polyline(body: Body, x: Array) -> Array:
    """Return the origin of a body and its named points, shape (n_batch, n_points, 2)."""
    places = [(0.0, 0.0), *body.points.values()]
    return np.stack([body.marker(place).position(x) for place in places], axis=1)
