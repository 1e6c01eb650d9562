"""Beams with shear, in space with torsion: the element ``cosserat`` in absolute nodal vectors."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Self

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import NOTHING, Entries
from hfsim.maths.rotations import cross, normal, turned
from hfsim.mechanics.body import Place
from hfsim.mechanics.carried import Carried
from hfsim.mechanics.connectivity import Connectivity
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.deformation import Deformation
from hfsim.mechanics.force import ConstantForce, ForcePart
from hfsim.mechanics.increments import BodyIncrements
from hfsim.mechanics.markers import GroundMarker, LinearMarker
from hfsim.mechanics.orthonormal import Orthonormal
from hfsim.mechanics.planar_section_marker import PlanarSectionMarker
from hfsim.mechanics.pose import Pose, Twist
from hfsim.mechanics.section_markers import SectionMarker
from hfsim.parts.bodies.root_axes import SectionFrameChart
from hfsim.parts.bodies.section_blueprint import SectionBlueprint
from hfsim.parts.bodies.section_mesh import SectionMesh
from hfsim.parts.bodies.vector_beam import VectorBeam
from hfsim.parts.elements.cosserat import SectionDamping
from hfsim.parts.elements.forces import StrainForce


@frozen
class CosseratBeam(VectorBeam):
    """A beam whose coordinates are positions and section vectors of its nodes.

    Attributes
    ----------
    gravity : ndarray, shape (n_dim,)
        [m/s^2].
    framed : bool
        Whether it is stepped in the frame of its root and coordinates relative to that.
    """

    mesh: SectionMesh
    gravity: Array
    framed: bool = False
    coordinates: ClassVar[str] = "section vectors"
    has_sections: ClassVar[bool] = True

    @property
    def n_dim(self) -> int:  # type: ignore[override]
        """Of its mesh."""
        return self.mesh.n_dim

    @classmethod
    def of(cls, beam: SectionBlueprint, framed: bool) -> Self:
        """Return the body of a beam."""
        columns = beam.columns(beam.mesh.undeformed.size)
        return cls(beam.name, columns, beam.points, beam.mesh, beam.gravity, framed)

    @property
    def described(self) -> tuple[str, str]:
        """Its elements."""
        mesh = self.mesh
        return f"positions and section vectors of {mesh.count} elements of degree {mesh.degree}", "flexible"

    @property
    def undeformed(self) -> Array:
        """Those of the nodes."""
        return self.mesh.undeformed

    def chart(self) -> SectionFrameChart | None:
        """Return the map to the body frame, if it is stepped in that."""
        return SectionFrameChart(self.columns, 1, self.n_dim) if self.framed else None

    def spun_by_itself(self) -> Entries:
        """Return the rates of its section vectors in a turn about its line, if it is the same all around."""
        if not self.mesh.round:
            return NOTHING
        second = 3 * np.arange(self.mesh.n_nodes) + 1
        pairs = np.concatenate([second, second + 1]), np.concatenate([second + 1, second])
        return self.mixed(*pairs, np.repeat([1.0, -1.0], len(second)))

    def marker(self, place: Place) -> LinearMarker:
        """Return the marker of a material point; its axes are those of the body frame, carried along."""
        return _marker(self.columns, *self.mesh.point(place)).level_in(self.undeformed)

    def section_axes(self, x: Array, places: Array) -> Array:
        """Return the axes of sections at places, (n_batch, n_places, 3, 3), as columns."""
        from hfsim.parts.bodies.section_axes import square_axes

        return square_axes(self.mesh, self.vectors(x), places)

    def line(self, x: Array, places: Array) -> Array:
        """Return points of its line, (n_batch, n_places, n_dim)."""
        return np.asarray(self.mesh.shape(places)[0] @ self.vectors(x))

    def widest_turn(self, x: Array) -> float:
        """Return that of the rotations from each node's section to the next one's."""
        sections = self.vectors(x)[0].reshape(-1, self.n_dim, self.n_dim)[:, 1:]
        alike = np.sum(sections[1:] * sections[:-1], axis=(1, 2))
        if self.n_dim == 3:
            normals = cross(sections[:, 0], sections[:, 1])
            alike = 0.5 * (alike + np.sum(normals[1:] * normals[:-1], axis=1) - 1.0)
        return float(np.arccos(np.clip(alike.min(), -1.0, 1.0)))

    def deformation(self, x: Array, u: Array) -> Deformation:
        """Return how its line and sections change, in the frame at the root and undeformed sections' axes."""
        root, own, (at, weights) = self.marker(self.origin), self.vectors(x), self.mesh.points
        frame = root.frame(x)
        now, before = _line(self.mesh, own), _line(self.mesh, self.undeformed[None])
        axes = self.mesh.axis.sections(np.append(at, self.mesh.axis.length))[1]
        changes = (a @ frame - b for a, b in zip(now, before, strict=True))
        slope, bent = ((change[..., None, :] @ axes[:-1])[..., 0, :] for change in changes)
        tip = ((own[:, -self.n_dim] - own[:, 0])[:, None] @ frame)[:, 0] - self.undeformed[-self.n_dim]
        across, spin = (tip @ axes[-1])[:, 1:], root.spin(x, u)
        twist = _twist(self.mesh, own, frame[:, None] @ axes[:-1]) if self.n_dim == 3 else None
        found = Deformation(at, weights, slope[..., 0], slope[..., 1:], bent[..., 1:], across, spin)
        return found._replace(twist=twist)

    def deformed(self, pose: Pose, twist: Twist, seen: Deformation) -> tuple[Array, Array]:
        """Return nodal vectors and rates of the beam whose line moves and whose sections turn as seen."""
        assert seen.sections is not None
        n, at = self.n_dim, self.mesh.node_places
        known = np.stack([np.interp(at, seen.places, one) for one in seen.sections[0].T], axis=-1)
        nodes = self.undeformed.reshape(-1, n, n).copy()
        nodes[:, 1:] = [turned(turn, axes) for turn, axes in zip(known[:, n:], nodes[:, 1:], strict=True)]
        nodes[:, 0] += known[:, :n]
        return self.taken_along(pose, twist, nodes.reshape(-1, n))

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
        yield self.weight(n)
        elements = self.connectivity(n)
        yield StrainForce(elements, self.mesh.law(), item=self.item)
        resisting = self.mesh.resisting[1] * self.mesh.points[1]
        yield SectionDamping(elements, resisting, self.mesh.strains, item=self.item)

    def increments(self) -> BodyIncrements | None:
        """Return its vectors as the sections of a planar beam see them, in the frame of the root none."""
        if self.framed or self.n_dim == 3:
            return None
        from hfsim.parts.bodies.planar_carried import CarriedBeams

        return CarriedBeams(self.columns, 1, 2, 2)

    def carried(self) -> Carried | None:
        """Return the vectors of each node with its section vectors, in space and absolute."""
        if self.framed or self.n_dim == 2:
            return None
        columns = np.arange(self.columns.start, self.columns.stop).reshape(-1, 3)
        return Carried.by_sections(columns, 3, 1, self.position_columns)

    def weight(self, n: int) -> ConstantForce:
        """Return the weight on its nodal vectors."""
        weights = np.kron(self.mesh.masses * self.mesh.positions, self.gravity)
        return ConstantForce(n, np.arange(self.columns.start, self.columns.stop), weights, item=self.item)


def _line(mesh: SectionMesh, vectors: Array) -> tuple[Array, Array]:
    """Return r' and d1' at the Gauss points, shape (n_batch, n_points, n_dim)."""
    own, rows = mesh.point_vectors
    slope, *sections = np.moveaxis(rows @ vectors[:, own], 2, 0)
    return slope, _turning(np.array(sections))


def _twist(mesh: SectionMesh, vectors: Array, axes: Array) -> Array:
    """Return by how much sections at Gauss points turn about the first of axes (n_batch, n_points, 3, 3)."""
    own, rows = mesh.point_vectors
    y, z = np.moveaxis(rows[:, 1:3] @ vectors[:, own], 2, 0)
    return np.asarray(0.5 * np.sum(y * axes[..., 2] - z * axes[..., 1], axis=-1))


def _marker(
    columns: slice, position: Array, section: Array, axes: Array
) -> SectionMarker | PlanarSectionMarker:
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
