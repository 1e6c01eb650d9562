"""How many squares of frequencies are below a number: Sturm's count, from the signs of a factorisation."""

from __future__ import annotations

import numpy as np

from hfsim.maths.pencils import Pencil

_SOFT = 1e-8
"""How much a constraint gives way, over what the stiffest coordinate does: pivots are never zero then."""
_TRUSTED = 0.3
"""Norm of the inverse times the error of the factors up to which signs are believed: below 1 none is off."""
_TIMES = 4
"""How often that is measured."""


def count_below(pencil: Pencil, bound: float) -> int | None:
    """Return how many eigenvalues of K x + J^T m = mu M x, J x = 0, are below a bound.

    By Sylvester: as many as [[K - bound M, J^T], [J, 0]] has negative pivots beyond one for each constraint.

    Parameters
    ----------
    pencil : Pencil
        Large, and symmetric.

    Returns
    -------
    int or None
        None where the matrix has no factors without exchanges of rows that are good enough.
    """
    from scipy.sparse import block_array, csc_array, diags_array
    from scipy.sparse.linalg import splu

    M, _, K, J = pencil.matrices
    own = K - bound * M
    scale = 1.0 / np.sqrt(np.maximum(np.asarray(abs(own).max(axis=1).todense()).ravel(), 1e-300))
    own = diags_array(scale) @ own @ diags_array(scale)
    rows = J.shape[0]
    if rows:
        border = J @ diags_array(scale)
        sizes = np.asarray(abs(border).max(axis=1).todense()).ravel()
        border = diags_array(1.0 / sizes) @ border
        own = block_array([[own, border.T], [border, diags_array(np.full(rows, -_SOFT))]])
    whole = csc_array(own)
    options = {"SymmetricMode": True, "Equil": False}
    try:
        factor = splu(whole, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    except RuntimeError:
        return None
    if not np.array_equal(factor.perm_r, factor.perm_c):
        return None
    known = np.random.default_rng(0).standard_normal((whole.shape[0], _TIMES))
    # a matrix times numbers at random is as long as its Frobenius norm, which is no less than any other
    if not np.linalg.norm(factor.solve(whole @ known) - known) <= _TRUSTED * _TIMES**0.5:
        return None
    return int(np.count_nonzero(factor.U.diagonal() < 0.0)) - int(rows)
