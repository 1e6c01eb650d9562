"""Beams of the model rigid in the plane: lines, and fully parameterised elements."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Self

import numpy as np

from hfsim.deck.materials import BeamProperties
from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import lever
from hfsim.mechanics.body import Load
from hfsim.mechanics.deformation import Deformation
from hfsim.parts.bodies.blueprint import Blueprint
from hfsim.parts.bodies.mesh import BeamMesh
from hfsim.parts.bodies.planar_rigid_section_beam import PlanarPlaceMarker, PlanarRigidSectionBeam
from hfsim.parts.bodies.rigid_line import strained
from hfsim.parts.bodies.section_blueprint import SectionBlueprint


@frozen
class RigidBeam(PlanarRigidSectionBeam):
    """A rigid beam without sections, whose forces would stretch and bend it."""

    @classmethod
    def of(cls, beam: SectionBlueprint | Blueprint, framed: bool) -> Self:
        """Return the rigid body with the mass and the inertia that a mesh has in rigid motion."""
        mass, centre, euler = beam.inertia
        if isinstance(beam.mesh.properties, BeamProperties):
            centre = np.array([0.5 * beam.mesh.length, 0.0])  # to the last bit: a point there is linear
        return cls._with(beam, mass, centre, euler)

    def outline(self, x: Array) -> Array:
        """Return root and tip."""
        return np.stack([self.marker(self.points[name]).position(x) for name in ("root", "tip")], axis=1)

    extent = outline

    def statics(self, x: Array, u: Array, ax: Array, loads: Iterable[Load]) -> Deformation:
        """Return stretch and bending by inertia, weight and loads."""
        mesh = self.beam.mesh
        assert isinstance(mesh, BeamMesh)
        moving, turning = self._motion(x, u, ax)
        slope = -turning[:, 0]
        root = self.gravity @ self._frame(x) - moving - self.centre[0] * slope
        return strained(mesh, root, slope, self._on_line(x, loads), u[:, self.angle_column, None])

    def _on_line(self, x: Array, loads: Iterable[Load]) -> Iterator[tuple[float, Array, Array]]:
        """Yield where loads are, their forces and moments in body axes."""
        for marker, on in loads:
            assert isinstance(marker, PlanarPlaceMarker)
            force, moment = self._load(x, on)
            yield marker.along, force, moment - lever(np.array([marker.offset]), force)
