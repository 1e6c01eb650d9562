"""Joint equations that are products of vectors: all those of a scene evaluated at once.

In space every vector that joints hold, an axis or the distance of two points, is linear in the coordinates,
and so are section vectors in the plane:
weight (A x + a) . (B x + b) = constant.  The paper's Phi_x and gamma of eq. (37) follow from A and B.
The third axis of a section is the vector product of these two: equations with such axes, of which long chains
have many, are `hfsim.mechanics.crossed.CrossedProducts`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cached_property
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

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
    """One equation: weight first . second = constant; both are `LinearVector`, or both `CrossedVector`."""

    first: Any
    second: Any
    weight: float = 1.0
    constant: float = 0.0


Pull = tuple["LinearMap", Array]
"""Vectors, and what their changes are multiplied with, (n_batch, m, n_dim), for those of the equations."""


@frozen
class LinearMap:
    """Vectors of all equations that are linear in the coordinates.

    Attributes
    ----------
    matrix : Matrix, shape (n_dim m, n)
    offset : ndarray, shape (m, n_dim)
    """

    matrix: Matrix
    offset: Array

    @classmethod
    def of(cls, vectors: Sequence[LinearVector], n: int, sparse: bool) -> LinearMap:
        """Return those of n coordinates, with sparse matrices or dense ones."""
        n_dim = len(vectors[0].offset)
        own, size = np.arange(n_dim), n_dim * len(vectors)
        parts = [Entries.of_block(n_dim * k + own, v.columns, v.matrix) for k, v in enumerate(vectors)]
        return cls(assemble(parts, (size, n), sparse), np.array([v.offset for v in vectors]))

    def at(self, x: Array) -> Array:
        """Return the vectors in states (n_batch, n), shape (n_batch, m, n_dim)."""
        return self.rates(x) + self.offset

    def rates(self, u: Array) -> Array:
        """Return their rates."""
        return product(self.matrix, u.T).T.reshape(len(u), *self.offset.shape)

    def moving(self, x: Array, u: Array) -> Array:
        """Return the same: the state does not matter."""
        return self.rates(u)

    def pulls(self, x: Array, other: Array) -> list[Pull]:
        """Return what changes of the vectors do to the products with vectors (n_batch, m, n_dim)."""
        return [(self, other)]

    def by(self, columns: IntArray) -> Array:
        """Return the matrices by some coordinates, (m, n_dim, k); those asked for last are kept."""
        if self.__dict__.get("_kept_for") is not columns:
            found = dense(self.matrix[:, columns]).reshape(*self.offset.shape, -1)
            self.__dict__.update(_kept_for=columns, _kept=found)
        kept: Array = self.__dict__["_kept"]
        return kept

    @cached_property
    def entries(self) -> tuple[IntArray, IntArray, IntArray, Array]:
        """Equation, component, column and value of all entries."""
        if is_sparse(self.matrix):
            found = self.matrix.tocoo()
            rows, columns, values = found.row, found.col, found.data
        else:
            rows, columns = np.nonzero(self.matrix)
            values = self.matrix[rows, columns]
        return *np.divmod(rows, self.offset.shape[1]), columns, values


class Side(Protocol):
    """One of the vectors of all equations, however it depends on the coordinates."""

    def at(self, x: Array) -> Array:
        """Return the vectors in states (n_batch, n), shape (n_batch, m, n_dim)."""

    def moving(self, x: Array, u: Array) -> Array:
        """Return their rates."""

    def pulls(self, x: Array, other: Array) -> list[Pull]:
        """Return what changes of linear vectors behind them do to the products with vectors like these."""


_Kind = TypeVar("_Kind", bound=Side)


@frozen
class VectorProducts(ABC, Generic[_Kind]):
    """Equations of a scene that are products of vectors.

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

    @abstractmethod
    def _side(self, vectors: Sequence[Any]) -> _Kind:
        """Return one of the vectors of all equations."""

    @cached_property
    def _sides(self) -> tuple[_Kind, _Kind]:
        """Both of them."""
        first, second = zip(*((one.first, one.second) for one in self.equations), strict=True)
        return self._side(first), self._side(second)

    def _vectors(self, x: Array) -> tuple[Array, Array]:
        """Return both vectors of all equations, (n_batch, m, n_dim)."""
        first, second = self._sides
        return first.at(x), second.at(x)

    def _rates(self, x: Array, u: Array) -> tuple[Array, Array]:
        """Return the rates of both."""
        first, second = self._sides
        return first.moving(x, u), second.moving(x, u)

    def _pulls(self, x: Array) -> list[Pull]:
        """Return what changes of the linear vectors behind them do to the equations."""
        (a, b), (first, second), weight = self._vectors(x), self._sides, self._weight[:, None]
        return first.pulls(x, b * weight) + second.pulls(x, a * weight)

    def gap(self, x: Array) -> Array:
        """Return what they miss, shape (n_batch, m)."""
        a, b = self._vectors(x)
        return np.asarray(self._weight * np.sum(a * b, axis=-1) - self._constant)

    def rate(self, x: Array, u: Array) -> Array:
        """Return the rate of that, shape (n_batch, m)."""
        (a, b), (da, db) = self._vectors(x), self._rates(x, u)
        return np.asarray(self._weight * np.sum(da * b + a * db, axis=-1))

    @abstractmethod
    def bias(self, x: Array, u: Array) -> Array:
        """Return its second derivative at zero accelerations, shape (n_batch, m)."""

    def jacobian(self, x: Array, support: IntArray) -> Array:
        """Return Phi_x by some coordinates, dense, shape (n_batch, m, k)."""
        found = [other.swapaxes(0, 1) @ one.by(support) for one, other in self._pulls(x)]
        by_equation = found[0]
        for one in found[1:]:
            by_equation += one
        return by_equation.swapaxes(0, 1)

    def entries(self, x: Array) -> Entries:
        """Return the entries of Phi_x in states (n_batch, n_x), their values (n_batch, n_entries)."""
        return Entries.joined(self._pulled(one, other) for one, other in self._pulls(x))

    def _pulled(self, one: LinearMap, other: Array) -> Entries:
        k, component, columns, values = one.entries
        return Entries(self.rows[k], columns, values * other[:, k, component])

    @abstractmethod
    def stiffness(self, x: Array, multipliers: Array) -> Entries:
        """Return the derivative of Phi_x^T lambda by x in one state (1, n), for multipliers (m,)."""


class Products(VectorProducts[LinearMap]):
    """Products of vectors that are linear in the coordinates."""

    def _side(self, vectors: Sequence[LinearVector]) -> LinearMap:
        return LinearMap.of(vectors, self.n, self.sparse)

    def bias(self, x: Array, u: Array) -> Array:
        """Return its second derivative at zero accelerations, shape (n_batch, m)."""
        da, db = self._rates(x, u)
        return np.asarray(2.0 * self._weight * np.sum(da * db, axis=-1))

    def stiffness(self, x: Array, multipliers: Array) -> Entries:
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
