"""Matrices that are dense in small scenes and sparse in large ones.

Up to `dense_up_to` rows the calls cost, not the arithmetic, and dense matrices win; beyond it time
and memory must grow linearly, and SciPy's sparse matrices take over.  ``X @ A`` means the same for
both, so that most code need not know which it has.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from hfsim.maths.arrays import Array, IntArray

Matrix: TypeAlias = Any
"""An ndarray, or a SciPy sparse array in CSR form."""

DENSE_UP_TO = 200
"""Rows up to which dense algebra is the faster one in all scenes, also in chains of rigid bodies."""
DENSE_IN_PLANE = 250
"""Coordinates of other scenes in the plane, less what joints eliminate, up to which it is (at 191 and 224,
0.44 and 0.27 s against 1.08 and 0.54)."""
DENSE_IN_SPACE, DENSE_WITH_AXES = 300, 400
"""The same in space (at 237, 0.95 s against 2.3 s), also with many axes (at 357, 1.4 s against 3.6 s)."""
AT_ONCE = 20_000
"""Rows of sparse matrices, of several states, that are factorised together."""
SOFT = 1e-6
"""Stiffness, over the largest of a matrix, below which a coordinate is not measured by its own."""
LONG, ASIDE, FEW_LONG = 48, 10.0, 1.0 / 16.0
"""Entries from which a column is long, those over the root of the number of columns from which COLAMD sets it
aside, and which part of the columns may be long."""
MANY, MANY_IN_SPACE = 0.4, 0.2
"""Equations of joints and axes, over coordinates, that are many."""


def dense_up_to(coordinates: int, rows: int, n_dim: int) -> int:
    """Return up to how many coordinates matrices are dense; rows are the equations of joints and axes."""
    if n_dim == 3:
        return DENSE_WITH_AXES if rows > MANY_IN_SPACE * coordinates else DENSE_IN_SPACE
    return DENSE_UP_TO if rows > MANY * coordinates else DENSE_IN_PLANE


def skewness(matrix: Matrix, stiffness: Matrix | None = None) -> float:
    """Return the largest difference of entries across the diagonal, in coordinates of one stiffness each.

    In these no unit counts; what is stiffer than others by more than `SOFT` is no measure for them.

    Parameters
    ----------
    matrix : Matrix, shape (n, n)
    stiffness : Matrix, shape (n, n), optional
        By whose diagonal coordinates are measured; that of the matrix without it.
    """
    sizes = np.abs((matrix if stiffness is None else stiffness).diagonal())
    largest = float(sizes.max(initial=0.0))
    if not largest:
        return float(abs(matrix - matrix.T).max())
    scale = 1.0 / np.sqrt(np.maximum(sizes, SOFT * largest))
    skew = matrix - matrix.T
    if is_sparse(matrix):
        from scipy.sparse import diags_array

        return float(abs(diags_array(scale) @ skew @ diags_array(scale)).max())
    return float(np.abs(scale[:, None] * skew * scale).max())


class Entries(NamedTuple):
    """Entries of a matrix; those at the same place add up.

    Attributes
    ----------
    rows, columns : ndarray of int, shape (n_entries,)
    values : ndarray, shape (n_entries,)
    """

    rows: IntArray
    columns: IntArray
    values: Array

    @classmethod
    def of_block(cls, rows: IntArray, columns: IntArray, block: Array) -> Entries:
        """Return the entries of dense blocks: rows (..., m), columns (..., n), block (..., m, n)."""
        i = np.broadcast_to(rows[..., :, None], block.shape)
        j = np.broadcast_to(columns[..., None, :], block.shape)
        return cls(i.ravel(), j.ravel(), block.ravel())

    @classmethod
    def of_turns(cls, rows: IntArray, vectors: IntArray, rate: float = 1.0) -> Entries:
        """Return the entries that write planar vectors (..., 2), turned at a rate, into rows (..., 2)."""
        values = np.broadcast_to([-rate, rate], rows.shape)
        return cls(rows.ravel(), vectors[..., ::-1].ravel(), values.ravel())

    @classmethod
    def joined(cls, parts: Iterable[Entries]) -> Entries:
        """Return entries one after the other; values may have batches, (..., n_entries)."""
        return cls(*(np.concatenate(kind, axis=-1) for kind in zip(*parts, strict=True)))


NOTHING = Entries(np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp), np.zeros(0))


def smallest_step(J: Matrix, gap: Array) -> Array:
    """Return the smallest x with J x nearest to a gap; J (m, n), in large cases by sparse factors.

    These are of J J^T, raised by round-off so that rows may depend on one another.
    """
    if min(J.shape) <= DENSE_UP_TO:
        return np.asarray(np.linalg.lstsq(dense(J), gap, rcond=1e-10)[0])
    from scipy.sparse import csc_array, eye_array
    from scipy.sparse.linalg import splu

    rows = csc_array(J)
    square = rows @ rows.T
    raised = _ROUNDING * max(float(np.abs(square.diagonal()).max(initial=0.0)), 1e-300)
    return np.asarray(rows.T @ splu((square + raised * eye_array(J.shape[0])).tocsc()).solve(gap))


_ROUNDING = 1e-13
"""Part of the largest entry of a matrix that is added to its diagonal."""


def is_sparse(matrix: Matrix) -> bool:
    """Return whether a matrix is sparse."""
    return not isinstance(matrix, np.ndarray)


def assemble(parts: Iterable[Entries], shape: tuple[int, int], sparse: bool | None = None) -> Matrix:
    """Return the matrix of all entries; dense up to `DENSE_UP_TO` rows and columns unless said otherwise."""
    rows, columns, values = Entries.joined(list(parts) or [NOTHING])
    if sparse is None:
        sparse = max(shape) > DENSE_UP_TO
    if not sparse:
        flat = np.bincount(rows * shape[1] + columns, weights=values, minlength=shape[0] * shape[1])
        return flat.reshape(shape).astype(float, copy=False)
    from scipy.sparse import coo_array

    return coo_array((values, (rows, columns)), shape=shape).tocsr()


def rescaled(matrix: Matrix, columns: Array, rows: Array) -> Matrix:
    """Return a matrix with columns multiplied by factors (n,), rows divided by (m,); (..., m, n) if dense."""
    if not is_sparse(matrix):
        return matrix * columns / rows[:, None]
    from scipy.sparse import diags_array

    return diags_array(1.0 / rows) @ matrix @ diags_array(columns)


def dense(matrix: Matrix) -> Array:
    """Return a matrix as an ndarray."""
    return np.asarray(matrix.toarray() if is_sparse(matrix) else matrix)


def positive(matrix: Array) -> bool:
    """Tell whether a symmetric matrix is positive definite."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True


def complement(rows: Array) -> Array:
    """Return what rows (m, n) of full rank send to nothing, an orthonormal basis (n, n - m)."""
    return np.linalg.qr(rows.T, mode="complete")[0][:, len(rows) :]


def factorised(matrix: Matrix) -> Callable[[Array], Array]:
    """Return the map from right-hand sides (..., n) to solutions with a square matrix.

    A sparse one is factorised once, a dense one at each call.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the matrix is singular.
    """
    return _Factors(matrix) if is_sparse(matrix) else partial(_solved, matrix)


def _solved(matrix: Array, rhs: Array) -> Array:
    return np.asarray(np.linalg.solve(matrix, rhs.T).T)


class _Factors:
    """A sparse matrix by its factors, which go into other processes as the matrix that they are made of."""

    def __init__(self, matrix: Matrix) -> None:
        from scipy.sparse import csc_array
        from scipy.sparse.linalg import splu

        self._matrix, columns = matrix, csc_array(matrix)
        try:
            self._factors = splu(columns, permc_spec=ordering(columns))
        except RuntimeError as error:
            raise np.linalg.LinAlgError(str(error)) from None

    def __reduce__(self) -> tuple[Any, ...]:
        return _Factors, (self._matrix,)

    def __call__(self, rhs: Array) -> Array:
        given = np.ascontiguousarray(rhs.T.astype(self._matrix.dtype, copy=False))
        return np.asarray(self._factors.solve(given).T)


def ordering(matrix: Matrix) -> str:
    """Return how the columns of a sparse matrix, of symmetric structure, are best ordered for its factors.

    SuperLU's usual way sets the longest columns aside, not those of a frame that couples one body of several:
    these fill the factors.  Where there are some, and few, the other way keeps them last.
    """
    n, entries = matrix.shape[0], np.diff(matrix.indptr)
    long = np.count_nonzero((entries > LONG) & (entries < ASIDE * np.sqrt(n)))
    return "MMD_AT_PLUS_A" if 0 < long <= FEW_LONG * n else "COLAMD"


class SamePlaces:
    """Sparse matrices with entries in the same places; those at the same place add up.

    Parameters
    ----------
    rows, columns : ndarray of int, shape (n_entries,)
    shape : tuple of int
        Of each matrix.
    """

    def __init__(self, rows: IntArray, columns: IntArray, shape: tuple[int, int]) -> None:
        self._shape, self._order = shape, np.lexsort((rows, columns))
        i, j = rows[self._order], columns[self._order]
        new = np.concatenate([[True], (i[1:] != i[:-1]) | (j[1:] != j[:-1])])
        self._first = np.flatnonzero(new)
        self._rows = i[new]
        self._ends = np.concatenate([[0], np.cumsum(np.bincount(j[new], minlength=shape[1]))])

    def of(self, values: Array) -> Matrix:
        """Return the matrices of values (count, n_entries) as one, block after block."""
        from scipy.sparse import csc_array

        count, block = len(values), np.arange(len(values))[:, None]
        data = np.add.reduceat(values[:, self._order], self._first, axis=1)
        rows = (self._rows + self._shape[0] * block).ravel().astype(np.int32)
        ends = (self._ends[1:] + self._ends[-1] * block).ravel().astype(np.int32)
        shape = (self._shape[0] * count, self._shape[1] * count)
        return csc_array((data.ravel(), rows, np.concatenate([[np.int32(0)], ends])), shape=shape)


class SaddlePoints:
    """Matrices [[A, B^T], [B, 0]] of one sparse A (n, n) and many B (rows, n), all with the same places.

    Parameters
    ----------
    matrix : sparse array, shape (n, n)
    border : Entries
        Of B; their values do not matter.
    """

    def __init__(self, matrix: Matrix, border: Entries, rows: int) -> None:
        own, n = matrix.tocoo(), matrix.shape[0]
        i = np.concatenate([own.row, n + border.rows, border.columns])
        j = np.concatenate([own.col, border.columns, n + border.rows])
        self._own, self._places = own.data, SamePlaces(i, j, (n + rows, n + rows))

    def solve(self, values: Array, rhs: Array, solution: Array) -> None:
        """Solve all of them for right-hand sides (count, n + rows): calls cost more than operations.

        Raises
        ------
        numpy.linalg.LinAlgError
            If one is singular.
        """
        own = np.broadcast_to(self._own, (len(values), len(self._own)))
        every = self._places.of(np.concatenate([own, values, values], axis=1))
        solution[...] = factorised(every)(rhs.ravel()).reshape(rhs.shape)


def saddle_point(matrix: Matrix, border: Matrix) -> Matrix:
    """Return [[A, B^T], [B, 0]] of A (n, n) and B (m, n), sparse or dense alike."""
    if not is_sparse(matrix):
        below = np.concatenate([border, np.zeros((len(border), len(border)))], axis=1)
        return np.concatenate([np.concatenate([matrix, border.T], axis=1), below])
    from scipy.sparse import coo_array

    A, B = matrix.tocoo(), border.tocoo()
    n, size = matrix.shape[0], sum(border.shape)
    places = np.concatenate([A.row, n + B.row, B.col]), np.concatenate([A.col, B.col, n + B.row])
    return coo_array((np.concatenate([A.data, B.data, B.data]), places), shape=(size, size)).tocsc()
