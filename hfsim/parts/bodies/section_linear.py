"""Beams of the model linear with sections: linear shear, bending and torsion in the frame at the root."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.mechanics.force import ForcePart
from hfsim.parts.bodies.cosserat import CosseratBeam
from hfsim.parts.bodies.linear import LinearElasticForce
from hfsim.parts.bodies.root_axes import onto_sections, triad, triad_rate
from hfsim.parts.bodies.section_mesh import SectionMesh
from hfsim.parts.elements.cosserat import strain_slopes


@dataclass(frozen=True, eq=False)
class LinearSectionBeam(CosseratBeam):
    """A beam with sections whose elastic force is linearised about the undeformed state in the body frame."""

    def forces(self, n: int) -> Iterator[ForcePart]:
        """Yield the weight, and elastic force and damping as one."""
        yield self.weight(n)
        yield self.elastic

    @cached_property
    def elastic(self) -> LinearSectionForce:
        """Elastic force and damping."""
        mesh, slopes = self.mesh, small_strains(self.mesh)
        K, damping = (
            np.einsum("psa,sp,psb->ab", slopes, mesh.at_points(numbers), slopes, optimize=True)
            for numbers in (mesh.properties.stiffness, mesh.properties.damping)
        )
        still, axes = (self.undeformed, self.positions), mesh.point(self.origin)[2]
        return LinearSectionForce(self.name, self.columns, K, damping, *still, axes=axes, item=self.item)

    def section_forces(self, x: Array, u: Array, places: Array) -> Array:
        """Return those of the linear law, in the axes of the undeformed sections."""
        from hfsim.parts.bodies.frame_forces import balanced_forces, section_axes
        from hfsim.parts.bodies.line_forces import in_axes

        mesh, which, force = self.mesh, list(self.mesh.strains.which), self.elastic
        each = np.array([mesh.properties.stiffness, mesh.properties.damping])[:, which, None, None]
        changes = np.stack([force.displacements(x), force.rates(x, u)])
        S = np.sum(each * np.einsum("psa,kba->ksbp", small_strains(mesh), changes), axis=0)
        still = np.broadcast_to(self.undeformed, (len(x), *self.undeformed.shape))
        parts = balanced_forces(mesh, still, S, places)
        return in_axes(section_axes(mesh, still, places), *parts)


def small_strains(mesh: SectionMesh) -> Array:
    """Return the strains at Gauss points per change of nodal vectors, (n_points, n_strains, n_coordinates).

    Of changes of section vectors their turn counts, so that what keeps them of unit length strains nothing.
    """
    (vectors, rows), n = mesh.point_vectors, mesh.n_dim
    V = rows @ mesh.undeformed[vectors]
    slopes = strain_slopes(mesh.strains, V).reshape(*V.shape[:1], -1, *V.shape[1:])
    found = np.zeros((len(V), slopes.shape[1], mesh.undeformed.size // n, n))
    on_nodes = np.einsum("psvi,pvk->pski", slopes, rows)
    for point, own in enumerate(vectors):
        found[point, :, own] += on_nodes[point].swapaxes(0, 1)
    nodes = found.reshape(*found.shape[:2], mesh.n_nodes, n * n)
    turning: Array = np.einsum("pska,kab->pskb", nodes, _turns_only(mesh))
    return turning.reshape(*found.shape[:2], -1)


def _turns_only(mesh: SectionMesh) -> Array:
    """Return the projections of changes of each node's vectors onto those in which its section turns."""
    n = mesh.n_dim
    pairs = [(i, j) for i in range(1, n) for j in range(i, n)]
    projections = []
    for node in mesh.undeformed.reshape(mesh.n_nodes, n, n):
        rows = np.zeros((len(pairs), n, n))
        for row, (i, j) in zip(rows, pairs, strict=True):
            row[i] += node[j]
            row[j] += node[i]
        held = rows.reshape(len(pairs), -1)
        projections.append(np.eye(n * n) - np.linalg.pinv(held) @ held)
    return np.array(projections)


@dataclass(frozen=True, eq=False)
class LinearSectionForce(LinearElasticForce):
    """Elastic force of one beam with sections, linearised about its undeformed state in the body frame.

    Attributes
    ----------
    axes : ndarray, shape (n_dim, n_dim)
        Of the root's section in the body frame, as columns.
    """

    axes: Array = field(kw_only=True)

    def _relative(self, x: Array) -> tuple[Array, Array, Array]:
        """Return vectors from the root on, the body frame's axes as columns, the root's section vectors."""
        X = self._nodes(x)
        d = X[:, 1 : X.shape[2]]
        return X - self.positions[:, None] * X[:, :1], triad(d) @ self.axes.T, d

    def displacements(self, x: Array) -> Array:
        """Return p - p0 flattened, (n_batch, n_vectors * n_dim)."""
        y, A, _ = self._relative(x)
        return np.asarray((y @ A - self.undeformed).reshape(len(x), -1))

    def rates(self, x: Array, u: Array) -> Array:
        """Return p', flattened likewise."""
        (y, A, d), U = self._relative(x), self._nodes(u)
        turning = triad_rate(d, U[:, 1 : U.shape[2]]) @ self.axes.T
        return np.asarray(((U - self.positions[:, None] * U[:, :1]) @ A + y @ turning).reshape(len(x), -1))

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add minus the derivative of the energy by X, and what resists the rates likewise."""
        y, A, d = self._relative(x)
        local = (y @ A - self.undeformed).reshape(len(x), -1) @ -self.stiffness
        if self.uses_rates:
            local -= self.rates(x, u) @ self.damping
        local = local.reshape(y.shape)
        force = local @ A.swapaxes(1, 2)
        force[:, 0] -= np.einsum("bki,k->bi", force, self.positions)
        force[:, 1 : y.shape[2]] += onto_sections(d, y.swapaxes(1, 2) @ local @ self.axes)
        out[:, self.columns] += force.reshape(len(x), -1)
