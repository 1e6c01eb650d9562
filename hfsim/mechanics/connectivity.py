"""Combinations of the coordinates: the vectors of many alike parts, gathered and scattered at once."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array, IntArray, component_rows
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries, Matrix, assemble, is_sparse
from hfsim.maths.traced import product


@frozen
class Connectivity:
    """How the difference vectors of elements follow from the coordinates of a scene.

    Attributes
    ----------
    n : int
        Number of coordinates.
    columns : ndarray of int, shape (n_elements, k)
        Coordinates of each element.
    local : ndarray, shape (n_elements, n_vectors * n_dim, k)
        From them to its difference vectors.
    n_dim : int
        Of space.
    """

    n: int
    columns: IntArray
    local: Array
    n_dim: int = 2

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of elements, of difference vectors of each, and of their components."""
        return len(self.columns), self.local.shape[1] // self.n_dim, self.n_dim

    @cached_property
    def gather(self) -> Matrix:
        """From coordinates to the difference vectors, component by component: ``gather @ x.T``."""
        count, m, _ = self.local.shape
        vectors = np.arange(count * m).reshape(m, count).T
        entries = Entries.of_block(vectors, self.columns, self.local)
        kept = entries.values != 0.0
        return assemble([Entries(*(kind[kept] for kind in entries))], (count * m, self.n))

    @cached_property
    def scatter(self) -> Matrix:
        """From derivatives by difference vectors to those by coordinates, their transpose."""
        return self.gather.T.tocsr() if is_sparse(self.gather) else np.ascontiguousarray(self.gather.T)

    def rows(self, x: Array) -> Array:
        """Return difference vectors as rows of equal components, (n_vectors, n_dim, n_elements * n_batch)."""
        return product(self.gather, x.T).reshape(self._kinds)

    def push(self, rows: Array, n_batch: int) -> Array:
        """Return derivatives by the coordinates, shape (n_batch, n), from those by rows of vectors."""
        return product(self.scatter, rows.reshape(-1, n_batch)).T

    @cached_property
    def _kinds(self) -> tuple[int, int, int]:
        return self.shape[1], self.shape[2], -1

    def vectors(self, x: Array) -> Array:
        """Return the difference vectors, shape (n_batch, n_elements, n_vectors, n_dim)."""
        rows = self.rows(x).reshape(*self.shape[1:], self.shape[0], len(x))
        return np.ascontiguousarray(rows.transpose(3, 2, 0, 1))

    def force(self, gradient: Array) -> Array:
        """Return derivatives by the coordinates, shape (n_batch, n), from those by difference vectors."""
        return self.push(component_rows(gradient), len(gradient))

    def entries(self, blocks: Array) -> Entries:
        """Return second derivatives by the coordinates from those by the vectors, (n_elements, m, m)."""
        return Entries(*self._places, (self._local_transposed @ blocks @ self.local).ravel())

    @cached_property
    def _local_transposed(self) -> Array:
        return np.ascontiguousarray(self.local.swapaxes(1, 2))

    @cached_property
    def _places(self) -> tuple[IntArray, IntArray]:
        """Rows and columns of all entries of the elements' matrices."""
        k = self.columns.shape[1]
        nothing = Entries.of_block(self.columns, self.columns, np.zeros((len(self.columns), k, k)))
        return nothing.rows, nothing.columns

    def joined(self, other: Connectivity) -> Connectivity:
        """Return the connectivity of these elements followed by others of the same kind."""
        columns = np.concatenate([self.columns, other.columns])
        return Connectivity(self.n, columns, np.concatenate([self.local, other.local]), self.n_dim)

