"""Beams of the model rigid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.rotations import freedoms
from hfsim.mechanics.body import Place
from hfsim.mechanics.markers import Marker, RigidMarker
from hfsim.mechanics.pose import Pose, Twist
from hfsim.parts.bodies.blueprint import Blueprint
from hfsim.parts.bodies.rigid import RigidBody


@dataclass(frozen=True)
class RigidBeam(RigidBody):
    """A beam of the model rigid: its frame is at the root, its coordinates are those of its mid-point."""

    length: float

    @classmethod
    def of(cls, beam: Blueprint, framed: bool) -> RigidBeam:
        """Return the rigid body with the mass and the inertia that a mesh has in rigid motion."""
        mesh = beam.mesh
        mass = float(mesh.positions @ mesh.mass @ mesh.positions)
        about_root = float(np.sum(mesh.undeformed * (mesh.mass @ mesh.undeformed)))
        inertia = about_root - mass * (0.5 * mesh.length) ** 2
        columns = beam.columns(freedoms(beam.n_dim))
        return cls(beam.name, columns, beam.points, mass, inertia, beam.gravity, mesh.length)

    @property
    def _centre(self) -> Array:
        centre = np.zeros(len(self.gravity))
        centre[0] = 0.5 * self.length
        return centre

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
        return np.stack([self.marker(self.points[name]).position(x) for name in ("root", "tip")], axis=1)
