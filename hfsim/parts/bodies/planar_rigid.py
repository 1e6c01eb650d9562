"""Rigid bodies in the plane."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.mechanics.body import Body, Place
from hfsim.mechanics.force import ConstantForce, ForcePart
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.planar_markers import RigidMarker
from hfsim.mechanics.pose import Pose, Twist
from hfsim.parts.bodies.folded import FoldedBody


@frozen
class RigidBody(Body):
    """A rigid body with coordinates (x, y, angle); its origin is its centre of mass.

    Attributes
    ----------
    mass, inertia : float
        Mass [kg] and moment of inertia about the centre of mass [kg m^2].
    gravity : ndarray, shape (n_dim,)
        [m/s^2].
    """

    mass: float
    inertia: float
    gravity: Array

    @property
    def angle_column(self) -> int | None:
        """The last coordinate."""
        return int(self.columns.stop) - 1

    @property
    def position_columns(self) -> IntArray:
        """The centre of mass."""
        return np.asarray(self.columns.start + np.arange(len(self.gravity))[None])

    def marker(self, place: Place) -> Marker:
        """Return the marker of a point of the body."""
        return RigidMarker(self.columns, place)

    def placed(self, pose: Pose) -> Array:
        """Return (x, y, angle)."""
        return np.concatenate(pose)

    def moving(self, pose: Pose, twist: Twist) -> Array:
        """Return (vx, vy, omega)."""
        return np.concatenate(twist)

    def mass_entries(self) -> Entries:
        """Return the mass and the moment of inertia on the diagonal."""
        columns = np.arange(self.columns.start, self.columns.stop)
        values = np.full(len(columns), self.mass)
        values[len(self.gravity) :] = self.inertia
        return Entries(columns, columns, values)

    def forces(self, n: int) -> Iterator[ForcePart]:
        """Yield the weight."""
        yield ConstantForce(n, self.position_columns[0], self.mass * self.gravity, item=self.item)

    def folded(self, pose: Pose) -> FoldedBody:
        """Return the same body held for ever at a pose."""
        return FoldedBody(self.name, slice(0, 0), self.points, pose, self.mass * self.gravity)
