"""Sums of many values in few places, and symmetric matrices that are made of such."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TypeAlias

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import SamePlaces, factorised
from hfsim.maths.traced import aside

Solve: TypeAlias = Callable[[Array], Array]
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
    factorise : callable
        From the band of one matrix, or its values, to the map from right-hand sides (n,) to solutions.
    band : ScatteredSums or None
        Entries below the diagonal, column by column, then the sum of those above; None of sparse ones.
    """

    factorise: Callable[[Array], Solve]
    band: ScatteredSums | None = None

    @classmethod
    def of(cls, rows: IntArray, columns: IntArray, n: int) -> SymmetricSums:
        """Return it of values at rows and columns (n_values,) of matrices (n, n)."""
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import reverse_cuthill_mckee

        pattern = csr_array((np.ones(len(rows)), (rows, columns)), shape=(n, n))
        order = np.asarray(reverse_cuthill_mckee(pattern, symmetric_mode=True), dtype=np.intp)
        turn = np.argsort(order)
        i, j = turn[rows], turn[columns]
        width = int((i - j).max(initial=0)) + 1
        if width * n > NARROW * pattern.nnz:
            return cls(partial(_sparse, SamePlaces(rows, columns, (n, n))))
        # what is above the diagonal goes to a place of its own, behind the others
        places = np.where(i >= j, j * width + i - j, n * width)
        return cls(partial(_band, order), ScatteredSums(places, n * width + 1))

    def factorised(self, values: Array) -> Solve:
        """Return the map from right-hand sides (n_batch, n) to solutions, by values (n_batch, n_values).

        Raises
        ------
        numpy.linalg.LinAlgError
            If a matrix is singular.
        """
        return _Factorised(self.factorise, values if self.band is None else self.band.of(values))


class _Factorised:
    """Matrices of a batch by their factors, which a tape makes anew by a call of Python."""

    def __init__(self, factorise: Callable[[Array], Solve], entries: Array) -> None:
        self._factorise, self._there = factorise, np.zeros(1)
        self._solve: Sequence[Solve] = ()
        aside(self._take, entries, self._there)

    def _take(self, entries: Array, there: Array) -> None:
        self._solve = [self._factorise(own) for own in entries]

    def __call__(self, rhs: Array) -> Array:
        found = np.zeros(rhs.shape)
        aside(self._write, self._there, rhs, found)
        return found

    def _write(self, there: Array, rhs: Array, found: Array) -> None:
        for solve, own, result in zip(self._solve, rhs, found, strict=True):
            result[...] = solve(own)


def _sparse(places: SamePlaces, values: Array) -> Solve:
    return factorised(places.of(values[None]))


def _band(order: IntArray, entries: Array) -> Solve:
    from scipy.linalg.lapack import dpbtrf, dpbtrs

    factors, info = dpbtrf(entries[:-1].reshape(len(order), -1).T, lower=1)
    if info:
        raise np.linalg.LinAlgError("matrix is not positive definite")

    def solve(rhs: Array) -> Array:
        found = np.empty_like(rhs)
        found[order] = dpbtrs(factors, rhs[order], lower=1)[0]
        return found

    return solve
