"""Rigid bodies."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from pydantic import Field

from hfsim.deck.fields import Points, PositiveInertia, PositiveMass
from hfsim.deck.spec import Spec
from hfsim.maths.arrays import Array, IntArray
from hfsim.mechanics.body import Place, polyline
from hfsim.mechanics.markers import Marker, RigidMarker
from hfsim.mechanics.pose import Pose, Twist


class RigidSpec(Spec):
    """Rigid body; its frame is at the centre of mass."""

    type: Literal["rigid"]
    """Kind of body."""

    mass: PositiveMass
    """Mass [kg]."""

    inertia: PositiveInertia
    """Moment of inertia about the centre of mass [kg m^2]."""

    points: Points = Field(default_factory=dict)
    """Named points in the body frame [m]."""


@dataclass(frozen=True)
class RigidBody:
    """A rigid body with coordinates (x, y, angle); its origin is its centre of mass.

    Attributes
    ----------
    name : str
    columns : slice
    mass, inertia : float
        Mass [kg] and moment of inertia about the centre of mass [kg m^2].
    points : dict of str to Place
    """

    name: str
    columns: slice
    mass: float
    inertia: float
    points: dict[str, Place] = field(default_factory=dict)

    @property
    def angle_column(self) -> int | None:
        """The third coordinate."""
        return int(self.columns.start) + 2

    @property
    def position_columns(self) -> IntArray:
        """The centre of mass."""
        return np.asarray(self.columns.start + np.arange(2)[None])

    def marker(self, place: Place) -> Marker:
        """Return the marker of a point of the body."""
        return RigidMarker(self.columns, place)

    def placed(self, pose: Pose) -> Array:
        """Return (x, y, angle)."""
        return np.concatenate(pose)

    def moving(self, pose: Pose, twist: Twist) -> Array:
        """Return (vx, vy, omega)."""
        return np.concatenate(twist)

    def outline(self, x: Array) -> Array:
        """Return the polyline from the centre of mass through the named points."""
        return polyline(self, x)
