"""Beams of the model rigid with sections in the plane."""

from __future__ import annotations

from typing import Self

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import freedoms, normal, rotate
from hfsim.mechanics.body import Place
from hfsim.mechanics.planar_markers import RigidMarker
from hfsim.mechanics.pose import Pose, Twist
from hfsim.parts.bodies.blueprint import Blueprint
from hfsim.parts.bodies.planar_rigid import RigidBody
from hfsim.parts.bodies.rigid_section_beam import PlaceMarker, RigidSectionBeam
from hfsim.parts.bodies.section_blueprint import SectionBlueprint


@frozen
class PlanarPlaceMarker(PlaceMarker, RigidMarker):
    """A point of a rigid beam in the plane that says how far along its line it is."""


@frozen
class PlanarRigidSectionBeam(RigidSectionBeam, RigidBody):
    """A rigid beam with sections whose coordinates are its centre of mass and its angle."""

    @classmethod
    def _with(cls, beam: SectionBlueprint | Blueprint, mass: float, centre: Array, euler: Array) -> Self:
        own = (beam.name, beam.columns(freedoms(2)), beam.points, mass, float(np.trace(euler)), beam.gravity)
        return cls(*own, beam=beam, centre=centre)

    def marker(self, place: Place) -> PlanarPlaceMarker:
        """Return the marker of a material point; its axes are those of the body frame."""
        x, y = np.array(self.reference(place)) - self.centre
        return PlanarPlaceMarker(self.columns, (float(x), float(y)), along=place[0])

    def placed(self, pose: Pose) -> Array:
        """Return centre of mass and angle."""
        return super().placed(pose._replace(origin=pose.placed(self.centre)))

    def moving(self, pose: Pose, twist: Twist) -> Array:
        """Return the velocity of the centre of mass and the angular velocity."""
        velocity = twist.velocity + twist.turning(pose.turned(self.centre))
        return super().moving(pose, twist._replace(velocity=velocity))

    def _motion(self, x: Array, u: Array, ax: Array) -> tuple[Array, Array]:
        own, omega, axes = ax[:, self.columns], u[:, self.angle_column, None, None], np.eye(2)
        turning = own[:, 2, None, None] * normal(axes) - omega**2 * axes
        return rotate(-x[:, self.angle_column], own[:, :2]), turning

    def _load(self, x: Array, force: Array) -> tuple[Array, Array]:
        return rotate(-x[:, self.angle_column], force[:, :2]), force[:, 2:]
