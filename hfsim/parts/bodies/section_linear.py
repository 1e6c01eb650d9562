"""Beams of the model linear with sections: linear shear, bending and torsion in the frame at the root."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field, replace
from functools import cached_property
from typing import Any, ClassVar, Self, TypeVar

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.mechanics.force import ForcePart, difference
from hfsim.parts.bodies.cosserat import CosseratBeam
from hfsim.parts.bodies.linear import LinearElasticForce
from hfsim.parts.bodies.root_axes import onto_sections, triad, triad_rate
from hfsim.parts.bodies.section_mesh import SectionMesh

TABLES = 35.0
"""Full matrices of a beam that a run holds at a time: measured, 24 to 35 with 800 to 1600 coordinates."""
_Force = TypeVar("_Force", bound="LinearSectionForce")


@frozen
class LinearSectionBeam(CosseratBeam):
    """A beam with sections whose elastic force is linearised about the undeformed state in the body frame."""

    def forces(self, n: int) -> Iterator[ForcePart]:
        """Yield the weight, and elastic force and damping as one."""
        yield self.weight(n)
        yield self.elastic

    @cached_property
    def elastic(self) -> LinearSectionForce:
        """Elastic force and damping."""
        return self.linearised(LinearSectionForce)

    def linearised(self, kind: type[_Force], **more: Any) -> _Force:
        """Return the force of a kind with the matrices of those strains that are linear in it."""
        mesh, rows = self.mesh, small_strains(self.mesh)
        slopes = rows[:, kind.nonlinear :]
        stiffness, damping = mesh.resisting * mesh.points[1]
        K, resisting = (
            np.einsum("psa,sp,psb->ab", slopes, numbers[kind.nonlinear :], slopes, optimize=True)
            for numbers in (stiffness, damping)
        )
        return kind(
            name=self.name,
            columns=self.columns,
            stiffness=K,
            damping=resisting,
            undeformed=self.undeformed,
            positions=self.positions,
            axes=mesh.point(self.origin)[2],
            small=rows.swapaxes(0, 1).reshape(-1, rows.shape[-1]),
            resistances=stiffness,
            **more,
            item=self.item,
        )

    def tables(self, n: int) -> float:
        """Return that of its full matrices and of those of its strains."""
        own = self.columns.stop - self.columns.start
        return 8.0 * TABLES * float(own) ** 2

    def section_axes(self, x: Array, places: Array) -> Array:
        """Return the axes of undeformed sections, carried along by the body frame."""
        from hfsim.parts.bodies.section_axes import square_axes

        own = square_axes(self.mesh, self.undeformed[None], places)
        frame = np.zeros((len(x), 1, 3, 3))
        frame[..., 2, 2] = 1.0
        frame[:, 0, : self.n_dim, : self.n_dim] = self.elastic.frame(x)
        return np.asarray(frame @ own)


def small_strains(mesh: SectionMesh) -> Array:
    """Return the strains at Gauss points per change of nodal vectors, (n_points, n_strains, n_coordinates).

    Of changes of section vectors their turn counts, so that what keeps them of unit length strains nothing.
    """
    (vectors, rows), n = mesh.point_vectors, mesh.n_dim
    V = rows @ mesh.undeformed[vectors]
    slopes = mesh.strains.slopes(V).reshape(*V.shape[:1], -1, *V.shape[1:])
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


@frozen
class LinearSectionForce(LinearElasticForce):
    """Elastic force of one beam with sections, linearised about its undeformed state in the body frame.

    Attributes
    ----------
    axes : ndarray, shape (n_dim, n_dim)
        Of the root's section in the body frame, as columns.
    small : ndarray, shape (n_kinds * n_points, n_coordinates)
        Strains at Gauss points, kind by kind, per small change of relative nodal vectors.
    resistances : ndarray, shape (n_kinds, n_points)
        What they are multiplied by, times length by weight [N m and the like].
    given : ndarray, shape (n_batch or 1, n_strains), optional
        Strains to take in place of those of the coordinates.
    """

    axes: Array = field(kw_only=True)
    small: Array = field(kw_only=True)
    resistances: Array = field(kw_only=True)
    given: Array | None = field(default=None, kw_only=True)
    nonlinear: ClassVar[int] = 0
    """Kinds of strains, the first ones, that are not linear in the relative vectors."""

    @property
    def strain_stiffness(self) -> Array:
        """That of all strains, point by point for each kind."""
        return self.resistances.ravel()

    def strain(self, x: Array) -> Array:
        """Return the strains, shape (n_batch, n_strains)."""
        return self.strains_of(self.displacements(x))

    def strain_slopes(self, x: Array) -> Entries:
        """Return their derivative by x in one state."""
        return Entries.of_block(np.arange(len(self.small)), self.support, self._slopes(x))

    def in_strains(self) -> Self:
        """Return itself."""
        return self

    def strained(self, strains: Array) -> Self:
        """Return the force with given strains."""
        return replace(self, given=strains)

    def strains_of(self, p: Array) -> Array:
        """Return the strains of changes of relative vectors, (n_batch, n_strains)."""
        return p @ self.small.T

    def changing(self, p: Array) -> Array:
        """Return their derivative by these changes of one state (1, n), (n_strains, n)."""
        return self.small

    def _slopes(self, x: Array) -> Array:
        """Return the derivative of the strains by the nodal vectors of one state, (n_strains, n)."""
        y, A, d = self._relative(x)
        p = (y @ A - self.undeformed).reshape(1, -1)
        return self._onto_vectors(self.changing(p).reshape(-1, *y.shape[1:]), y, A, d)

    def _relative(self, x: Array) -> tuple[Array, Array, Array]:
        """Return vectors from the root on, the body frame's axes as columns, the root's section vectors."""
        X = self._nodes(x)
        d = X[:, 1 : X.shape[2]]
        return X - self.positions[:, None] * X[:, :1], triad(d) @ self.axes.T, d

    def frame(self, x: Array) -> Array:
        """Return the body frame's axes as columns, (n_batch, n_dim, n_dim)."""
        return self._relative(x)[1]

    def displacements(self, x: Array) -> Array:
        """Return p - p0 flattened, (n_batch, n_vectors * n_dim)."""
        y, A, _ = self._relative(x)
        return np.asarray((y @ A - self.undeformed).reshape(len(x), -1))

    def rates(self, x: Array, u: Array) -> Array:
        """Return p', flattened likewise."""
        (y, A, d), U = self._relative(x), self._nodes(u)
        turning = triad_rate(d, U[:, 1 : U.shape[2]]) @ self.axes.T
        return np.asarray(((U - self.positions[:, None] * U[:, :1]) @ A + y @ turning).reshape(len(x), -1))

    @cached_property
    def _damper(self) -> Self:
        """The damping alone."""
        return replace(super()._damper, resistances=np.zeros_like(self.resistances))

    def local(self, p: Array, rates: Array | None) -> Array:
        """Return the force in the body frame of changes of its vectors and their rates, (n_batch, n) each."""
        if self.given is None:
            force = p @ -self.stiffness
        else:
            first = self.nonlinear * self.resistances.shape[1]
            force = (self.given * -self.strain_stiffness)[:, first:] @ self.small[first:]
        if rates is not None:
            force = force - rates @ self.damping
        return np.asarray(force)

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add minus the derivative of the energy by X, and what resists the rates likewise."""
        y, A, d = self._relative(x)
        p = (y @ A - self.undeformed).reshape(len(x), -1)
        local = self.local(p, self.rates(x, u) if self.uses_rates else None)
        out[:, self.columns] += self._onto_vectors(local.reshape(-1, *y.shape[1:]), y, A, d)

    def _onto_vectors(self, local: Array, y: Array, A: Array, d: Array) -> Array:
        """Return forces on nodal vectors, flattened, from those in the body frame, (n_batch, ...) as y."""
        force = local @ A.swapaxes(1, 2)
        force[:, 0] -= np.einsum("bki,k->bi", force, self.positions)
        force[:, 1 : y.shape[2]] += onto_sections(d, y.swapaxes(1, 2) @ local @ self.axes)
        return np.asarray(force.reshape(len(force), -1))

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the force by x in one state, as if strains were not given.

        By differences but for what stresses change.
        """
        held = self if self.given is not None else self.strained(self.strain(x))
        B = self._slopes(x)
        material = B.T @ (self.strain_stiffness[:, None] * B)
        geometric = difference(lambda moved: held._resistance(t, moved, u), x, self.support, self.units)
        return geometric._replace(values=geometric.values + material.ravel())
