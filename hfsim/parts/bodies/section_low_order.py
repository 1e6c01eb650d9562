"""Beams of the model lowOrder with sections: linear strains and the foreshortening of what is bent (eq. 44).

The line is at s' = s0 + p - 1/2 int_0^s |p'_a|^2 t, where t is the tangent of the undeformed line and p'_a
what of p' is across it; strains are linear in p and in the turns of sections (eq. 45).  The integral up to
the nodes is that of the polynomials through the Gauss points.  Then p follows from the places s' of the
nodes, and at these points t . p' = t . (s' - s0)' + 1/2 |p'_a|^2 is exact.  So the coordinates are
the nodal vectors of every other model: no inertia is left out, and the mass matrix is constant.
"""

from __future__ import annotations

from dataclasses import field
from functools import cached_property
from typing import ClassVar

import numpy as np

from hfsim.errors import SolverFailure
from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.parts.bodies.cosserat import CosseratBeam
from hfsim.parts.bodies.section_linear import LinearSectionBeam, LinearSectionForce


@frozen
class LowOrderSectionBeam(LinearSectionBeam):
    """A beam with sections whose strains are linear but for the foreshortening."""

    @cached_property
    def elastic(self) -> LowOrderSectionForce:
        """Elastic force and damping."""
        mesh, (vectors, rows) = self.mesh, self.mesh.point_vectors
        d = (rows @ mesh.undeformed[vectors])[:, 1 : mesh.n_dim]
        across = np.zeros((mesh.n_dim - 1, len(vectors), len(mesh.undeformed), mesh.n_dim))
        for point, own in enumerate(vectors):
            across[:, point, own] = rows[point, 0, :, None] * d[point][:, None]
        damped = mesh.resisting[1, 0] * mesh.points[1]
        rows = across.reshape(*across.shape[:2], -1)
        return self.linearised(LowOrderSectionForce, across=rows, damped=damped)

    def section_axes(self, x: Array, places: Array) -> Array:
        """Return the axes of its sections as they are: these carry the tension along the line."""
        return CosseratBeam.section_axes(self, x, places)


@frozen
class LowOrderSectionForce(LinearSectionForce):
    """Linear force of shear, torsion and bending, and that of stretch with foreshortening, of one beam.

    Attributes
    ----------
    across : ndarray, shape (n_dim - 1, n_points, n_coordinates)
        Slopes along the axes of the undeformed sections at Gauss points, per change of nodal vectors.
    damped : ndarray, shape (n_points,)
        Damping of stretch, times length by weight [N m s].
    """

    across: Array = field(kw_only=True)
    damped: Array = field(kw_only=True)
    nonlinear: ClassVar[int] = 1
    runs_away: ClassVar[bool] = False

    def runaway(self, t: float, x: Array) -> SolverFailure | None:
        """Return None."""

    @property
    def uses_rates(self) -> bool:
        """Whether there is damping."""
        return super().uses_rates or bool(self.damped.any())

    @property
    def along(self) -> Array:
        """Stretch at Gauss points per change of nodal vectors, without foreshortening, (n_points, n)."""
        return self.small[: len(self.damped)]

    def strains_of(self, p: Array) -> Array:
        """Return the strains, of which the first are with the foreshortening."""
        e = super().strains_of(p)
        e[:, : len(self.damped)] = self.stretched(p)[1]
        return e

    def changing(self, p: Array) -> Array:
        """Return their derivative by changes of relative vectors."""
        slopes, _ = self.stretched(p)
        foreshortened = self.along + np.sum(slopes.swapaxes(1, 2) * self.across, axis=0)
        return np.concatenate([foreshortened, self.small[len(self.damped) :]])

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
        N = self.resistances[0] * (stretch if self.given is None else self.given[:, : stretch.shape[1]])
        if rates is not None:
            N = N + self.damped * self.stretching(slopes, rates)
        tension = N @ self.along + np.sum((N * slopes) @ self.across, axis=0)
        return np.asarray(super().local(p, rates) - tension)

    def strain_energy(self, x: Array) -> Array:
        """Return 1/2 e^T C e of the strains e."""
        _, stretch = self.stretched(self.displacements(x))
        return np.asarray(super().strain_energy(x) + 0.5 * stretch**2 @ self.resistances[0])

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return the power of the damping."""
        slopes, _ = self.stretched(self.displacements(x))
        stretching = self.stretching(slopes, self.rates(x, u))
        return np.asarray(super().power(t, x, u) - stretching**2 @ self.damped)
