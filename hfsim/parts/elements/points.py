"""Energy that is a form in products of a few vectors at each Gauss point of an axis."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace
from functools import cached_property
from typing import ClassVar, Protocol, Self

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.parts.elements._base import ElasticLaw


class ProductLaw(ElasticLaw, Protocol):
    """A law in products of vectors, alike or not at all points."""

    def in_turn(self, other: Self, points: int) -> Self:
        """Return the law of elements of so many points each and of others, point by point."""


@frozen
class PointLaw:
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
    quartic: ClassVar[bool] = True

    @property
    def integrals(self) -> str:
        """How the integrals are done, in the words of plans."""
        return f"{self.rows.shape[1]} Gauss points an element"

    @property
    def shared(self) -> Hashable:
        """The form at the points and these; elements differ in their scale only."""
        return self.law.shared, self.rows.tobytes()

    def joined(self, other: PointLaw) -> Self:
        """Return the law of this one's elements followed by the other's."""
        return replace(self, law=self.law.in_turn(other.law, self.rows.shape[1]))

    @cached_property
    def _matrices(self) -> tuple[Array, Array]:
        """The rows as one matrix, and its transpose."""
        flat = self.rows.reshape(-1, self.rows.shape[2])
        return flat, np.ascontiguousarray(flat.T)

    @cached_property
    def _rows_of_points(self) -> Array:
        """The rows of each point, shape (n_points, n_at_point, n_vectors)."""
        return np.ascontiguousarray(self.rows.swapaxes(0, 1))

    def _at_points(self, V: Array) -> Array:
        """Return the vectors at points, shape (..., n_points * n_elements, n_at_point, n_dim)."""
        z = (self._matrices[0] @ V).reshape(*V.shape[:-2], *self.rows.shape[:2], V.shape[-1])
        return np.moveaxis(z, -2, -4).reshape(*V.shape[:-3], -1, len(self.rows), V.shape[-1])

    def energy(self, V: Array) -> Array:
        """Return the stored energy [J], shape (..., n_elements)."""
        energy = self.law.energy(self._at_points(V))
        return np.asarray(energy.reshape(*V.shape[:-3], self.rows.shape[1], -1).sum(axis=-2))

    def pull(self, v: Array) -> Array:
        """Return dU/dV [J] in rows."""
        return self._pushed(self.law.pull(self._rows_at_points(v)), v)

    def _rows_at_points(self, v: Array) -> Array:
        """Return the vectors at points in rows, (n_at_point, n_dim, n_points * n_elements * n_states)."""
        count, points, _ = self.rows.shape
        z = np.dot(self._matrices[0], v.reshape(len(v), -1)).reshape(count, points, v.shape[1], -1)
        return np.ascontiguousarray(z.swapaxes(1, 2)).reshape(count, v.shape[1], -1)

    def _pushed(self, pulled: Array, v: Array) -> Array:
        """Return derivatives by vectors in rows v from those by the ones at points."""
        count, points, _ = self.rows.shape
        at_points = pulled.reshape(count, v.shape[1], points, -1).swapaxes(1, 2)
        return np.asarray(np.dot(self._matrices[1], at_points.reshape(count * points, -1))).reshape(v.shape)

    def hessian(self, V: Array) -> Array:
        """Return d2U/dV2 [J], shape (..., n_elements, n_vectors * n_dim, n_vectors * n_dim)."""
        return self._summed(self.law.hessian(self._at_points(V)), V)

    def _summed(self, H: Array, V: Array) -> Array:
        """Return second derivatives by vectors V from those by the ones at points."""
        (count, points, n), n_dim = self.rows.shape, V.shape[-1]
        H = np.moveaxis(H.reshape(-1, points, V.shape[-3], count, n_dim, count, n_dim), (1, 5), (0, 6))
        right = (H.reshape(points, -1, count) @ self._rows_of_points).reshape(points, -1, count, n_dim**2 * n)
        both = self._rows_of_points.reshape(-1, n).T @ right.swapaxes(1, 2).reshape(points * count, -1)
        out = both.reshape(n, -1, n_dim, n_dim, n).transpose(1, 0, 2, 4, 3)
        return np.asarray(out.reshape(*V.shape[:-2], n * n_dim, n * n_dim))
