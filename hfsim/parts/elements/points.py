"""Energy that is a form in products of a few vectors at each Gauss point of an axis."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace
from functools import cached_property
from typing import Protocol, Self

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.parts.elements._base import ElasticLaw, RowLaw


class ProductLaw(ElasticLaw, Protocol):
    """A law in products of vectors, alike or not at all points."""

    def in_turn(self, other: Self, points: int) -> Self:
        """Return the law of elements of so many points each and of others, point by point."""


@frozen
class PointLaw(RowLaw):
    """The sum of one law in products over the Gauss points of elements.

    Attributes
    ----------
    law : ProductLaw
        Of all points: of the first point of all elements, then of the second, and so on.
    rows : ndarray, shape (n_at_point, n_points, n_vectors)
        From an element's difference vectors to those at its points.
    """

    law: ProductLaw
    rows: Array

    @property
    def integrals(self) -> str:
        """How the integrals are done, in the words of plans."""
        return f"{self.rows.shape[1]} Gauss points an element"

    @property
    def quartic(self) -> bool:
        """Return True."""
        return True

    @property
    def shared(self) -> Hashable:
        """The form at the points and these; elements differ in their scale only."""
        return self.law.shared, self.rows.tobytes()

    def joined(self, other: PointLaw) -> PointLaw:
        """Return the law of this one's elements followed by the other's."""
        return replace(self, law=self.law.in_turn(other.law, self.rows.shape[1]))

    @cached_property
    def _matrices(self) -> tuple[Array, Array]:
        """The rows as one matrix, and its transpose."""
        flat = self.rows.reshape(-1, self.rows.shape[2])
        return flat, np.ascontiguousarray(flat.T)

    def _at_points(self, V: Array) -> Array:
        """Return the vectors at points, shape (..., n_points * n_elements, n_at_point, n_dim)."""
        z = np.einsum("apn,...end->...pead", self.rows, V, optimize=True)
        return np.asarray(z.reshape(*V.shape[:-3], -1, *z.shape[-2:]))

    def energy(self, V: Array) -> Array:
        """Return the stored energy [J], shape (..., n_elements)."""
        energy = self.law.energy(self._at_points(V))
        return np.asarray(energy.reshape(*V.shape[:-3], self.rows.shape[1], -1).sum(axis=-2))

    def pull(self, v: Array) -> Array:
        """Return dU/dV [J] in rows."""
        rows, columns = self._matrices
        count, points, _ = self.rows.shape
        n_dim = v.shape[1]
        z = rows.dot(v.reshape(len(v), -1)).reshape(count, points, n_dim, -1)
        at_points = np.ascontiguousarray(z.swapaxes(1, 2)).reshape(count, n_dim, -1)
        pulled = self.law.pull(at_points).reshape(count, n_dim, points, -1).swapaxes(1, 2)
        return np.asarray(columns.dot(pulled.reshape(len(rows), -1))).reshape(v.shape)

    def hessian(self, V: Array) -> Array:
        """Return d2U/dV2 [J], shape (..., n_elements, n_vectors * n_dim, n_vectors * n_dim)."""
        count, points, n = self.rows.shape
        n_dim = V.shape[-1]
        H = self.law.hessian(self._at_points(V))
        H = H.reshape(*V.shape[:-3], points, -1, count, n_dim, count, n_dim)
        out = np.einsum("apm,...peaibj,bpn->...eminj", self.rows, H, self.rows, optimize=True)
        return np.asarray(out.reshape(*V.shape[:-2], n * n_dim, n * n_dim))
