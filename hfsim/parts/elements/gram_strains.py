"""Strains of energies in products of vectors, as variables of their own where bodies are stiff in space."""

from __future__ import annotations

from collections.abc import Hashable
from functools import cached_property
from typing import Self

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.traced import row_products
from hfsim.parts.elements._base import GramLaw

_NOTHING = 1e-15
"""Eigenvalues of the form, over the largest, that are rounding."""


@frozen
class GramStrainLaw(GramLaw):
    """The same energy as a sum of squares, U = sum 1/2 C_k e_k^2 + scale c^T d, with strains e.

    They are the eigenvectors of the form, e_k = sum S_kab (V_a . V_b - g0_ab): integrals of Green's strain
    over the element.  What is linear in products stays as it is.
    """

    @classmethod
    def of(cls, law: GramLaw) -> Self:
        """Return the law with strains of a law."""
        return cls(law.quadratic, law.linear, law.reference, law.scale, law.dimension)

    @property
    def shared(self) -> Hashable:
        """The form, and that it has strains."""
        return "strains", super().shared

    @cached_property
    def _squares(self) -> tuple[Array, Array]:
        """Eigenvalues of the form and S, shapes (n_kinds,) and (n_kinds, n_vectors, n_vectors)."""
        sizes, modes = np.linalg.eigh(self.quadratic)
        kept = sizes > _NOTHING * sizes[-1]
        return sizes[kept], modes.T[kept].reshape(-1, self._n_vectors, self._n_vectors)

    @cached_property
    def stiffness(self) -> Array:
        """C of all strains [J], shape (n_kinds, n_elements)."""
        return np.multiply.outer(self._squares[0], self.scale)

    def strains_of(self, v: Array) -> Array:
        """Return e, (n_kinds, n_elements, n_batch), of `component_rows`."""
        (one, other), (matrix, reference) = self.pairs, self._by_pairs
        e = matrix @ ((v[one] * v[other]).sum(axis=1) - reference)
        return np.asarray(e.reshape(len(e), len(self.scale), -1))

    @cached_property
    def _by_pairs(self) -> tuple[Array, Array]:
        """S and g0 by pairs of vectors, shapes (n_kinds, n_pairs) and (n_pairs, 1)."""
        one, other = self.pairs
        matrix = self._squares[1][:, one, other] * np.where(one == other, 1.0, 2.0)
        return matrix, self.reference.reshape(self._n_vectors, -1)[one, other, None]

    def slopes(self, V: Array) -> Array:
        """Return de/dV, shape (..., n_elements, n_kinds, n_vectors * n_dim)."""
        slopes = 2.0 * (self._squares[1] @ V[..., None, :, :])
        return np.asarray(slopes.reshape(*slopes.shape[:-2], -1))

    def _stresses(self, e: Array) -> Array:
        """Return dU/dG of strains (n_kinds, n_elements, n_batch).

        Shape (n_vectors, n_vectors, n_elements, n_batch).
        """
        n = self._n_vectors
        stress = np.tensordot(self._squares[1], self.stiffness[..., None] * e, axes=(0, 0))
        return np.asarray(stress + (self.scale[:, None] * self.linear).T.reshape(n, n, -1, 1))

    def pull_of(self, v: Array, e: Array) -> Array:
        """Return `pull` with given strains, (n_kinds, n_elements, n_batch or 1)."""
        halves, linear = self._pushing
        stresses = (self.stiffness[..., None] * e).reshape(len(e), -1)
        h = np.dot(halves, stresses).reshape(len(halves), *e.shape[1:])
        h += linear
        if h.size != len(h) * v.shape[-1]:
            h = np.repeat(h, v.shape[-1] // h.shape[1], axis=2)
        x = v.reshape(-1, v.shape[-1])
        _, (some, pairs) = self._factors
        return row_products(x, some, h.reshape(len(h), -1), pairs).reshape(v.shape)

    @cached_property
    def _pushing(self) -> tuple[Array, Array]:
        """2 dU/dG by pairs, of what each strain is multiplied by, and its constant part.

        Shapes (n_pairs, n_kinds) and (n_pairs, n_elements, 1).
        """
        one, other = self.pairs
        linear = (self.scale[:, None] * self.linear)[:, one * self._n_vectors + other]
        return 2.0 * self._squares[1][:, one, other].T, 2.0 * linear.T[..., None]

    def hessian_of(self, V: Array, e: Array) -> Array:
        """Return `hessian` with given strains, (n_kinds, 1, n_elements), in one state."""
        B, h = self.slopes(V), self._stresses(e.transpose(0, 2, 1))[..., 0]
        material = B.swapaxes(-1, -2) @ (self.stiffness.T[..., None] * B)
        geometric = 2.0 * np.einsum("ace,ij->eaicj", h, np.eye(self.dimension))
        return np.asarray(material + geometric.reshape(material.shape[1:]))
