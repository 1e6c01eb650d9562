"""Beams of the model rigid."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from hfsim.deck.materials import BeamProperties
from hfsim.maths.arrays import Array, cumulative
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import freedoms, rotate
from hfsim.mechanics.body import Load, Place
from hfsim.mechanics.deformation import Deformation
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.planar_markers import RigidMarker
from hfsim.mechanics.pose import Pose, Twist
from hfsim.parts.bodies.blueprint import Blueprint
from hfsim.parts.bodies.mesh import BeamMesh
from hfsim.parts.bodies.planar_rigid import RigidBody

POINTS = 33
"""Equidistant places along the beam at which it would be bent."""


@frozen
class RigidBeam(RigidBody):
    """A beam of the model rigid: its frame is at the root, its coordinates are those of its centre of mass.

    Attributes
    ----------
    mesh : BeamMesh
        By which it would stretch and bend.
    along : float
        How far its centre of mass is from the root [m].
    """

    mesh: BeamMesh
    along: float

    @classmethod
    def of(cls, beam: Blueprint, framed: bool) -> RigidBeam:
        """Return the rigid body with the mass and the inertia that a mesh has in rigid motion."""
        mesh = beam.mesh
        mass = float(mesh.positions @ mesh.mass @ mesh.positions)
        about_root = float(np.sum(mesh.undeformed * (mesh.mass @ mesh.undeformed)))
        along = 0.5 * mesh.length
        if not isinstance(mesh.properties, BeamProperties):
            along = float(mesh.positions @ mesh.mass @ mesh.undeformed[:, 0]) / mass
        inertia = about_root - mass * along**2
        columns = beam.columns(freedoms(beam.n_dim))
        return cls(beam.name, columns, beam.points, mass, inertia, beam.gravity, mesh, along)

    @property
    def _centre(self) -> Array:
        centre = np.zeros(len(self.gravity))
        centre[0] = self.along
        return centre

    def marker(self, place: Place) -> Marker:
        """Return the marker of a material point."""
        return RigidMarker(self.columns, (place[0] - self.along, place[1]))

    def placed(self, pose: Pose) -> Array:
        """Return the centre of mass and the angle."""
        return super().placed(pose._replace(origin=pose.placed(self._centre)))

    def moving(self, pose: Pose, twist: Twist) -> Array:
        """Return the velocity of the centre of mass and the angular velocity."""
        velocity = twist.velocity + twist.turning(pose.turned(self._centre))
        return super().moving(pose, twist._replace(velocity=velocity))

    def outline(self, x: Array) -> Array:
        """Return root and tip."""
        return np.stack([self.marker(self.points[name]).position(x) for name in ("root", "tip")], axis=1)

    def statics(self, x: Array, u: Array, ax: Array, loads: Iterable[Load]) -> Deformation:
        """Return stretch and bending by inertia, weight and loads: N / EA and M / EI.

        N and M are resultants of everything beyond a place, with a, alpha and omega the motion of the
        centre of mass c:

            M(x) = sum m_p + (x_p - x) F_p,y + int_x^L f_y(s) (s - x) ds        f = rho A (g - a - ...)
        """
        angle, omega, own = x[:, self.angle_column], u[:, self.angle_column], ax[:, self.columns]
        # f(s) = rho A (f0 + f1 (s - c)), in body axes
        f0 = -rotate(-angle, own[:, :-1] - self.gravity)
        f1 = np.stack([omega**2, -own[:, -1]], axis=-1)
        length = self.mesh.length
        places = np.linspace(0.0, length, POINTS)
        arm, (m0, m1, m2) = places - self.along, self.mesh.masses_beyond(places)
        N = np.outer(f0[:, 0], m0) + np.outer(f1[:, 0], arm * m0 + m1)
        M = np.outer(f0[:, 1], m1) + np.outer(f1[:, 1], arm * m1 + m2)
        for marker, force in loads:
            assert isinstance(marker, RigidMarker)
            at, aside = marker.offset
            local = rotate(-angle, force[:, :-1])
            moment = force[:, -1] - at * local[:, 1] + aside * local[:, 0]
            beyond = at + self.along > places
            N += local[:, :1] * beyond
            M += (moment[:, None] + local[:, 1:] * (at + self.along - places)) * beyond
        weights = np.full(POINTS, length / (POINTS - 1))
        weights[[0, -1]] *= 0.5
        section = self.mesh.at(places)
        curvature = M / section.bending_stiffness
        slope = cumulative(curvature.T, places).T
        return Deformation(
            places=places,
            weights=weights,
            axial=N / section.axial_stiffness,
            slope=slope[..., None],
            curvature=curvature[..., None],
            tip=slope @ weights[:, None],
            spin=omega[:, None],
        )
