"""Beams of the model rigid with sections in space."""

from __future__ import annotations

from typing import Self

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import cross
from hfsim.mechanics.body import Place
from hfsim.mechanics.spatial_markers import VectorMarker
from hfsim.parts.bodies.blueprint import Blueprint
from hfsim.parts.bodies.rigid_section_beam import PlaceMarker, RigidSectionBeam
from hfsim.parts.bodies.section_blueprint import SectionBlueprint
from hfsim.parts.bodies.spatial_rigid import SpatialRigidBody


@frozen
class SpatialPlaceMarker(PlaceMarker, VectorMarker):
    """A point of a rigid beam in space that says how far along its line it is."""


@frozen
class SpatialRigidSectionBeam(RigidSectionBeam, SpatialRigidBody):
    """A rigid beam with sections whose coordinates are its centre of mass and its axes."""

    @classmethod
    def _with(cls, beam: SectionBlueprint | Blueprint, mass: float, centre: Array, euler: Array) -> Self:
        inertia = np.trace(euler) * np.eye(3) - euler
        own = (beam.name, beam.columns(cls.SIZE), beam.points, mass, inertia, beam.gravity)
        return cls(*own, beam=beam, centre=centre)

    @property
    def undeformed(self) -> Array:
        """Centre of mass and axes."""
        return np.concatenate([self.centre[None], np.eye(3)])

    def marker(self, place: Place) -> SpatialPlaceMarker:
        """Return the marker of a material point; its axes are those of the body frame."""
        row = np.array([1.0, *(np.array(self.reference(place)) - self.centre)])
        return SpatialPlaceMarker(self.columns, row, np.eye(4)[1:], along=place[0])

    def _motion(self, x: Array, u: Array, ax: Array) -> tuple[Array, Array]:
        changing = self.vectors(ax) @ self._frame(x)
        return changing[:, 0], changing[:, 1:]

    def _load(self, x: Array, force: Array) -> tuple[Array, Array]:
        on = force.reshape(len(x), 4, 3) @ self._frame(x)
        return on[:, 0], cross(np.eye(3), on[:, 1:]).sum(axis=1)
