"""Beams with shear and torsion in space: the element ``cosserat`` in absolute nodal vectors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.matrices import Entries
from hfsim.maths.rotations import cross
from hfsim.mechanics.body import Body, Place, places
from hfsim.mechanics.connectivity import Connectivity
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.deformation import Deformation
from hfsim.mechanics.directions import Orthonormal
from hfsim.mechanics.force import ConstantForce, ForcePart
from hfsim.mechanics.markers import GroundMarker
from hfsim.mechanics.pose import Pose, Twist
from hfsim.mechanics.section_markers import SectionMarker
from hfsim.mechanics.spatial_markers import VectorMarker
from hfsim.parts.bodies.beam_axis import Axis, Line
from hfsim.parts.bodies.section_mesh import SectionMesh
from hfsim.parts.elements.cosserat import VECTORS, SectionDamping
from hfsim.parts.elements.forces import ElasticForce

OUTLINE = 200
"""Points of a picture's line, near enough."""


@dataclass(frozen=True, eq=False)
class CosseratBeam(Body):
    """A beam in space whose coordinates are positions and section vectors of its nodes.

    Attributes
    ----------
    mesh : SectionMesh
    gravity : ndarray, shape (3,)
        [m/s^2].
    """

    mesh: SectionMesh
    gravity: Array

    @classmethod
    def of(cls, spec: Any, name: str, start: int, deck: Any) -> CosseratBeam:
        """Return the body of a beam of a deck, a `BeamSpec`; its coordinates begin at a column."""
        shape = Line() if spec.axis is None else spec.axis.shape
        axis = Axis(shape, spec.length, spec.section_angle or 0.0, spec.twist or 0.0)
        mesh = SectionMesh(axis, spec.elements, spec.degree, deck.section_properties(name))
        ends = {"root": (0.0, 0.0, 0.0), "tip": (spec.length, 0.0, 0.0)}
        columns = slice(start, start + 3 * VECTORS * mesh.n_nodes)
        return cls(name, columns, places(spec.points) | ends, mesh, np.array(deck.gravity))

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
    def origin(self) -> Place:
        """The origin of the body frame."""
        return (0.0, 0.0, 0.0)

    @property
    def position_columns(self) -> IntArray:
        """Those of the nodes."""
        first = self.columns.start + 3 * VECTORS * np.arange(self.mesh.n_nodes)
        return np.asarray(first[:, None] + np.arange(3))

    def reference(self, place: Place) -> Place:
        """Return where a point is in the undeformed body frame: places count along the line."""
        row, _, _ = self.mesh.point(place)
        return tuple(map(float, row @ self.mesh.undeformed))

    def marker(self, place: Place) -> SectionMarker:
        """Return the marker of a material point; its axes are those of the body frame, carried along."""
        return SectionMarker(self.columns, *self.mesh.point(place))

    def placed(self, pose: Pose) -> Array:
        """Return the turned and shifted undeformed nodal vectors."""
        turned = pose.turned(self.mesh.undeformed)
        return np.asarray(turned + self.mesh.positions[:, None] * pose.origin).ravel()

    def moving(self, pose: Pose, twist: Twist) -> Array:
        """Return the rates of the nodal vectors."""
        turning = twist.turning(pose.turned(self.mesh.undeformed))
        return np.asarray(turning + self.mesh.positions[:, None] * twist.velocity).ravel()

    def freedoms(self, x: Array, pose: Pose) -> Array:
        """Return the rates of the deformed beam, turning about its root."""
        vectors, shifts = self._vectors(x), self.mesh.positions[:, None]
        arms = vectors - shifts * vectors[0]
        return np.array([(one.turning(arms) + shifts * one.velocity).ravel() for one in Twist.units(3)])

    def outline(self, x: Array) -> Array:
        """Return points of the centre line."""
        count = max(1, OUTLINE // self.mesh.count) * self.mesh.count
        rows = [self.mesh.shape(float(a))[0] for a in np.linspace(0.0, self.mesh.axis.length, count + 1)]
        return np.asarray(np.array(rows) @ self._vectors(x))

    def _vectors(self, x: Array) -> Array:
        """Return the nodal vectors, shape (..., n_vectors, 3)."""
        return x[..., self.columns].reshape(*x.shape[:-1], -1, 3)

    def deformation(self, x: Array, u: Array) -> Deformation:
        """Return stretch and slope of the centre line, and how sections turn, in the frame at the root."""
        root, (vectors, rows) = self.marker(self.origin), self.mesh.point_vectors
        frame = root.turned(x, np.eye(3))
        slope, y, z, bent_y, bent_z = np.moveaxis(rows @ self._vectors(x)[:, vectors], 2, 0)
        bent = (cross(bent_y, z) + cross(y, bent_z)) @ frame
        along, own = slope @ frame, self._vectors(x)[:, VECTORS * (self.mesh.n_nodes - 1)]
        tip = ((own - self._vectors(x)[:, 0])[:, None] @ frame)[:, 0]
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
