"""Joint equations that are products of axes of sections: all those of a large scene evaluated at once.

Two axes of a section are coordinates, the third one is their vector product (see `SectionMarker`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries, Matrix, assemble
from hfsim.maths.rotations import cross, skew
from hfsim.mechanics.products import LinearMap, LinearVector, Pull, VectorProducts


class CrossedVector(NamedTuple):
    """A vector linear + factor first x second in space."""

    linear: LinearVector
    first: LinearVector
    second: LinearVector
    factor: float

    @classmethod
    def without(cls, linear: LinearVector) -> CrossedVector:
        """Return a vector that is linear."""
        nothing = LinearVector.constant(np.zeros(3))
        return cls(linear, nothing, nothing, 0.0)


@frozen
class _Side:
    """One of the vectors of all equations.

    Attributes
    ----------
    factor : ndarray, shape (m, 1)
    """

    linear: LinearMap
    first: LinearMap
    second: LinearMap
    factor: Array

    @classmethod
    def of(cls, vectors: Sequence[CrossedVector], n: int, sparse: bool) -> _Side:
        """Return the vectors of n coordinates."""
        *parts, factors = zip(*vectors, strict=True)
        linear, first, second = (LinearMap.of(part, n, sparse) for part in parts)
        return cls(linear, first, second, np.array(factors)[:, None])

    def at(self, x: Array) -> Array:
        """Return them in states (n_batch, n), shape (n_batch, m, 3)."""
        return self.linear.at(x) + self.factor * cross(self.first.at(x), self.second.at(x))

    def moving(self, x: Array, u: Array) -> Array:
        """Return their rates."""
        y, z, dy, dz = self.first.at(x), self.second.at(x), self.first.rates(u), self.second.rates(u)
        return self.linear.rates(u) + self.factor * (cross(dy, z) + cross(y, dz))

    def bias(self, u: Array) -> Array:
        """Return their second derivatives at zero accelerations."""
        return 2.0 * self.factor * cross(self.first.rates(u), self.second.rates(u))

    def pulls(self, x: Array, other: Array) -> list[Pull]:
        """Return what changes of the linear vectors do to the products with vectors (n_batch, m, 3)."""
        y, z = self.first.at(x), self.second.at(x)
        by_first, by_second = self.factor * cross(z, other), self.factor * cross(other, y)
        return [(self.linear, other), (self.first, by_first), (self.second, by_second)]

    def derivative(self, x: Array) -> Matrix:
        """Return the derivative of the vectors in one state (1, n), shape (3 m, n)."""
        y, z = self.first.at(x)[0], self.second.at(x)[0]
        by_first, by_second = self._blocks(-z) @ self.first.matrix, self._blocks(y) @ self.second.matrix
        return self.linear.matrix + by_first + by_second

    def bend(self, other: Array) -> Matrix:
        """Return the second derivative of their products with vectors (m, 3), shape (n, n)."""
        half = self.first.matrix.T @ self._blocks(-other) @ self.second.matrix
        return half + half.T

    def _blocks(self, vectors: Array) -> Matrix:
        """Return the matrix (3 m, 3 m) from changes to their products with the factors of vectors (m, 3)."""
        places = np.arange(vectors.size).reshape(-1, 3)
        blocks = Entries.of_block(places, places, skew(self.factor * vectors))
        return assemble([blocks], (vectors.size, vectors.size), sparse=True)


class CrossedProducts(VectorProducts[_Side]):
    """Products of such vectors, in sparse matrices."""

    def _side(self, vectors: Sequence[CrossedVector]) -> _Side:
        return _Side.of(vectors, self.n, self.sparse)

    def bias(self, x: Array, u: Array) -> Array:
        """Return its second derivative at zero accelerations, shape (n_batch, m)."""
        (a, b), (da, db), (first, second) = self._vectors(x), self._rates(x, u), self._sides
        parts = 2.0 * da * db + first.bias(u) * b + a * second.bias(u)
        return np.asarray(self._weight * np.sum(parts, axis=-1))

    def stiffness(self, x: Array, multipliers: Array) -> Entries:
        """Return the derivative of Phi_x^T lambda by x in one state (1, n), for multipliers (m,)."""
        (a, b), (first, second) = self._vectors(x), self._sides
        weight = (self._weight * multipliers)[:, None]
        both = first.derivative(x).T @ (second.derivative(x) * np.repeat(weight, 3, axis=0))
        found = (both + both.T + first.bend(weight * b[0]) + second.bend(weight * a[0])).tocoo()
        return Entries(found.row, found.col, found.data)
