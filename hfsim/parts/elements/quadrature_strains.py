"""Axial strains at the Gauss points of centre lines, as variables of their own where a search goes far."""

from __future__ import annotations

from collections.abc import Hashable
from functools import cached_property
from typing import Self

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.parts.elements.polynomial import gauss_rows
from hfsim.parts.elements.quadrature import QuadratureLaw


@frozen
class QuadratureStrainLaw(QuadratureLaw):
    """The same energy, sum 1/2 C_k e_k^2 and that of bending, with axial strains e at Gauss points."""

    @classmethod
    def of(cls, law: QuadratureLaw) -> Self:
        """Return the law with strains of a law."""
        points = law.axial_points, law.bending_points
        return cls(
            law.axial, law.bending, law.engineering, law.exact_curvature, *points, law.degree, law.n_dim
        )

    @property
    def shared(self) -> Hashable:
        """What the law without strains has, and that it has some."""
        return "strains", super().shared

    @cached_property
    def _axial_rows(self) -> tuple[Array, Array]:
        """Weights (n_points, 1) and rows of r', (n_points, n_vectors), at the axial points."""
        w, rows, _ = gauss_rows(self.axial_points, self.degree)
        return w[:, None], rows

    @cached_property
    def _bent(self) -> QuadratureLaw:
        """The bending alone."""
        points = self.axial_points, self.bending_points
        return QuadratureLaw(
            0.0 * self.axial, self.bending, False, self.exact_curvature, *points, self.degree, self.n_dim
        )

    @cached_property
    def stiffness(self) -> Array:
        """C of all strains [J], shape (n_points, n_elements)."""
        return self._axial_rows[0] * np.broadcast_to(self.axial, (self.axial_points, self._count))

    def strains_of(self, v: Array) -> Array:
        """Return e, (n_points, n_elements, n_batch), of `component_rows`."""
        s = np.tensordot(self._axial_rows[1], v, axes=1)
        return self._strain(np.moveaxis(s, 1, -1))[0].reshape(*self.stiffness.shape, -1)

    def slopes(self, V: Array) -> Array:
        """Return de/dV, shape (..., n_elements, n_points, n_vectors * n_dim)."""
        s = self._axial_rows[1] @ V
        s = self._strain(s)[1][..., None] * s
        slopes = self._axial_rows[1][..., None] * s[..., None, :]
        return np.asarray(slopes.reshape(*slopes.shape[:-2], -1))

    def pull_of(self, v: Array, e: Array) -> Array:
        """Return `pull` with given strains, (n_points, n_elements, n_batch or 1)."""
        rows = self._axial_rows[1]
        s = np.tensordot(rows, v, axes=1)
        first = self._strain(np.moveaxis(s, 1, -1))[1].reshape(*self.stiffness.shape, -1)
        tension = (self.stiffness[..., None] * e * first).reshape(len(rows), 1, -1)
        return np.asarray(np.tensordot(rows.T, tension * s, axes=1) + self._bent.pull(v))

    def hessian_of(self, V: Array, e: Array) -> Array:
        """Return `hessian` with given strains, (n_points, 1, n_elements), in one state."""
        return self._axial_hessian(V, np.moveaxis(e, 0, -1)) + self._bending_hessian(V)
