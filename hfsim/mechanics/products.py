"""Joint equations that are products of vectors: all those of a scene evaluated at once.

In space every vector that joints hold, an axis or the distance of two points, is linear in the coordinates,
and so are section vectors in the plane:
weight (A x + a) . (B x + b) = constant.  The paper's Phi_x and gamma of eq. (37) follow from A and B.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries, Matrix, assemble, dense, is_sparse
from hfsim.maths.traced import product


class LinearVector(NamedTuple):
    """A vector that is linear in some coordinates: matrix @ x[columns] + offset.

    Attributes
    ----------
    columns : ndarray of int, shape (k,)
    matrix : ndarray, shape (n_dim, k)
    offset : ndarray, shape (n_dim,)
    """

    columns: IntArray
    matrix: Array
    offset: Array

    @classmethod
    def constant(cls, value: Array) -> LinearVector:
        """Return a vector (n_dim,) that depends on no coordinates."""
        return cls(np.zeros(0, dtype=np.intp), np.zeros((len(value), 0)), value)

    @classmethod
    def at(cls, columns: IntArray) -> LinearVector:
        """Return the vector that coordinates (n_dim,) are."""
        return cls(columns, np.eye(len(columns)), np.zeros(len(columns)))

    def minus(self, other: LinearVector) -> LinearVector:
        """Return the difference of two vectors of different coordinates."""
        columns = np.concatenate([self.columns, other.columns])
        matrix = np.concatenate([self.matrix, -other.matrix], axis=1)
        return LinearVector(columns, matrix, self.offset - other.offset)


class Product(NamedTuple):
    """One equation: weight first . second = constant."""

    first: LinearVector
    second: LinearVector
    weight: float = 1.0
    constant: float = 0.0


@frozen
class Products:
    """Equations of a scene that are products.

    Attributes
    ----------
    rows : ndarray of int, shape (m,)
        Which rows of Phi they are.
    n : int
        Number of coordinates.
    sparse : bool
        Whether the scene has sparse matrices.
    """

    rows: IntArray
    equations: Sequence[Product]
    n: int
    sparse: bool

    def __len__(self) -> int:
        """Return their number."""
        return len(self.equations)

    @cached_property
    def _weight(self) -> Array:
        return np.array([one.weight for one in self.equations])

    @cached_property
    def _constant(self) -> Array:
        return np.array([one.constant for one in self.equations])

    @cached_property
    def _n_dim(self) -> int:
        return len(self.equations[0].first.offset)

    @cached_property
    def _maps(self) -> tuple[tuple[Matrix, Array], tuple[Matrix, Array]]:
        """From coordinates to both vectors of all equations, (n_dim m, n), and constant parts, (m, n_dim)."""
        return self._map(0), self._map(1)

    def _map(self, side: int) -> tuple[Matrix, Array]:
        vectors = [(one.first, one.second)[side] for one in self.equations]
        own, n_dim = np.arange(self._n_dim), self._n_dim
        parts = [Entries.of_block(n_dim * k + own, v.columns, v.matrix) for k, v in enumerate(vectors)]
        matrix = assemble(parts, (n_dim * len(self), self.n), self.sparse)
        return matrix, np.array([v.offset for v in vectors])

    def _vectors(self, x: Array) -> tuple[Array, Array]:
        (A, a), (B, b) = self._maps
        shape = (len(x), len(self), self._n_dim)
        return product(A, x.T).T.reshape(shape) + a, product(B, x.T).T.reshape(shape) + b

    def _rates(self, u: Array) -> tuple[Array, Array]:
        (A, _), (B, _) = self._maps
        shape = (len(u), len(self), self._n_dim)
        return product(A, u.T).T.reshape(shape), product(B, u.T).T.reshape(shape)

    def gap(self, x: Array) -> Array:
        """Return what they miss, shape (n_batch, m)."""
        a, b = self._vectors(x)
        return np.asarray(self._weight * np.sum(a * b, axis=-1) - self._constant)

    def rate(self, x: Array, u: Array) -> Array:
        """Return the rate of that, shape (n_batch, m)."""
        (a, b), (da, db) = self._vectors(x), self._rates(u)
        return np.asarray(self._weight * np.sum(da * b + a * db, axis=-1))

    def bias(self, u: Array) -> Array:
        """Return its second derivative at zero accelerations, shape (n_batch, m)."""
        da, db = self._rates(u)
        return np.asarray(2.0 * self._weight * np.sum(da * db, axis=-1))

    def jacobian(self, x: Array, support: IntArray) -> Array:
        """Return Phi_x by some coordinates, dense, shape (n_batch, m, k)."""
        a, b = self._vectors(x)
        first, second = self._dense(support)
        by_equation = (b * self._weight[:, None]).swapaxes(0, 1) @ first
        by_equation += (a * self._weight[:, None]).swapaxes(0, 1) @ second
        return by_equation.swapaxes(0, 1)

    def _dense(self, support: IntArray) -> tuple[Array, Array]:
        """Return both maps from some coordinates, (m, n_dim, k); those asked for last are kept."""
        if self.__dict__.get("_kept_for") is not support:
            maps = tuple(dense(one[:, support]).reshape(len(self), self._n_dim, -1) for one, _ in self._maps)
            self.__dict__.update(_kept_for=support, _kept=maps)
        first, second = self.__dict__["_kept"]
        return first, second

    def entries(self, x: Array) -> Entries:
        """Return the entries of Phi_x in states (n_batch, n_x), their values (n_batch, n_entries)."""
        a, b = self._vectors(x)
        return Entries.joined([self._pulled(0, b), self._pulled(1, a)])

    def _pulled(self, side: int, other: Array) -> Entries:
        matrix = self._maps[side][0]
        found = matrix.tocoo() if is_sparse(matrix) else None
        rows, columns = (found.row, found.col) if found is not None else np.nonzero(matrix)
        values = found.data if found is not None else matrix[rows, columns]
        k, component = np.divmod(rows, self._n_dim)
        return Entries(self.rows[k], columns, values * self._weight[k] * other[:, k, component])

    def stiffness(self, multipliers: Array) -> Entries:
        """Return the derivative of Phi_x^T lambda by x, the same in every state, for multipliers (m,)."""
        which, entries = self._blocks
        return entries._replace(values=entries.values * multipliers[which])

    def bend(self) -> Array:
        """Return the derivative of Phi_x, the same in every state, dense, shape (m, n, n)."""
        which, entries = self._blocks
        bend = np.zeros((len(self), self.n, self.n))
        np.add.at(bend, (which, entries.rows, entries.columns), entries.values)
        return bend

    @cached_property
    def _blocks(self) -> tuple[IntArray, Entries]:
        """Entries of weight (A^T B + B^T A) of each equation, and the equation of each entry."""
        parts: list[Entries] = []
        sizes: list[int] = []
        for a, b, weight, _ in self.equations:
            block = weight * (a.matrix.T @ b.matrix)
            parts.append(Entries.of_block(a.columns, b.columns, block))
            parts.append(Entries.of_block(b.columns, a.columns, block.T))
            sizes.append(2 * block.size)
        return np.repeat(np.arange(len(sizes)), sizes), Entries.joined(parts)
