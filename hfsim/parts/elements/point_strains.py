"""Strains at the Gauss points of elements, as variables of their own where bodies are stiff in space."""

from __future__ import annotations

from collections.abc import Hashable
from functools import cached_property
from typing import Self

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.parts.elements._base import GramLaw
from hfsim.parts.elements.gram_strains import GramStrainLaw
from hfsim.parts.elements.points import PointLaw
from hfsim.parts.elements.varied import VariedGramLaw


@frozen
class VariedStrainLaw(VariedGramLaw):
    """The same energy as a sum of squares, U = sum 1/2 C_k e_k^2, with strains e = S d at each point.

    S are the eigenvectors of its form.
    """

    @classmethod
    def of(cls, law: VariedGramLaw) -> Self:
        """Return the law with strains of a law."""
        return cls(law.quadratic, law.reference, law.n_vectors)

    @property
    def shared(self) -> Hashable:
        """The number of vectors, and that it has strains."""
        return "strains", super().shared

    @cached_property
    def _squares(self) -> tuple[Array, Array]:
        """C, (n_points, n_kinds), and S, (n_points, n_kinds, n_pairs)."""
        sizes, modes = np.linalg.eigh(self.quadratic)
        return np.maximum(sizes, 0.0), modes.swapaxes(1, 2)

    @property
    def stiffness(self) -> Array:
        """C of all strains [J], shape (n_kinds, n_points)."""
        return self._squares[0].T

    def strains_of(self, v: Array) -> Array:
        """Return e, (n_kinds, n_points, n_states), of `component_rows`."""
        return np.asarray(np.matmul(self._squares[1], self.changes_of(v).swapaxes(0, 1)).swapaxes(0, 1))

    def slopes(self, V: Array) -> Array:
        """Return de/dV, shape (..., n_points, n_kinds, n_vectors * n_dim)."""
        return np.asarray(self._squares[1] @ self.product_slopes(V))

    def pull_of(self, v: Array, e: Array) -> Array:
        """Return `pull` with given strains, (n_kinds, n_points, n_states or 1)."""
        C, S = self._squares
        h = np.matmul(S.swapaxes(1, 2), C[..., None] * e.swapaxes(0, 1))
        return self.pushed(v, np.repeat(h, v.shape[-1] // (len(C) * h.shape[-1]), axis=-1))

    def hessian_of(self, V: Array, e: Array) -> Array:
        """Return `hessian` with given strains, (n_kinds, 1, n_points), in one state."""
        (C, S), B = self._squares, self.slopes(V)
        h = np.matmul(S.swapaxes(1, 2), C[..., None] * e.transpose(2, 0, 1))[..., 0]
        return np.asarray(B.swapaxes(-1, -2) @ (C[..., None] * B) + self.bent_by(h, V.shape[-1]))


@frozen
class PointStrainLaw(PointLaw):
    """The sum over Gauss points with the strains of all points of an element."""

    @classmethod
    def of(cls, law: PointLaw) -> Self:
        """Return the law with strains of a law."""
        own = law.law
        if isinstance(own, GramLaw):
            return cls(GramStrainLaw.of(own), law.rows)
        assert isinstance(own, VariedGramLaw)
        return cls(VariedStrainLaw.of(own), law.rows)

    @property
    def _points(self) -> int:
        return len(self.rows[0])

    @property
    def _strained(self) -> GramStrainLaw | VariedStrainLaw:
        assert isinstance(self.law, GramStrainLaw | VariedStrainLaw)
        return self.law

    def _by_elements(self, numbers: Array) -> Array:
        """Return numbers (n_kinds, n_points * n_elements, ...) as (n_points * n_kinds, n_elements, ...)."""
        apart = numbers.reshape(len(numbers), self._points, -1, *numbers.shape[2:])
        return apart.swapaxes(0, 1).reshape(-1, *apart.shape[2:])

    def _by_points(self, numbers: Array) -> Array:
        """Return the inverse of that."""
        apart = numbers.reshape(self._points, -1, *numbers.shape[1:]).swapaxes(0, 1)
        return apart.reshape(len(apart), -1, *apart.shape[3:])

    @cached_property
    def stiffness(self) -> Array:
        """C of all strains [J], shape (n_kinds, n_elements)."""
        return self._by_elements(self._strained.stiffness)

    def strains_of(self, v: Array) -> Array:
        """Return the strains, (n_kinds, n_elements, n_states), of `component_rows`."""
        return self._by_elements(self._strained.strains_of(self._rows_at_points(v)))

    def slopes(self, V: Array) -> Array:
        """Return their derivative by V, shape (..., n_elements, n_kinds, n_vectors * n_dim)."""
        B = self._strained.slopes(self._at_points(V))
        kinds, (count, points, n), n_dim = B.shape[-2], self.rows.shape, V.shape[-1]
        B = np.moveaxis(B.reshape(-1, points, V.shape[-3], kinds, count, n_dim), (1, 4), (0, 5))
        found = (B.reshape(points, -1, count) @ self._rows_of_points).reshape(points, -1, kinds, n_dim, n)
        return found.transpose(1, 0, 2, 4, 3).reshape(*V.shape[:-2], points * kinds, n * n_dim)

    def pull_of(self, v: Array, e: Array) -> Array:
        """Return `pull` with given strains, (n_kinds, n_elements, n_states or 1)."""
        return self._pushed(self._strained.pull_of(self._rows_at_points(v), self._by_points(e)), v)

    def hessian_of(self, V: Array, e: Array) -> Array:
        """Return `hessian` with given strains, (n_kinds, 1, n_elements), in one state."""
        at_points = self._by_points(e.swapaxes(1, 2)).swapaxes(1, 2)
        return self._summed(self._strained.hessian_of(self._at_points(V), at_points), V)
