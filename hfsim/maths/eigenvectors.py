"""Eigenvectors of dense matrices of which some entries are nothing but rounding, and what constraints leave.

Motions that constraints forbid have no place in an eigenproblem: all that is left of them there is rounding.
"""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array, ComplexArray, IntArray

_SOLVED = 1e-6
"""Residual of eigenvectors, over the largest entry, that scaled coordinates may leave."""


def eigenvectors(matrix: Array) -> tuple[ComplexArray, ComplexArray]:
    """Return all eigenvalues (n,) of a matrix (n, n) and its right eigenvectors as columns, of length one.

    LAPACK (geev, that of numpy) scales coordinates until rows are as large as columns.  Mostly that makes
    small eigenvalues more accurate; but where a motion hangs together with others by rounding alone, scales
    are any (1e22 was met), and that motion is all that is seen in every vector.  Then none is scaled.

    Raises
    ------
    numpy.linalg.LinAlgError
        If entries are no numbers, or the iteration finds none.
    """
    values, vectors = np.linalg.eig(matrix)
    if not _solved(matrix, values, vectors):
        from scipy.linalg import eig

        # with a second matrix LAPACK (ggev) permutes and turns, and never scales
        values, vectors = eig(matrix, np.eye(len(matrix)))
    return values.astype(complex), vectors.astype(complex)


def _solved(matrix: Array, values: Array, vectors: Array) -> bool:
    residuals = np.abs(matrix @ vectors - vectors * values).max(initial=0.0)
    return bool(residuals <= _SOLVED * np.abs(matrix).max(initial=0.0))


def allowed(jacobian: Array) -> tuple[Array, IntArray]:
    """Return a basis (n, k) of the motions with J x = 0, and the coordinates that are its shares, (k,).

    Coordinates stay what they are: where they were mixed, what is stiff would be mixed with what is not.
    """
    from scipy.linalg import qr, solve_triangular

    m, n = jacobian.shape
    sizes = np.abs(jacobian).max(axis=1, initial=0.0)
    triangle, order = qr(jacobian / np.where(sizes > 0.0, sizes, 1.0)[:, None], mode="r", pivoting=True)
    basis = np.zeros((n, n - m))
    basis[order[m:]] = np.eye(n - m)
    if m:
        basis[order[:m]] = -solve_triangular(triangle[:, :m], triangle[:, m:])
    return basis, order[m:]
