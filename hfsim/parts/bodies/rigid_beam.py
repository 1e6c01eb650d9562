"""Beams of the model rigid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.mechanics.body import Place
from hfsim.mechanics.markers import Marker, RigidMarker
from hfsim.mechanics.pose import Pose, Twist
from hfsim.parts.bodies.mesh import BeamMesh
from hfsim.parts.bodies.rigid import RigidBody


@dataclass(frozen=True)
class RigidBeam(RigidBody):
    """A beam of the model rigid: its frame is at the root, its coordinates are those of its mid-point."""

    length: float = 0.0

    @classmethod
    def of(cls, name: str, columns: slice, mesh: BeamMesh, points: dict[str, Place]) -> RigidBeam:
        """Return the rigid body with the mass and the inertia that a mesh has in rigid motion."""
        mass = float(mesh.positions @ mesh.mass @ mesh.positions)
        about_root = float(np.sum(mesh.undeformed * (mesh.mass @ mesh.undeformed)))
        inertia = about_root - mass * (0.5 * mesh.length) ** 2
        return cls(name, columns, mass, inertia, points, mesh.length)

    @property
    def _centre(self) -> Array:
        return np.array([0.5 * self.length, 0.0])

    def marker(self, place: Place) -> Marker:
        """Return the marker of a material point."""
        return RigidMarker(self.columns, (place[0] - 0.5 * self.length, place[1]))

    def placed(self, pose: Pose) -> Array:
        """Return the mid-point and the angle."""
        return super().placed(pose._replace(origin=pose.placed(self._centre)))

    def moving(self, pose: Pose, twist: Twist) -> Array:
        """Return the velocity of the mid-point and the angular velocity."""
        velocity = twist.velocity + twist.turning(pose.turned(self._centre))
        return super().moving(pose, twist._replace(velocity=velocity))

    def outline(self, x: Array) -> Array:
        """Return root and tip."""
        return np.stack([self.marker((a, 0.0)).position(x) for a in (0.0, self.length)], axis=1)
