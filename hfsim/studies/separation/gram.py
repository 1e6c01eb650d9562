"""The stiffness from products of vectors, as hfsim itself takes it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hfsim.deck.materials import BeamProperties
from hfsim.maths.arrays import Array
from hfsim.parts.elements import Element
from hfsim.parts.elements._base import GramLaw, QuadraticMap
from hfsim.studies.separation._base import StiffnessForm, all_components


@dataclass(frozen=True)
class GramStiffness(StiffnessForm):
    """The same from `GramLaw`: K depends on p through the products of difference vectors only.

    Attributes
    ----------
    law : GramLaw
        Of one element.
    differences : ndarray, shape (n_differences, n_vectors)
    """

    law: GramLaw
    differences: Array

    @classmethod
    def of(cls, element: Element, properties: BeamProperties, n_dim: int = 2) -> GramStiffness:
        """Return the form of an element in plane or space."""
        return cls(element.gram_law(properties, 1, n_dim), np.asarray(element.differences()))

    @property
    def _n_dim(self) -> int:
        return self.law.dimension

    @cached_property
    def _columns(self) -> Array:
        """To the nodal vectors from all shares of the pull: their sum is part of the product."""
        return np.tile(self.differences.T, len(self.differences))

    @cached_property
    def _tangent(self) -> QuadraticMap:
        """From the components of the difference vectors to the tangent over p."""
        second, D = self.law.second_derivative, np.kron(self.differences, np.eye(self._n_dim))

        def on_nodes(rows: Array) -> Array:
            return np.asarray(D.T @ rows.reshape(-1, len(D), len(D)) @ D).reshape(len(rows), -1)

        return replace(second, matrix=on_nodes(second.matrix), constant=on_nodes(second.constant))

    def _vectors(self, p: Array) -> Array:
        """Return the difference vectors, shape (n_differences, n_dim, n_columns)."""
        V = self.differences.dot(p.reshape(len(p) // self._n_dim, -1))
        return np.asarray(V).reshape(len(V), self._n_dim, -1)

    def _force(self, V: Array) -> Array:
        shares = self.law.shares(V).reshape(self._columns.shape[1], -1)
        return np.asarray(self._columns.dot(shares)).reshape(-1, V.shape[-1])

    def stiffness(self, p: Array) -> Array:
        """Return K, shape (n_columns, n, n)."""
        H, D = self.law.weights(self._vectors(p)), self.differences
        of_one = D.T @ H.take(self.law.packed, axis=0).T.reshape(-1, len(D), len(D)) @ D
        return all_components(of_one, self._n_dim)

    def force(self, p: Array) -> Array:
        """Return K p, shape (n, n_columns)."""
        return self._force(self._vectors(p))

    def force_and_tangent(self, p: Array) -> tuple[Array, Array]:
        """Return force and tangent."""
        V = self._vectors(p)
        tangent = self._tangent(np.ascontiguousarray(V.reshape(-1, V.shape[-1]).T))
        return self._force(V), tangent.reshape(-1, len(p), len(p))
