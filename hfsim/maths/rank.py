"""Rank of joint equations: which joints depend on one another, by the null vectors of their Jacobian."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.matrices import DENSE_UP_TO, Entries, Matrix, assemble, factorised, is_sparse

LOST = 1e-9
"""Singular value over the largest below which rows count as dependent."""
SHIFT, FLOOR = 1e-8, 1e-14
"""Sizes of the blocks on the diagonal beside rows of unit length: what they hide is below `LOST`."""
SWEEPS = 3
"""Inverse iterations: each parts dependent rows from others by far more than a factor of 1e3."""
BLOCK = 4
"""Null vectors that are looked for at first."""


MOST_ENTRIES = 5e7
"""Of a dense matrix with more rows than columns: 0.4 GB."""


class Dependence(NamedTuple):
    """How near rows of a constraint Jacobian are to depending on one another.

    Attributes
    ----------
    missing : int
        Rows too many.
    size : float
        Smallest singular value over the largest, of rows of unit length.
    joints : tuple of str
        Joints whose rows make up the left null vectors, or that of the smallest singular value.
    """

    missing: int
    size: float
    joints: tuple[str, ...]


def dependence(
    Phi_x: Matrix, rows: Sequence[slice], joints: Mapping[str, Sequence[int]], share: float = 1e-6
) -> Dependence:
    """Measure the dependence of joint equations in one state.

    Parameters
    ----------
    Phi_x : Matrix, shape (n_rows, n)
    rows : sequence of slice
        Rows of each constraint.
    joints : mapping of str to sequence of int
        Constraints of each joint.
    share : float
        Component of a null vector, over the largest one, from which a joint takes part.
    """
    if not Phi_x.shape[0]:
        return Dependence(0, 1.0, ())
    unit = _touched(Phi_x)
    if unit.shape[0] > unit.shape[1] + BLOCK and unit.shape[0] * unit.shape[1] <= MOST_ENTRIES:
        sizes: Array = np.zeros(1)
        missing, weight = _too_many(unit)
    else:
        left, sizes = _weakest(unit)
        missing = int(np.sum(sizes <= LOST))
        weight = np.abs(left[:, : max(missing, 1)]).max(axis=1)
    least = share * weight.max(initial=0.0)
    involved = (n for n, members in joints.items() if any((weight[rows[k]] > least).any() for k in members))
    return Dependence(missing, float(sizes[0]), tuple(involved))


def by_joint(Phi_x: Matrix, rows: Sequence[slice], joints: Mapping[str, Sequence[int]]) -> Matrix:
    """Return joint equations that block the same with rows of each joint that are orthonormal.

    Rows of one joint come near one another where it has a long arm, as of what has slid far: that is how it
    is written, and nothing else blocks what it does.  Parameters are those of `dependence`.
    """
    every = np.arange(Phi_x.shape[0])
    unit, others, parts = _unit(Phi_x), np.ones(len(every)), list[Entries]()
    for members in filter(None, joints.values()):
        own = np.concatenate([every[rows[k]] for k in members])
        left, sizes, _ = np.linalg.svd(_touched(unit[own]), full_matrices=False)
        kept = sizes > LOST * sizes.max(initial=0.0)
        parts.append(Entries.of_block(own[: kept.sum()], own, (left[:, kept] / sizes[kept]).T))
        others[own] = 0.0
    mixed = assemble([Entries(every, every, others), *parts], (len(every), len(every)), is_sparse(unit))
    return mixed @ unit


def null_space(rows: Array, largest: float | None = None) -> Array:
    """Return an orthonormal basis, as columns (n, k), of what rows (m, n) are zero for.

    Singular values count as zero relative to a largest one: that of the rows unless it is stated.
    """
    _, sizes, right = np.linalg.svd(rows, full_matrices=True)
    size = sizes.max(initial=0.0) if largest is None else largest
    return np.asarray(right[int(np.sum(sizes > LOST * size)) :].T)


def others_than(some: Array, rows: Array) -> Array:
    """Return combinations (m - k, n) of rows (m, n) at right angles to some (m, k), all of unit length.

    By a block reflection (Schreiber and Parlett 1988): in k products of the rows, not m as by a basis of all
    that is left.
    """
    k = some.shape[1]
    left, _, right = np.linalg.svd(some[:k])
    mirror = some.copy()
    mirror[:k] += left @ right
    across = np.linalg.solve(0.5 * mirror.T @ mirror, mirror.T @ rows)
    return np.asarray(rows[k:] - mirror[k:] @ across)


def spanning(vectors: Array) -> IntArray:
    """Return the numbers of vectors, of (n, k), that span what all of them do."""
    from scipy.linalg import qr

    _, left, order = qr(vectors.T, mode="economic", pivoting=True)
    sizes = np.abs(np.diagonal(left))
    return np.asarray(order[: np.count_nonzero(sizes > LOST * sizes[0])])


def _unit(Phi_x: Matrix) -> Matrix:
    """Return rows of unit length."""
    if is_sparse(Phi_x):
        lengths = np.sqrt(Phi_x.power(2).sum(axis=1))
        return Phi_x.multiply(1.0 / np.maximum(lengths, 1e-300)[:, None]).tocsr()
    return Phi_x / np.maximum(np.linalg.norm(Phi_x, axis=1, keepdims=True), 1e-300)


def _touched(Phi_x: Matrix) -> Matrix:
    """Return rows of unit length and only those columns that are not zero; sparse if there are many rows."""
    unit = _unit(Phi_x)
    if is_sparse(unit):
        unit = unit.tocsc()
        unit = unit[:, np.flatnonzero(np.diff(unit.indptr))]
        return unit if unit.shape[0] > DENSE_UP_TO else unit.toarray()
    return unit[:, unit.any(axis=0)]


def _too_many(unit: Matrix) -> tuple[int, Array]:
    """Return how many rows, of more than columns, are too many, and how large each is in null vectors."""
    rows = unit.toarray() if is_sparse(unit) else unit
    left, sizes, _ = np.linalg.svd(rows, full_matrices=False)
    kept = left[:, sizes > LOST * sizes.max(initial=_NONE)]
    return len(rows) - kept.shape[1], np.sqrt(np.maximum(0.0, 1.0 - np.sum(kept * kept, axis=1)))


def _weakest(unit: Matrix) -> tuple[Array, Array]:
    """Return left singular vectors (n_rows, k) and their values over the largest (k,), from the smallest on.

    All vectors that count as null are among them, and one more if there is.
    """
    if is_sparse(unit):
        return _by_factors(unit)
    left, sizes = _decomposed(unit)
    return left, sizes / max(sizes[-1], 1e-300)


def _decomposed(unit: Array) -> tuple[Array, Array]:
    """Return all left singular vectors and their values, zeros included, from the smallest on."""
    n_rows, n = unit.shape
    left, sizes, _ = np.linalg.svd(unit, full_matrices=n_rows > n)
    return left[:, ::-1], np.concatenate([np.zeros(n_rows - len(sizes)), sizes[::-1]])


def _by_factors(unit: Matrix) -> tuple[Array, Array]:
    """Find the weakest vectors by inverse iteration with (J J^T)^-1, never forming J J^T."""
    from scipy.sparse import block_array, eye_array

    n_rows, n = unit.shape
    solve = factorised(block_array([[SHIFT * eye_array(n), unit.T], [unit, -FLOOR * eye_array(n_rows)]]))

    def inverse(Y: Array) -> Array:
        return solve(np.vstack([np.zeros((n, Y.shape[1])), Y]).T).T[n:]

    largest, count = _largest(unit), BLOCK
    while True:
        Y = _in_no_order(n_rows, min(count, n_rows))
        for _ in range(SWEEPS):
            Y = np.linalg.qr(inverse(Y))[0]
        mixed, sizes = _decomposed((unit.T @ Y).T)
        if sizes[-1] > LOST * largest or len(sizes) == n_rows:
            return np.asarray(Y @ mixed), sizes / largest
        count *= 4


def _largest(unit: Matrix) -> float:
    """Return the largest singular value, near enough, by power iteration."""
    y = _in_no_order(unit.shape[0], 1)[:, 0]
    for _ in range(20):
        y = unit @ (unit.T @ (y / max(float(np.linalg.norm(y)), _NONE)))
    return max(float(np.sqrt(np.linalg.norm(y))), _NONE)


_NONE = 1e-300
"""In place of a size of zero that something is divided by."""


def _in_no_order(n_rows: int, count: int) -> Array:
    """Return a matrix without order, always the same: `numpy.random` would take long to import."""
    return np.asarray(np.sin(np.arange(1.0, n_rows * count + 1.0) ** 2)).reshape(n_rows, count)
