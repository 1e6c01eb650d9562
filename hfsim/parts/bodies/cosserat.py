"""Beams with shear and torsion in space: the element ``cosserat`` in absolute nodal vectors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from hfsim.deck.sections import Fibres
from hfsim.maths.arrays import Array
from hfsim.maths.matrices import Entries
from hfsim.maths.rotations import cross
from hfsim.mechanics.body import Place, VectorBody
from hfsim.mechanics.connectivity import Connectivity
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.deformation import Deformation
from hfsim.mechanics.directions import Orthonormal
from hfsim.mechanics.force import ConstantForce, ForcePart
from hfsim.mechanics.markers import GroundMarker
from hfsim.mechanics.pose import Pose
from hfsim.mechanics.section_markers import SectionMarker
from hfsim.mechanics.spatial_markers import VectorMarker
from hfsim.parts.bodies.section_blueprint import SectionBlueprint
from hfsim.parts.bodies.section_mesh import SectionMesh
from hfsim.parts.elements.cosserat import VECTORS, SectionDamping
from hfsim.parts.elements.forces import ElasticForce

OUTLINE = 200
"""Points of a picture's line, near enough."""


@dataclass(frozen=True, eq=False)
class CosseratBeam(VectorBody):
    """A beam in space whose coordinates are positions and section vectors of its nodes.

    Attributes
    ----------
    mesh : SectionMesh
    gravity : ndarray, shape (3,)
        [m/s^2].
    """

    mesh: SectionMesh
    gravity: Array
    n_dim: ClassVar[int] = 3

    @classmethod
    def of(cls, beam: SectionBlueprint, framed: bool) -> Self:
        """Return the body of a beam."""
        columns = beam.columns(3 * VECTORS * beam.mesh.n_nodes)
        return cls(beam.name, columns, beam.points, beam.mesh, beam.gravity)

    @property
    def described(self) -> tuple[str, str]:
        """Its elements."""
        mesh = self.mesh
        return f"positions and section vectors of {mesh.count} elements of degree {mesh.degree}", "flexible"

    @property
    def coordinates(self) -> str:
        """Positions and section vectors."""
        return "section vectors"

    @property
    def undeformed(self) -> Array:
        """Those of the nodes."""
        return self.mesh.undeformed

    @property
    def positions(self) -> Array:
        """One for the positions of nodes."""
        return self.mesh.positions

    def reference(self, place: Place) -> Place:
        """Return where a point is in the undeformed body frame: places count along the line."""
        row, _, _ = self.mesh.point(place)
        return tuple(map(float, row @ self.mesh.undeformed))

    def marker(self, place: Place) -> SectionMarker:
        """Return the marker of a material point; its axes are those of the body frame, carried along."""
        return SectionMarker(self.columns, *self.mesh.point(place))

    @property
    def outline_places(self) -> Array:
        """Places along the beam between which a straight line passes for the curve."""
        count = max(1, OUTLINE // self.mesh.count) * self.mesh.count
        return np.linspace(0.0, self.mesh.axis.length, count + 1)

    @property
    def fibres(self) -> Fibres | None:
        """Those of its section."""
        return self.mesh.properties.fibres

    def section_forces(self, x: Array, u: Array, places: Array) -> Array:
        """Return those of the strains, and of their rates, in the sections' own axes."""
        from hfsim.parts.bodies.frame_forces import frame_forces, section_axes
        from hfsim.parts.bodies.line_forces import in_axes

        vectors, rates = self.vectors(x), self.vectors(u)
        axes = section_axes(self.mesh, vectors, places)
        return in_axes(axes, *frame_forces(self.mesh, vectors, rates, places))

    def outline(self, x: Array) -> Array:
        """Return points of the centre line."""
        rows = [self.mesh.shape(float(a))[0] for a in self.outline_places]
        return np.asarray(np.array(rows) @ self.vectors(x))

    def deformation(self, x: Array, u: Array) -> Deformation:
        """Return stretch and slope of the centre line, and how sections turn, in the frame at the root."""
        root, (vectors, rows) = self.marker(self.origin), self.mesh.point_vectors
        frame = root.turned(x, np.eye(3))
        slope, y, z, bent_y, bent_z = np.moveaxis(rows @ self.vectors(x)[:, vectors], 2, 0)
        bent = (cross(bent_y, z) + cross(y, bent_z)) @ frame
        along, own = slope @ frame, self.vectors(x)[:, VECTORS * (self.mesh.n_nodes - 1)]
        tip = ((own - self.vectors(x)[:, 0])[:, None] @ frame)[:, 0]
        at, weights = self.mesh.points
        spin = root.spin(x, u)
        return Deformation(at, weights, along[..., 0] - 1.0, along[..., 1:], bent[..., 1:], tip[:, 1:], spin)

    def own_constraints(self) -> Iterator[Constraint]:
        """Yield what keeps section vectors of unit length and at right angles, node by node."""
        ground, size = GroundMarker(Pose.level(self.origin)), 3 * VECTORS
        for first in range(self.columns.start, self.columns.stop, size):
            node = VectorMarker(slice(first, first + size), np.zeros(VECTORS), np.eye(VECTORS)[1:])
            yield Orthonormal(ground, node, item=self.item)

    def mass_entries(self) -> Entries:
        """Return those of the nodes."""
        columns = np.arange(self.columns.start, self.columns.stop)
        return Entries(columns, columns, np.repeat(self.mesh.masses, 3))

    def connectivity(self, n: int) -> Connectivity:
        """Return how the vectors of Gauss points follow from n coordinates."""
        vectors, rows = self.mesh.point_vectors
        columns = self.columns.start + 3 * vectors[..., None] + np.arange(3)
        return Connectivity(n, columns.reshape(len(vectors), -1), np.kron(rows, np.eye(3)), 3)

    def forces(self, n: int) -> Iterator[ForcePart]:
        """Yield weight, elastic force and damping."""
        weights = np.kron(self.mesh.masses * self.mesh.positions, self.gravity)
        yield ConstantForce(n, np.arange(self.columns.start, self.columns.stop), weights, item=self.item)
        elements = self.connectivity(n)
        yield ElasticForce(elements, self.mesh.law(), item=self.item)
        resisting = np.outer(self.mesh.properties.damping, self.mesh.points[1])
        yield SectionDamping(elements, resisting, item=self.item)
