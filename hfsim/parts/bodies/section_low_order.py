"""Beams of the model lowOrder with sections: linear strains and the foreshortening of what is bent (eq. 44).

The line is at s' = s0 + p - 1/2 int_0^s |p'_a|^2 t, where t is the tangent of the undeformed line and p'_a
what of p' is across it; strains are linear in p and in the turns of sections (eq. 45).  The integral up to
the nodes is that of the polynomials through the Gauss points.  Then p follows from the places s' of the
nodes, and at these points t . p' = t . (s' - s0)' + 1/2 |p'_a|^2 is exact.  So the coordinates are
the nodal vectors of every other model: no inertia is left out, and the mass matrix is constant.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from hfsim.errors import SolverFailure
from hfsim.maths.arrays import Array
from hfsim.parts.bodies.section_linear import LinearSectionBeam, LinearSectionForce, small_strains


@dataclass(frozen=True, eq=False)
class LowOrderSectionBeam(LinearSectionBeam):
    """A beam with sections whose strains are linear but for the foreshortening."""

    @cached_property
    def elastic(self) -> LowOrderSectionForce:
        """Elastic force and damping."""
        mesh, axes = self.mesh, self.mesh.point(self.origin)[2]
        (vectors, rows), properties = mesh.point_vectors, mesh.properties
        d = (rows @ mesh.undeformed[vectors])[:, 1 : mesh.n_dim]
        across = np.zeros((mesh.n_dim - 1, len(vectors), len(mesh.undeformed), mesh.n_dim))
        for point, own in enumerate(vectors):
            across[:, point, own] = rows[point, 0, :, None] * d[point][:, None]
        return LowOrderSectionForce(
            *self.linearised(slice(1, None)),
            axes=axes,
            along=small_strains(mesh)[:, 0],
            across=across.reshape(*across.shape[:2], -1),
            resisting=np.array([mesh.at_points(n)[0] for n in (properties.stiffness, properties.damping)]),
            item=self.item,
        )

    def strains(self, x: Array, u: Array) -> Array:
        """Return strains and their rates, of which the first are with the foreshortening."""
        force, found = self.elastic, super().strains(x, u)
        slopes, found[0, 0] = force.stretched(force.displacements(x))
        found[1, 0] = force.stretching(slopes, force.rates(x, u))
        return found

    def stressed(self, x: Array, strains: Array) -> tuple[Array, Array]:
        """Return its nodal vectors, and the section forces: the tension is along the line, which shears."""
        _, S = super().stressed(x, strains)
        S[1 : self.n_dim] += S[0] * strains[0, 1 : self.n_dim]
        return self.vectors(x), S


@dataclass(frozen=True, eq=False)
class LowOrderSectionForce(LinearSectionForce):
    """Linear force of shear, torsion and bending, and that of stretch with foreshortening, of one beam.

    Attributes
    ----------
    along : ndarray, shape (n_points, n_coordinates)
        Stretch at Gauss points per change of nodal vectors, without foreshortening.
    across : ndarray, shape (n_dim - 1, n_points, n_coordinates)
        Slopes along the axes of the undeformed sections, likewise.
    resisting : ndarray, shape (2, n_points)
        EA [N m] and its damping [N m s], times length by weight.
    """

    along: Array = field(kw_only=True)
    across: Array = field(kw_only=True)
    resisting: Array = field(kw_only=True)
    runs_away: ClassVar[bool] = False

    def runaway(self, t: float, x: Array) -> SolverFailure | None:
        """Return None."""

    @property
    def uses_rates(self) -> bool:
        """Whether there is damping."""
        return super().uses_rates or bool(self.resisting[1].any())

    def stretched(self, p: Array) -> tuple[Array, Array]:
        """Return slopes (n_dim - 1, n_batch, n_points) and stretch (n_batch, n_points) at Gauss points."""
        slopes = p @ self.across.swapaxes(1, 2)
        return slopes, p @ self.along.T + 0.5 * np.sum(slopes * slopes, axis=0)

    def stretching(self, slopes: Array, rates: Array) -> Array:
        """Return the rate of stretch."""
        turning = rates @ self.across.swapaxes(1, 2)
        return np.asarray(rates @ self.along.T + np.sum(slopes * turning, axis=0))

    def local(self, p: Array, rates: Array | None) -> Array:
        """Return the force in the body frame."""
        slopes, stretch = self.stretched(p)
        N = self.resisting[0] * stretch
        if rates is not None:
            N += self.resisting[1] * self.stretching(slopes, rates)
        tension = N @ self.along + np.sum((N * slopes) @ self.across, axis=0)
        return np.asarray(super().local(p, rates) - tension)

    def strain_energy(self, x: Array) -> Array:
        """Return 1/2 e^T C e of the strains e."""
        _, stretch = self.stretched(self.displacements(x))
        return np.asarray(super().strain_energy(x) + 0.5 * stretch**2 @ self.resisting[0])

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return the power of the damping."""
        slopes, _ = self.stretched(self.displacements(x))
        stretching = self.stretching(slopes, self.rates(x, u))
        return np.asarray(super().power(t, x, u) - stretching**2 @ self.resisting[1])
