"""How long the next step is: ``_repeat.c`` does the same.

What rounding changes in an estimate must not change the steps after it: else two processors, or kernels,
soon make others, and results differ by as much as their errors.  So factors are rounded, and follow faint
estimates no farther.
"""

from __future__ import annotations

from math import log2

import numpy as np

from hfsim.integrators._ending import MAX_ITERATIONS
from hfsim.maths.arrays import Array

SAME_TIME = 1e-14
"""Difference of two times, relative to the end of a run, that is rounding."""
TARGET = 0.4
"""Error at which steps are aimed, over the tolerance."""
FAINT = 1e-6
"""The same below which an estimate may be rounding."""
RUNGS = 16
"""Factors from one to two."""
SHRUNK = 0.7
"""By how much a step is shortened whose equations could not be solved."""
REGROWTH = 1.1
"""By how much a step may be longer than the last one after such a failure."""
GROWTH = ((3, 4.0), (5, 1.4), (6, 1.25), (8, 1.1), (10, 1.0), (MAX_ITERATIONS, 0.8))
"""Iterations in a step, and how much longer the next one may then be."""
ROUGH = 5e-4
"""Tolerance from which compositions of kicks and drifts pay; they are for accelerations by position alone."""


def factor(error: float, stages: int, most: float) -> float:
    """Return the factor on a step for which an error, over the tolerance, was estimated.

    Examples
    --------
    >>> factor(0.4, 20, 1.25), round(factor(1e-2, 20, 1.25), 3), factor(1e-5, 20, 1.25) == factor(0, 20, 1.25)
    (1.0, 1.189, True)
    """
    wanted = float((TARGET / max(error, FAINT)) ** (1.0 / (stages + 1)))
    return float(2.0 ** (round(RUNGS * log2(max(0.1, min(wanted, most)))) / RUNGS))


def fitted(wish: float, rest: float, fixed: bool = False) -> float:
    """Return the next step length: the wish, shortened so that the end is met without a sliver."""
    if rest <= wish * (1.0 + 1e-9):
        return rest
    return 0.5 * rest if not fixed and rest < 2.0 * wish else wish


def stretches(breaks: Array, start: float, t_end: float) -> Array:
    """Return the start, those of the sorted breaks that differ from one another and the ends, and the end."""
    times, least = [start], SAME_TIME * t_end
    for t in breaks.tolist():
        if t - times[-1] > least and t_end - t > least:
            times.append(t)
    return np.array([*times, t_end])
