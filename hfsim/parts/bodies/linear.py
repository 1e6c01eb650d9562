"""Beams of the model linear."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from hfsim.errors import SolverFailure
from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import NOTHING, Entries
from hfsim.maths.rotations import as_complex, as_vectors
from hfsim.mechanics.deformation import Deformation
from hfsim.mechanics.force import ForcePart, difference
from hfsim.parts.bodies.nodal import NodalBeam
from hfsim.parts.bodies.planar_frame import relative_nodes
from hfsim.parts.bodies.planar_natural import PlanarIncrements

LIMIT_LENGTHS = 10.0
"""Displacement over length at which a beam of the model linear has broken down."""
NO_STRAIN = 1e-15
"""Eigenvalues of the stiffness, over the largest, that are rounding."""


@frozen
class LinearBeam(NodalBeam):
    """A beam whose elastic force is linearised about the undeformed state in the body frame."""

    _kind: ClassVar[type[LinearElasticForce]]
    gives_way_at: ClassVar[None] = None
    """The force is linear."""

    def forces(self, n: int) -> Iterator[ForcePart]:
        """Yield the weight, and elastic force and damping as one."""
        yield self.beam.weight(n)
        yield self._elastic

    @property
    def _elastic(self) -> LinearElasticForce:
        """That of the element's own energy about the undeformed state."""
        beam, mesh, n = self.beam, self.mesh, self.n_dim
        local = np.kron(mesh.differences, np.eye(n)).reshape(mesh.count, -1, n * mesh.n_vectors)
        K, damping = (
            np.asarray(sum(part.T @ own @ part for part, own in zip(local, matrices, strict=True)))
            for matrices in beam.element_matrices(beam.measures.curvature)
        )
        state = self.undeformed, self.positions
        return self._kind(self.name, self.columns, K, damping, *state, item=self.item)

    def section_axes(self, x: Array, places: Array) -> Array:
        """Return the axes of the body frame: those of the undeformed sections."""
        from hfsim.parts.bodies.section_axes import in_the_plane

        return in_the_plane(np.repeat(self.vectors(x)[:, 1:2], len(places), axis=1))

    def _stretch(self, seen: Deformation) -> Array:
        return np.asarray(seen.axial[0])


@frozen
class LinearElasticForce(ForcePart):
    """Elastic force of one beam linearised about its undeformed state in the body frame (eq. 42-43).

    Attributes
    ----------
    name : str
        Of the beam.
    stiffness, damping : ndarray, shape (n_vectors * n_dim, n_vectors * n_dim)
        Over all relative nodal coordinates [N/m and the like]; damping multiplies their rates.
    undeformed : ndarray, shape (n_vectors, n_dim)
    positions : ndarray, shape (n_vectors,)
        One for nodal positions, zero for gradients.
    """

    name: str
    columns: slice
    stiffness: Array
    damping: Array
    undeformed: Array
    positions: Array
    told: ClassVar[str] = "elastic force, proportional to the deflections in its own axes"
    why: ClassVar[str] = "beams deform"
    runs_away: ClassVar[bool] = True
    """Without the stiffening by tension a fast beam bends outwards for ever."""

    @property
    def uses_rates(self) -> bool:
        """Whether there is damping."""
        return bool(self.damping.any())

    @property
    def support(self) -> IntArray:
        """All coordinates of the beam."""
        return np.arange(self.columns.start, self.columns.stop)

    @cached_property
    def units(self) -> Array:
        """By what its coordinates change at large, (n,): its size [m], and one."""
        size = float(np.ptp(self.undeformed[self.positions > 0.0], axis=0).max())
        return np.repeat(np.where(self.positions > 0.0, size, 1.0), self.undeformed.shape[1])

    def _nodes(self, x: Array) -> Array:
        return x[:, self.columns].reshape(len(x), *self.undeformed.shape)

    def _deformation(self, x: Array) -> tuple[Array, Any, Any]:
        """Return p - p0 flattened, the relative vectors and the frame's first axis as complex."""
        origin, tangent, z = relative_nodes(self._nodes(x))
        p = (z - self.positions * origin) * tangent.conj()
        flat = (as_vectors(p) - self.undeformed).reshape(len(x), -1)
        return flat, p, tangent

    def displacements(self, x: Array) -> Array:
        """Return p - p0 flattened, (n_batch, n_vectors * n_dim)."""
        return self._deformation(x)[0]

    def rates(self, x: Array, u: Array) -> Array:
        """Return p', flattened likewise."""
        _, p, tangent = self._deformation(x)
        w = as_complex(self._nodes(u))
        local = (w - self.positions * w[:, :1]) * tangent.conj()
        omega = local[:, 1:2].imag / p[:, 1:2].real
        return as_vectors(local - 1j * omega * p).reshape(len(x), -1)

    def slopes(self, x: Array) -> Array:
        """Return the derivative of p by the coordinates of the beam in one state: a row for each of these."""
        units = self._units(x)
        return self.rates(np.repeat(x, len(units), axis=0), units)

    def _units(self, x: Array) -> Array:
        """Return rates (n, n_x) of one of each coordinate of the beam by itself."""
        units = np.zeros((len(self.support), x.shape[1]))
        units[np.arange(len(units)), self.support] = 1.0
        return units

    def runaway(self, t: float, x: Array) -> SolverFailure | None:
        """Return the failure of a beam that deflects by more than `LIMIT_LENGTHS` times its length."""
        moved = np.abs(self.displacements(x).reshape(len(x), *self.undeformed.shape))
        size = np.linalg.norm(self.undeformed * self.positions[:, None], axis=1).max()
        lengths = float((moved * self.positions[:, None]).max() / size)
        if not lengths > LIMIT_LENGTHS:
            return None
        return SolverFailure(
            reason=f"body '{self.name}' in model linear deflects by {lengths:.3g} times its length "
            f"at t = {t:.4g} s",
            cause="the stiffening that the model leaves out is what would hold it",
            time=t,
            item=self.item,
            kind="model",
            evidence={"displacement_over_length": lengths},
        )

    def in_strains(self) -> ForcePart:
        """Return it with a strain for each eigenvector of the stiffness."""
        return StrainedLinearForce.of(self, self.stiffness)

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add -K (p - p0) - D p', with no force on the frame coordinates."""
        flat, *seen = self._deformation(x)
        local = flat @ -self.stiffness
        if self.uses_rates:
            local -= self.rates(x, u) @ self.damping
        out[:, self.columns] += self._onto_nodes(local, *seen)

    def near(self, x: Array, u: Array) -> Self:
        """Return a force with the same value and derivatives in one state, as smooth as differences need."""
        return self

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the force by x in one state, by differences."""
        near = self.near(x, u)
        return difference(lambda moved: near._resistance(t, moved, u), x, self.support, self.units)

    @cached_property
    def _damper(self) -> Self:
        """The damping alone."""
        return replace(self, stiffness=np.zeros_like(self.stiffness))

    def rate_tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the force by u in one state: the damping at rates of one each.

        Differences of the whole force would lose what resists soft motions in the rounding of what is stiff.
        """
        if not self.uses_rates:
            return NOTHING
        resisted = self._damper._resistance(t, x, self._units(x))[:, self.support]
        return Entries.of_block(self.support, self.support, resisted.T)

    def constant(self, x: Array, local: Array) -> Array:
        """Return the force on the nodes (n_batch, n) of one in the frame (1 or n_batch, n)."""
        flat, *seen = self._deformation(x)
        return self._onto_nodes(np.broadcast_to(local, flat.shape), *seen)

    def _onto_nodes(self, local: Array, p: Any, frame: Any) -> Array:
        """Return what forces (n_batch, n) in the frame are on the nodes, from what `_deformation` returns."""
        force = as_complex(local.reshape(len(local), *self.undeformed.shape)).copy()
        # what the frame coordinates do not feel is balanced at the root vectors
        force[:, 0] = 0.0
        force[:, 1] = force[:, 1].real
        force[:, 0] = -(force @ self.positions)
        force[:, 1] -= 1j * np.sum((p.conj() * force).imag, axis=-1) / p[:, 1].real
        return as_vectors(force * frame).reshape(len(local), -1)

    def strain_energy(self, x: Array) -> Array:
        """Return 1/2 (p - p0)^T K (p - p0)."""
        flat = self.displacements(x)
        return np.asarray(0.5 * np.sum((flat @ self.stiffness) * flat, axis=-1))

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return the power of the damping."""
        rates = self.rates(x, u)
        return np.asarray(-np.sum((rates @ self.damping) * rates, axis=-1))


@frozen
class PlanarLinearForce(LinearElasticForce):
    """The same with its derivative in closed form."""

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the force by x in one state: B^T K B, and how B changes.

        Displacements change by B dx.  The frame turns by w dx with the slope at the root, which stretches by
        s dx: so B dx changes by w dx (w dx p - 2 i B dx) + 2 i s dx w dx p.
        """
        flat, p, frame = self._deformation(x)
        B, K = self.slopes(x), self.stiffness
        turning = 1j * as_complex((flat @ K).reshape(self.undeformed.shape))
        aside = as_vectors(turning).reshape(-1)
        stretch, turn = np.zeros((2, len(B)))
        stretch[2:4], turn[2:4] = (as_vectors(way * frame)[0, 0] / p[0, 1].real for way in (1.0, 1j))
        drawn = B @ aside + 0.5 * np.sum((turning.conj() * (1j * p[0])).real) * turn
        pulled = drawn - np.sum((turning.conj() * p[0]).real) * stretch
        found = self._onto_nodes(B @ K, p, frame) + np.outer(turn, pulled) + np.outer(pulled, turn)
        if self.uses_rates:
            damped = self._damper
            more = difference(lambda moved: damped._resistance(t, moved, u), x, self.support, self.units)
            found = found + more.values.reshape(found.shape)
        return Entries.of_block(self.support, self.support, found)


@frozen
class StrainedLinearForce(ForcePart):
    """The same force with strains e = S (p - p0), where K = S^T C S + R; these may be given.

    Attributes
    ----------
    force : LinearElasticForce
        The same without strains.
    sizes : ndarray, shape (n_strains,)
        C.
    modes : ndarray, shape (n_strains, n)
        S, eigenvectors of K - R in coordinates over their units.
    rest : ndarray, shape (n, n)
        R.
    given : ndarray, shape (1, n_strains), optional
        Strains to take in place of those of the coordinates.
    """

    force: LinearElasticForce
    sizes: Array
    modes: Array
    rest: Array
    given: Array | None = None

    @classmethod
    def of(cls, force: LinearElasticForce, stiffness: Array) -> StrainedLinearForce:
        """Return a force with strains for a part of its stiffness that is that of an energy by itself."""
        units = force.units
        sizes, modes = np.linalg.eigh(units[:, None] * stiffness * units)
        kept = sizes > NO_STRAIN * sizes[-1]
        rest = force.stiffness - stiffness
        return cls(force, sizes[kept], modes.T[kept] / units, rest, item=force.item)

    @property
    def uses_rates(self) -> bool:
        """Whether there is damping."""
        return self.force.uses_rates

    @property
    def support(self) -> IntArray:
        """All coordinates of the beam."""
        return self.force.support

    @property
    def strain_stiffness(self) -> Array:
        """C."""
        return self.sizes

    def strain(self, x: Array) -> Array:
        """Return the strains, shape (n_batch, n_strains)."""
        return self.force.displacements(x) @ self.modes.T

    def strain_slopes(self, x: Array) -> Entries:
        """Return their derivative by x in one state."""
        return Entries.of_block(np.arange(len(self.sizes)), self.support, self._slopes(x))

    def rate_tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the force by u in one state."""
        return self.force.rate_tangent(t, x, u)

    def strained(self, strains: Array) -> StrainedLinearForce:
        """Return the force with given strains."""
        return replace(self, given=strains)

    def _slopes(self, x: Array) -> Array:
        """Return the derivative as a matrix, (n_strains, n)."""
        return np.asarray(self.modes @ self.force.slopes(x).T)

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add minus stiffness times strain, and the damping."""
        if self.given is None:
            self.force.add_force(t, x, u, out)
            return
        local = (self.given * -self.sizes) @ self.modes - self.force.displacements(x) @ self.rest
        if self.uses_rates:
            local = local - self.force.rates(x, u) @ self.force.damping
        out[:, self.force.columns] += self.force.constant(x, local)

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the force by x in one state, as if strains were not given.

        By differences but for what stresses change.
        """
        given = self.strain(x) if self.given is None else self.given
        held = replace(self, force=self.force.near(x, u), given=given)
        B = self._slopes(x)
        units = self.force.units
        geometric = difference(lambda moved: held._resistance(t, moved, u), x, self.support, units)
        return geometric._replace(values=geometric.values + (B.T @ (self.sizes[:, None] * B)).ravel())


@frozen
class PlanarLinearBeam(LinearBeam):
    """A beam of the model linear in the plane."""

    _kind = PlanarLinearForce

    def increments(self) -> PlanarIncrements | None:
        """Return those in the axes of the root; None in its frame, where the stiffness is constant."""
        if self.framed:
            return None
        from hfsim.parts.bodies.planar_rooted import RootedBeams

        element = self.mesh.element
        return RootedBeams(self.columns, 1, element.stride, element.per_node)
