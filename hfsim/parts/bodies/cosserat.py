"""Beams with shear, in space with torsion: the element ``cosserat`` in absolute nodal vectors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np

from hfsim.deck.sections import Fibres
from hfsim.maths.arrays import Array
from hfsim.maths.matrices import Entries
from hfsim.maths.rotations import cross, normal
from hfsim.mechanics.body import Place, VectorBody
from hfsim.mechanics.carried import Carried
from hfsim.mechanics.connectivity import Connectivity
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.deformation import Deformation
from hfsim.mechanics.force import ConstantForce, ForcePart
from hfsim.mechanics.markers import GroundMarker, LinearMarker
from hfsim.mechanics.orthonormal import Orthonormal
from hfsim.mechanics.planar_section_marker import PlanarSectionMarker
from hfsim.mechanics.pose import Pose
from hfsim.mechanics.section_markers import SectionMarker
from hfsim.parts.bodies.section_blueprint import SectionBlueprint
from hfsim.parts.bodies.section_mesh import SectionMesh
from hfsim.parts.elements.cosserat import SectionDamping
from hfsim.parts.elements.forces import StrainForce

OUTLINE = 200
"""Points of a picture's line, near enough."""


@dataclass(frozen=True, eq=False)
class CosseratBeam(VectorBody):
    """A beam whose coordinates are positions and section vectors of its nodes.

    Attributes
    ----------
    mesh : SectionMesh
    gravity : ndarray, shape (n_dim,)
        [m/s^2].
    """

    mesh: SectionMesh
    gravity: Array

    @property
    def n_dim(self) -> int:  # type: ignore[override]
        """Of its mesh."""
        return self.mesh.n_dim

    @classmethod
    def of(cls, beam: SectionBlueprint, framed: bool) -> Self:
        """Return the body of a beam."""
        columns = beam.columns(beam.mesh.undeformed.size)
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

    def marker(self, place: Place) -> LinearMarker:
        """Return the marker of a material point; its axes are those of the body frame, carried along."""
        return _marker(self.columns, *self.mesh.point(place))

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
        root, (vectors, rows), own = self.marker(self.origin), self.mesh.point_vectors, self.vectors(x)
        frame = np.stack([root.turned(x, axis) for axis in np.eye(self.n_dim)], axis=-1)
        slope, *sections = np.moveaxis(rows @ own[:, vectors], 2, 0)
        along, bent = slope @ frame, _turning(np.array(sections)) @ frame
        tip = ((own[:, -self.n_dim] - own[:, 0])[:, None] @ frame)[:, 0]
        at, weights = self.mesh.points
        spin = root.spin(x, u)
        axial, slopes = along[..., 0] - 1.0, along[..., 1:]
        return Deformation(at, weights, axial, slopes, bent[..., 1:], tip[:, 1:], spin)

    def own_constraints(self) -> Iterator[Constraint]:
        """Yield what keeps section vectors of unit length and at right angles, node by node."""
        ground, own = GroundMarker(Pose.level(self.origin)), np.eye(self.n_dim)
        for first in range(self.columns.start, self.columns.stop, own.size):
            node = _marker(slice(first, first + own.size), np.zeros(len(own)), own[1:], own)
            yield Orthonormal(ground, node, item=self.item)

    def mass_entries(self) -> Entries:
        """Return those of the nodes."""
        columns = np.arange(self.columns.start, self.columns.stop)
        return Entries(columns, columns, np.repeat(self.mesh.masses, self.n_dim))

    def connectivity(self, n: int) -> Connectivity:
        """Return how the vectors of Gauss points follow from n coordinates."""
        (vectors, rows), n_dim = self.mesh.point_vectors, self.n_dim
        columns = self.columns.start + n_dim * vectors[..., None] + np.arange(n_dim)
        return Connectivity(n, columns.reshape(len(vectors), -1), np.kron(rows, np.eye(n_dim)), n_dim)

    def forces(self, n: int) -> Iterator[ForcePart]:
        """Yield weight, elastic force and damping."""
        weights = np.kron(self.mesh.masses * self.mesh.positions, self.gravity)
        yield ConstantForce(n, np.arange(self.columns.start, self.columns.stop), weights, item=self.item)
        elements = self.connectivity(n)
        yield StrainForce(elements, self.mesh.law(), item=self.item)
        resisting = self.mesh.at_points(self.mesh.properties.damping)
        yield SectionDamping(elements, resisting, self.mesh.strains, item=self.item)

    def carried(self) -> Carried:
        """Return the vectors of each node with its section vectors."""
        columns = np.arange(self.columns.start, self.columns.stop)
        vectors = columns.reshape(-1, self.n_dim, self.n_dim)
        return Carried(vectors, vectors[:, 1:])


def _marker(columns: slice, position: Array, section: Array, axes: Array) -> LinearMarker:
    """Return the marker with rows of position and section vectors; these are ``axes`` in its own frame."""
    if len(axes) == 3:
        return SectionMarker(columns, position, section, axes)
    return PlanarSectionMarker(columns, position, section[0], float(np.arctan2(axes[1, 1], axes[0, 1])))


def _turning(sections: Array) -> Array:
    """Return d1' of section vectors d.. and their derivatives by the length, shape (k, ..., n_dim)."""
    if len(sections) == 2:
        return -normal(sections[1])
    y, z, bent_y, bent_z = sections
    return cross(bent_y, z) + cross(y, bent_z)
