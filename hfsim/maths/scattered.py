"""Sums of many values in few places, and symmetric matrices that are made of such."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from hfsim.maths.arrays import Array, IntArray, distinct
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import factorised
from hfsim.maths.traced import aside

NARROW = 8.0
"""Width of a band, over entries of a row, up to which its factors take less time than sparse ones."""


@frozen
class ScatteredSums:
    """Sums of values that belong to the same place.

    Attributes
    ----------
    places : ndarray of int, shape (n_values,)
    count : int
        Of places.
    """

    places: IntArray
    count: int

    def of(self, values: Array) -> Array:
        """Return the sums (n_batch, count) of values (n_batch, n_values)."""
        places = self.places + self.count * np.arange(len(values))[:, None]
        sums = np.bincount(places.ravel(), values.ravel(), self.count * len(values))
        return np.reshape(sums, (len(values), self.count)).astype(float, copy=False)


@frozen
class SymmetricSums:
    """Positive definite matrices whose entries are sums of values, with factors of their band or sparse ones.

    Attributes
    ----------
    sums : ScatteredSums
        The entries: of the band below the diagonal, column by column, then of what is above; or of `places`.
    order : ndarray of int, shape (n,)
        Rows as they come in the band; none in sparse matrices.
    places : tuple of ndarray of int, or None
        Rows, and where columns begin and end, of sparse matrices.
    """

    sums: ScatteredSums
    order: IntArray
    places: tuple[IntArray, IntArray] | None = None

    @classmethod
    def of(cls, rows: IntArray, columns: IntArray, n: int) -> SymmetricSums:
        """Return it of values at rows and columns (n_values,) of matrices (n, n)."""
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import reverse_cuthill_mckee

        flat = columns * n + rows
        filled = distinct(flat)
        ends = np.searchsorted(filled, n * np.arange(n + 1))
        places = filled % n, ends
        pattern = csr_array((np.ones(len(filled)), *places), shape=(n, n))
        order = np.asarray(reverse_cuthill_mckee(pattern, symmetric_mode=True), dtype=np.intp)
        turn = np.argsort(order)
        i, j = turn[rows], turn[columns]
        width = int((i - j).max(initial=0)) + 1
        if width * n > NARROW * len(filled):
            return cls(ScatteredSums(np.searchsorted(filled, flat), len(filled)), order[:0], places)
        # what is above the diagonal goes to a place of its own, behind the others
        return cls(ScatteredSums(np.where(i >= j, j * width + i - j, n * width), n * width + 1), order)

    def factorised(self, values: Array) -> Callable[[Array], Array]:
        """Return the map from right-hand sides (n_batch, n) to solutions, by values (n_batch, n_values).

        Raises
        ------
        numpy.linalg.LinAlgError
            If a matrix is singular.
        """
        return _Factorised(self, self.sums.of(values))


class _Factorised:
    """Matrices of a batch by their factors, which a tape makes anew by a call of Python."""

    def __init__(self, kind: SymmetricSums, entries: Array) -> None:
        self._factorise = _band if kind.places is None else _sparse
        self._kind, self._there = kind, np.zeros(1)
        self._solve: Sequence[Callable[[Array], Array]] = ()
        aside(self._take, entries, self._there)

    def _take(self, entries: Array, there: Array) -> None:
        self._solve = [self._factorise(self._kind, own) for own in entries]

    def __call__(self, rhs: Array) -> Array:
        found = np.zeros(rhs.shape)
        aside(self._write, self._there, rhs, found)
        return found

    def _write(self, there: Array, rhs: Array, found: Array) -> None:
        for solve, own, result in zip(self._solve, rhs, found, strict=True):
            result[...] = solve(own)


def _sparse(kind: SymmetricSums, entries: Array) -> Callable[[Array], Array]:
    from scipy.sparse import csc_array

    assert kind.places is not None
    n = len(kind.places[1]) - 1
    return factorised(csc_array((entries, *kind.places), shape=(n, n)))


def _band(kind: SymmetricSums, entries: Array) -> Callable[[Array], Array]:
    from scipy.linalg.lapack import dpbtrf, dpbtrs

    factors, info = dpbtrf(entries[:-1].reshape(len(kind.order), -1).T, lower=1)
    if info:
        raise np.linalg.LinAlgError("matrix is not positive definite")

    def solve(rhs: Array) -> Array:
        found = np.empty_like(rhs)
        found[kind.order] = dpbtrs(factors, rhs[kind.order], lower=1)[0]
        return found

    return solve
