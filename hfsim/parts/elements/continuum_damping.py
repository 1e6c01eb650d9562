"""Damping of fully parameterised elements: of all of their strains."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.mechanics.connectivity import Connectivity
from hfsim.parts.elements.forces import MaterialDamping
from hfsim.parts.elements.points import PointLaw
from hfsim.parts.elements.varied import VariedGramLaw


@frozen
class ContinuumDamping(MaterialDamping):
    """Damping proportional to the rates of Green's strain, at the Gauss points of the elements' axes.

    Their force is B^T C B V', B the slopes of the products of vectors: no rigid motion changes these.

    Attributes
    ----------
    of_points : PointLaw
        On the difference vectors of elements, with retardation times in its form [J s].
    """

    of_elements: Connectivity
    of_points: PointLaw

    @cached_property
    def elements(self) -> Connectivity:
        """That of the Gauss points, element by element for each."""
        own, rows = self.of_elements, self.of_points.rows.swapaxes(0, 1)
        local = np.concatenate([np.kron(one, np.eye(own.n_dim)) @ own.local for one in rows])
        return Connectivity(own.n, np.tile(own.columns, (len(rows), 1)), local, own.n_dim)

    @property
    def law(self) -> VariedGramLaw:
        """The form at the points."""
        assert isinstance(self.of_points.law, VariedGramLaw)
        return self.of_points.law

    @property
    def counts(self) -> dict[str, int | str]:
        """One kernel serves all points in one call."""
        return {"kernels": 1, "integrals": self.of_points.integrals}

    @property
    def dissipates(self) -> bool:
        """Whether there is any damping."""
        return bool(self.law.quadratic.any())

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add minus B^T C B V'."""
        v = self.elements.rows(x)
        rates = self.law.rates_of(v, self.elements.rows(u))
        stressed = np.matmul(self.law.quadratic, rates.swapaxes(0, 1))
        out -= self.elements.push(self.law.pushed(v, stressed), len(x))

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the force by x in one state."""
        V, dV = self.elements.vectors(x)[0], self.elements.vectors(u)[0]
        B, turned = self.law.product_slopes(V), self.law.product_slopes(dV)
        stressed = self.law.quadratic @ (B @ dV.reshape(len(dV), -1, 1))
        resisted = B.swapaxes(-1, -2) @ (self.law.quadratic @ turned)
        return self.elements.entries(self.law.bent_by(stressed[..., 0], V.shape[-1]) + resisted)

    def rate_tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the force by u in one state."""
        B = self.law.product_slopes(self.elements.vectors(x)[0])
        return self.elements.entries(B.swapaxes(-1, -2) @ (self.law.quadratic @ B))

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return minus the dissipated power."""
        rates = self.law.rates_of(self.elements.rows(x), self.elements.rows(u)).swapaxes(0, 1)
        return np.asarray(-np.sum(rates * np.matmul(self.law.quadratic, rates), axis=(0, 1)))
