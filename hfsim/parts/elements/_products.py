"""Tables of the products of vectors: what laws of one form have in common, made once for all scenes."""

from __future__ import annotations

from functools import lru_cache
from math import isqrt

import numpy as np

from hfsim.maths.arrays import Array, IntArray

FORMS = 8
"""Tables that are kept, of each kind: large ones take some megabytes."""


@lru_cache(maxsize=FORMS)
def pairs(n: int) -> tuple[IntArray, IntArray]:
    """Return the two of n vectors in each product; each pair once."""
    return np.triu_indices(n)


@lru_cache(maxsize=FORMS)
def packed(n: int) -> IntArray:
    """Return which of the pairs each entry of G is, entries in a row."""
    first, second = pairs(n)
    where = np.zeros((n, n), dtype=np.intp)
    where[first, second] = where[second, first] = np.arange(len(first))
    return where.ravel()


@lru_cache(maxsize=FORMS)
def factors(n: int, n_dim: int) -> tuple[tuple[IntArray, IntArray], tuple[IntArray, IntArray]]:
    """Return what is multiplied, by `row_products`.

    Rows of components, first and second factors of G_ab, pairs of vectors one after another for each
    component; then those of V_b and the pairs of H_ab in the sums H_ab V_b, for each b.
    """
    component = np.arange(n_dim)[:, None]
    first, second = ((n_dim * vectors + component).ravel() for vectors in pairs(n))
    pulled = np.broadcast_to(np.arange(n * n_dim).reshape(n, 1, n_dim), (n, n, n_dim)).reshape(n, -1)
    return (first, second), (pulled, np.repeat(packed(n), n_dim).reshape(n, -1))


def by_pairs(quadratic: Array, n_dim: int) -> Array:
    """Return C g from products of components, by pairs, shape (n_pairs, n_dim * n_pairs)."""
    return _by_pairs(quadratic.tobytes(), len(quadratic), n_dim)


@lru_cache(maxsize=FORMS)
def _by_pairs(form: bytes, size: int, n_dim: int) -> Array:
    quadratic, n = np.frombuffer(form).reshape(size, size), isqrt(size)
    first, second = pairs(n)
    entries = first * n + second
    return np.tile(quadratic[np.ix_(entries, entries)] * np.where(first == second, 1.0, 2.0), n_dim)


def curvature(quadratic: Array, n_dim: int) -> tuple[IntArray, IntArray, Array]:
    """Return h_ac delta_ij + 2 sum_bd C_abcd V_bi V_dj, but for its constant part, by products of components.

    Returns
    -------
    first, second : ndarray of int, shape (n_products,)
        The components V_bk and V_dl that are multiplied; each pair once.
    matrix : ndarray, shape (n_products, (n_vectors * n_dim)**2)
        From these products to entries (ai, cj).
    """
    return _curvature(quadratic.tobytes(), len(quadratic), n_dim)


@lru_cache(maxsize=FORMS)
def _curvature(form: bytes, size: int, n_dim: int) -> tuple[IntArray, IntArray, Array]:
    n, unit = isqrt(size), np.eye(n_dim)
    C = np.frombuffer(form).reshape(n, n, n, n)
    material = 2.0 * np.einsum("abcd,ik,jl->bkdlaicj", C, unit, unit)
    geometric = np.einsum("bdac,kl,ij->bkdlaicj", C, unit, unit)
    return symmetric((material + geometric).reshape(n * n_dim, n * n_dim, -1))


def symmetric(full: Array) -> tuple[IntArray, IntArray, Array]:
    """Return which components are multiplied, and factors of their products, from full[c, d] of x_c x_d."""
    first, second = pairs(len(full))
    matrix = full[first, second]
    off = first != second
    matrix[off] += full[second[off], first[off]]
    used = matrix.any(axis=1)
    return first[used], second[used], np.ascontiguousarray(matrix[used])
