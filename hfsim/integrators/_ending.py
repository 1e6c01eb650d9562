"""When the Newton iteration of a step need not, or cannot, go on."""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array

MAX_ITERATIONS = 20
GOAL = 3e-4
"""Part of the tolerance that an unfinished iteration may take."""
ROUNDING = 1e-10
"""Corrections, relative to the largest coordinate, that may be rounding when they do not shrink any more: in
fine meshes the stiffest modes amplify it so far."""
LAST_DIGIT = 4e-16
"""Corrections, relative to the largest coordinate, that are rounding."""
BEYOND = 3e2
"""Consequences of a correction, relative to the largest coordinate, with which there is no hope."""


def limits(tolerance: float) -> tuple[float, float, float]:
    """Return what limits iterations, all over the size of the coordinates.

    That is the consequence of a correction that need not be followed by another one, and the sizes of
    corrections that may be, or are, rounding.
    """
    return GOAL * tolerance, ROUNDING, LAST_DIGIT


def size_of(q: Array) -> Array:
    """Return the size of coordinates (n,), shape ()."""
    return np.asarray(1.0 + np.abs(q).max())


class Ending:
    """Tells when an iteration ends; ``ended`` in ``_repeat.c`` does as it does."""

    def __init__(self, q: Array, tolerance: float) -> None:
        size = float(size_of(q))
        self._limits = tuple(limit * size for limit in (*limits(tolerance), BEYOND))
        self._before = self._last = self._rate = np.inf

    def after(self, k: int, change: float, size: float) -> bool | None:
        """Return whether the iteration has converged after correction k; None: go on.

        Parameters
        ----------
        k : int
        change : float
            Size of the correction's consequence.
        size : float
            Size of the correction.
        """
        (goal, near, last_digit, beyond), ratio = self._limits, change / self._last
        self._rate = rate = ratio if k <= 1 else max(ratio, 0.5 * self._rate)
        settled = k > 0 and rate < 1.0 and change * max(rate, 0.05) < goal * (1.0 - rate)
        rounding = size < near and k > 2 and ratio > 0.9
        nothing = size < last_digit and change < near  # in very short steps velocities change by more
        if change < 0.05 * goal or settled or rounding or nothing:
            return True
        if not change < beyond or (k > 3 and change > 0.8 * self._before):
            return False
        self._before, self._last = self._last, change
        return None
