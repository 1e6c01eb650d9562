"""Derivatives by differences of fourth order: exact for polynomials of degree four."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hfsim.maths.arrays import Array, IntArray, slices

FINE = 3e-4
"""Step, over what a coordinate changes by at large: lengths by the size of a body, others by one."""
AT_ONCE = 500_000
"""Numbers of a batch."""


def fine_derivative(
    function: Callable[[Array], Array], at: Array, columns: IntArray, steps: Array
) -> Array:
    """Return the derivative of a function (n_batch, n) -> (n_batch, m) by some entries of its argument.

    Parameters
    ----------
    at : ndarray, shape (n,)
    columns : ndarray of int, shape (k,)
        The entries, one at least.
    steps : ndarray, shape (k,)
        By which they are moved.

    Returns
    -------
    ndarray, shape (m, k)
    """
    parts = []
    for some in slices(len(columns), AT_ONCE // (4 * len(at))):
        own, step = np.tile(columns[some], 4), steps[some]
        moved = np.repeat(at[None], len(own), axis=0)
        moved[np.arange(len(own)), own] += np.outer([-2.0, -1.0, 1.0, 2.0], step).ravel()
        parts.append(slopes(function(moved).reshape(4, len(step), -1)) / step[:, None])
    return np.ascontiguousarray(np.concatenate(parts).T)


def slopes(values: Array) -> Array:
    """Return differences of values at -2, -1, 1 and 2 steps (first axis), over the step."""
    far, near, nearer, further = values
    return np.asarray((8.0 * (nearer - near) - (further - far)) / 12.0)
