"""Linear equations of chains: square blocks of which each is coupled with its neighbours alone."""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.traced import changeable


def solve_chain(blocks: Array, couplings: Array, right: Array) -> Array:
    """Solve symmetric equations by cyclic reduction: every second block goes, as long as there are any.

    Stable where the matrix is positive definite; calls grow in number with the logarithm of that of blocks.

    Parameters
    ----------
    blocks : ndarray, shape (n_batch, n_blocks, k, k)
        On the diagonal.
    couplings : ndarray, shape (n_batch, n_blocks - 1, k, k)
        Those above it.
    right : ndarray, shape (n_batch, n_blocks, k, n_columns)

    Returns
    -------
    ndarray, shape (n_batch, n_blocks, k, n_columns)

    Raises
    ------
    numpy.linalg.LinAlgError
        If a block that is left has no inverse.
    """
    n, k = blocks.shape[1:3]
    if n == 1:
        return np.linalg.solve(blocks, right)
    before, after = couplings[:, ::2], couplings[:, 1::2]
    some = after.shape[1]
    beyond = after
    if n % 2 == 0:  # the last block has one neighbour
        beyond = np.concatenate([after, np.zeros((len(blocks), 1, k, k))], axis=1)
    sides = np.concatenate([before.swapaxes(2, 3), beyond, right[:, 1::2]], axis=3)
    solved = np.linalg.solve(blocks[:, 1::2], sides)
    by_first, by_second, own = solved[..., :k], solved[:, :some, :, k : 2 * k], solved[..., 2 * k :]
    kept, sources = changeable(blocks[:, ::2]), changeable(right[:, ::2])
    kept[:, : n // 2] -= before @ by_first
    sources[:, : n // 2] -= before @ own
    if some:
        back = after.swapaxes(2, 3)
        kept[:, 1 : some + 1] -= back @ by_second
        sources[:, 1 : some + 1] -= back @ own[:, :some]
    found = solve_chain(kept, -(before[:, :some] @ by_second), sources)
    own = own - by_first @ found[:, : n // 2]
    if some:
        own[:, :some] -= by_second @ found[:, 1 : some + 1]
    whole = np.empty_like(right)
    whole[:, ::2], whole[:, 1::2] = found, own
    return whole
