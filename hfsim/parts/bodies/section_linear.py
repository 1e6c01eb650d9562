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
        axes = self.mesh.point(self.origin)[2]
        return LinearSectionForce(*self.linearised(slice(None)), axes=axes, item=self.item)

    def linearised(self, some: slice) -> tuple[str, slice, Array, Array, Array, Array]:
        """Return what a `LinearElasticForce` of some of the strains is made of."""
        mesh, slopes = self.mesh, small_strains(self.mesh)[:, some]
        K, damping = (
            np.einsum("psa,sp,psb->ab", slopes, mesh.at_points(numbers)[some], slopes, optimize=True)
            for numbers in (mesh.properties.stiffness, mesh.properties.damping)
        )
        return self.name, self.columns, K, damping, self.undeformed, self.positions

    def strains(self, x: Array, u: Array) -> Array:
        """Return strains and their rates at Gauss points, shape (2, n_strains, n_batch, n_points)."""
        changes = np.stack([self.elastic.displacements(x), self.elastic.rates(x, u)])
        return np.asarray(np.einsum("psa,kba->ksbp", small_strains(self.mesh), changes))

    def stressed(self, x: Array, strains: Array) -> tuple[Array, Array]:
        """Return nodal vectors, (n_batch, n_vectors, n_dim), and which section forces balance there."""
        which, properties = list(self.mesh.strains.which), self.mesh.properties
        each = np.array([properties.stiffness, properties.damping])[:, which, None, None]
        still = np.broadcast_to(self.undeformed, (len(x), *self.undeformed.shape))
        return still, np.sum(each * strains, axis=0)

    def section_forces(self, x: Array, u: Array, places: Array) -> Array:
        """Return those of the law, in the axes of the sections where these forces balance."""
        from hfsim.parts.bodies.frame_forces import balanced_forces, section_axes
        from hfsim.parts.bodies.line_forces import in_axes

        vectors, S = self.stressed(x, self.strains(x, u))
        parts = balanced_forces(self.mesh, vectors, S, places)
        return in_axes(section_axes(self.mesh, vectors, places), *parts)


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

    def local(self, p: Array, rates: Array | None) -> Array:
        """Return the force in the body frame of changes of its vectors and their rates, (n_batch, n) each."""
        force = p @ -self.stiffness
        if rates is not None:
            force -= rates @ self.damping
        return np.asarray(force)

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add minus the derivative of the energy by X, and what resists the rates likewise."""
        y, A, d = self._relative(x)
        p = (y @ A - self.undeformed).reshape(len(x), -1)
        local = self.local(p, self.rates(x, u) if self.uses_rates else None).reshape(y.shape)
        force = local @ A.swapaxes(1, 2)
        force[:, 0] -= np.einsum("bki,k->bi", force, self.positions)
        force[:, 1 : y.shape[2]] += onto_sections(d, y.swapaxes(1, 2) @ local @ self.axes)
        out[:, self.columns] += force.reshape(len(x), -1)
