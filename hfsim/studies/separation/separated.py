"""The separated stiffness, eq. (39)-(41), and what need be computed of it only once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hfsim.deck.materials import BeamProperties
from hfsim.maths.arrays import Array, IntArray
from hfsim.parts.elements import Element
from hfsim.parts.elements._base import QuadraticMap
from hfsim.studies.separation._base import StiffnessForm, StrainTable, times

_FEW = 64
"""Columns up to which calls cost more than operations."""


def _alike(rows: Array) -> tuple[IntArray, IntArray]:
    """Return a row of each kind of equal rows, and the kind of each row; equal to round-off."""
    kinds = np.round(rows / (np.abs(rows).max(axis=0) + np.finfo(float).tiny), 12)
    _, first, kind = np.unique(kinds, axis=0, return_index=True, return_inverse=True)
    return first, kind.ravel()


@dataclass(frozen=True)
class _Distinct:
    """What differs among the entries of K: equal ones need computing once, vanishing ones never.

    Attributes
    ----------
    factors : ndarray of int, shape (2 * n_products + most in a row * n,)
        Rows of p that are multiplied: both factors of the products, and p_b for the entries of K.
    matrix : ndarray, shape (n_distinct, n_products / together)
    constant : ndarray, shape (n_distinct, 1)
    entry : ndarray of int, shape (most in a row * n,)
        Of the k-th entry of each row of K that does not vanish, the number among the distinct ones.
    together : int
        Products that enter K with the same factor, as those of equal components do; they stand in so
        many blocks.
    """

    factors: IntArray
    matrix: Array
    constant: Array
    entry: IntArray
    together: int

    @classmethod
    def of(cls, first: IntArray, second: IntArray, matrix: Array, constant: Array) -> _Distinct:
        """Return what differs of the entries matrix^T (products) + constant of a square K."""
        n = round(math.sqrt(len(constant)))
        whole = np.concatenate([matrix, constant[None]])
        where, kind = _alike(whole.T)
        there = np.any(whole != 0.0, axis=0).reshape(n, n)
        column = np.argsort(~there, axis=1, kind="stable")[:, : there.sum(axis=1).max()]
        used, entry = np.unique(np.take_along_axis(kind.reshape(n, n), column, axis=1), return_inverse=True)
        where = where[used]
        group = _alike(matrix)[1]
        together = int(np.gcd.reduce(np.bincount(group)))
        order = np.argsort(group, kind="stable").reshape(-1, together).T.ravel()
        once = order[: len(order) // together]
        return cls(
            factors=np.concatenate([first[order], second[order], column.T.ravel()]),
            matrix=np.ascontiguousarray(matrix[np.ix_(once, where)].T),
            constant=constant[where, None],
            entry=entry.reshape(n, -1).T.ravel(),
            together=together,
        )

    @cached_property
    def _spread(self) -> Array:
        """The matrix over all products: with few columns one call less counts for more."""
        return np.tile(self.matrix, self.together)

    def force(self, p: Array) -> Array:
        """Return K p, shape (n, n_columns)."""
        factors, size = p.take(self.factors, axis=0), self.together * self.matrix.shape[1]
        products = factors[:size]
        products *= factors[size : 2 * size]
        if self.together > 1 and p.shape[1] > _FEW:
            products = np.add.reduce(products.reshape(self.together, -1, p.shape[1]), axis=0)
            K = self.matrix.dot(products)
        else:
            K = self._spread.dot(products)
        K += self.constant
        pull = factors[2 * size :]
        pull *= K.take(self.entry, axis=0)
        return np.asarray(np.add.reduce(pull.reshape(-1, *p.shape), axis=0))


@dataclass(frozen=True)
class SeparatedStiffness(StiffnessForm):
    """K(a, b) = p^T C_ab p + c_ab with matrices computed once, eq. (39)-(41).

    Attributes
    ----------
    C : ndarray, shape (n, n, n, n)
        C[a, b] is the matrix C_ab of eq. (40).
    c : ndarray, shape (n, n)
        c_ab of eq. (41).
    """

    C: Array
    c: Array

    @classmethod
    def of(cls, element: Element, properties: BeamProperties, n_dim: int = 2) -> SeparatedStiffness:
        """Return the separated form of an element in plane or space."""
        table = StrainTable.of(element, properties, n_dim)
        weighted = 0.5 * np.einsum("rs,g,sgab->rgab", table.elasticity, table.weights, table.strains())
        c = table.constant - np.einsum("r,rgab->ab", table.unit, weighted)
        C = np.tensordot(weighted, table.products(), axes=([0, 1], [0, 1]))
        return cls(C, c)

    @cached_property
    def _entries(self) -> QuadraticMap:
        """From p to the entries of K; p^T C_ab p needs each product p_c p_d once."""
        n = len(self.c)
        return QuadraticMap.of(self.C.reshape(n * n, n, n).transpose(1, 2, 0), self.c.ravel())

    @cached_property
    def _distinct(self) -> _Distinct:
        full = self._entries
        return _Distinct.of(full.first, full.second, full.matrix, full.constant)

    @cached_property
    def _both(self) -> QuadraticMap:
        """From p to the entries of K and of d(K p)/dp, which adds (C_ab + C_ab^T) p p_b in column c."""
        n = len(self.c)
        change = (self.C + self.C.swapaxes(2, 3)).transpose(1, 3, 0, 2)
        entries = self.C.transpose(2, 3, 0, 1)
        full = np.concatenate([m.reshape(n, n, n * n) for m in (entries, entries + change)], axis=-1)
        return QuadraticMap.of(full, np.tile(self.c.ravel(), 2))

    def stiffness(self, p: Array) -> Array:
        """Return K, shape (n_columns, n, n)."""
        return self._entries(p.T).reshape(-1, len(p), len(p))

    def force(self, p: Array) -> Array:
        """Return K p, shape (n, n_columns)."""
        return self._distinct.force(p)

    def force_and_tangent(self, p: Array) -> tuple[Array, Array]:
        """Return force and tangent."""
        p = np.ascontiguousarray(p.T)
        both = self._both(p).reshape(len(p), 2, *self.c.shape)
        return times(both[:, 0], p).T, both[:, 1]
