"""Joints that are solved beforehand: the coordinates they determine are left out of the equations.

Where a joint ties coordinates linearly, x = B z + x0 holds with a constant B, and z, the *free*
coordinates, need no multipliers: a pin at the ground takes away two coordinates, a hinge between two
beams makes them share a node, a clamped root keeps only its stretch.  The columns of B are orthogonal.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array, BoolArray, IntArray
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries, Matrix, assemble, is_sparse


@frozen
class Reduction:
    """The map x = B z + x0 from free coordinates.

    Attributes
    ----------
    basis : Matrix, shape (n_x, n_z)
        B.
    offset : ndarray, shape (n_x,)
        x0.
    eliminated : frozenset of int
        Constraints of the system that hold by themselves.
    stretches : ndarray of int
        Free coordinates that are lengths of clamped slopes: they hold their direction while positive.
    rows : ndarray of int, shape (n_z,)
        The coordinate that each free one stands for, in ascending order.
    """

    basis: Matrix
    offset: Array
    eliminated: frozenset[int]
    stretches: IntArray
    rows: IntArray

    @classmethod
    def nothing(cls, n: int, sparse: bool) -> Reduction:
        """Return the reduction that keeps all of n coordinates, with dense or sparse matrices."""
        every = np.arange(n)
        basis = assemble([Entries(every, every, np.ones(n))], (n, n), sparse)
        return cls(basis, np.zeros(n), frozenset(), np.zeros(0, dtype=np.intp), every)

    @cached_property
    def numbers(self) -> IntArray:
        """Which free coordinate stands for each one, (n_x,); -1 where none does."""
        found = np.full(len(self.offset), -1)
        found[self.rows] = np.arange(len(self.rows))
        return found

    def part(self, free: BoolArray, z: Array) -> Reduction:
        """Return the map from some of the free coordinates, the others being held at those of z (1, n_z)."""
        held = self.expand(np.where(free, 0.0, z))[0]
        number = np.cumsum(free) - 1
        stretches = number[self.stretches[free[self.stretches]]]
        return Reduction(self.basis[:, free], held, self.eliminated, stretches, self.rows[free])

    @cached_property
    def identity(self) -> bool:
        """Whether nothing is left out."""
        return bool(self.basis.shape[0] == self.basis.shape[1])

    @cached_property
    def _transposed(self) -> Matrix:
        return np.ascontiguousarray(self.basis.T) if not is_sparse(self.basis) else self.basis.T.tocsr()

    @cached_property
    def _inverse(self) -> Matrix:
        """B (B^T B)^-1, with which free coordinates are read off: z = (x - x0) @ this."""
        sizes = np.asarray((self.basis * self.basis).sum(axis=0)).ravel()
        if is_sparse(self.basis):
            from scipy.sparse import diags_array

            return (self.basis @ diags_array(1.0 / sizes)).tocsr()
        return self.basis / sizes

    def expand(self, z: Array) -> Array:
        """Return coordinates, shape (n_batch, n_x)."""
        return z if self.identity else np.asarray(z @ self._transposed + self.offset)

    def expand_rates(self, w: Array) -> Array:
        """Return rates or small changes of the coordinates."""
        return w if self.identity else np.asarray(w @ self._transposed)

    def free(self, x: Array) -> Array:
        """Return the free coordinates of x."""
        return x if self.identity else np.asarray((x - self.offset) @ self._inverse)

    def free_rates(self, u: Array) -> Array:
        """Return the free part of rates or small changes."""
        return u if self.identity else np.asarray(u @ self._inverse)

    def free_columns(self, columns: slice) -> slice:
        """Return where coordinates of x that stand side by side, and on which no joint bears, stand in z."""
        first = int(np.searchsorted(self.rows, columns.start))
        return slice(first, first + columns.stop - columns.start)

    def keeps(self, columns: slice, free: slice) -> bool:
        """Tell whether coordinates are free ones themselves, and nothing else depends on these."""
        B, n = self.basis, columns.stop - columns.start
        alone = np.count_nonzero(B[columns]) == np.count_nonzero(B[:, free]) == n
        return alone and bool(np.array_equal(B[columns, free], np.eye(n)))

    def free_force(self, f: Array) -> Array:
        """Return the generalised forces on the free coordinates, f B."""
        return f if self.identity else np.asarray(f @ self.basis)

    def read_force(self, f: Array) -> Array:
        """Return forces on x that do the work of those on free coordinates: the transpose of `free_rates`."""
        return f if self.identity else np.asarray(f @ self.reading)

    @cached_property
    def reading(self) -> Matrix:
        """The matrix (n_z, n_x) of `free_rates`."""
        return self._inverse.T.tocsr() if is_sparse(self.basis) else np.ascontiguousarray(self._inverse.T)

    @cached_property
    def _sources(self) -> tuple[IntArray, Array]:
        """The free coordinate that each coordinate follows from, and its factor; zero where from none."""
        rows, columns = self.basis.nonzero()
        sources, factors = np.zeros(self.basis.shape[0], dtype=np.intp), np.zeros(self.basis.shape[0])
        sources[rows], factors[rows] = columns, self.basis[rows, columns]
        return sources, factors

    def free_entries(self, entries: Entries) -> Entries:
        """Return the entries of A B, sparse, from those of A: each coordinate follows from one at most."""
        if self.identity:
            return entries
        sources, factors = self._sources
        values = entries.values * factors[entries.columns]
        return Entries(entries.rows, sources[entries.columns], values)

    def reduced(self, matrix: Matrix) -> Matrix:
        """Return B^T A B."""
        return matrix if self.identity else self._transposed @ (matrix @ self.basis)
