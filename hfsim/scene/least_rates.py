"""The smallest rates that joints ask for, spins before velocities, and what is left of gaps in them."""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array, BoolArray, magnitude
from hfsim.maths.matrices import Matrix, rescaled, smallest_step
from hfsim.mechanics.constraints import Constraint
from hfsim.scene.closing import CLOSED, MOST_ROWS, Linkage
from hfsim.scene.stated import Stated

LIGHT, PASSES = 1e-4, 3
"""Weight of spins in larger scenes, beside one of velocities, and steps that it takes: spins are the smallest
but for 1e-8 of them."""


def opened(link: Linkage, J: Array, free: BoolArray, gap: Array, joint: Constraint) -> float:
    """Return by how much a joint misses the rates where all others hold, or nearly so [m/s or rad/s]."""
    own = link.equations.rows[link.constraints.index(joint)]
    others = np.ones(len(J), dtype=bool)
    others[own] = False
    left = gap - J @ least_turning(link, J[others], free, gap[others])
    return float(np.linalg.norm((left * link.scales)[own]))


def follow_rates(link: Linkage, J: Matrix, rates: Stated, none: float) -> Array:
    """Change what is not stated, velocities first, until gaps are none; return those that are left.

    They and the slopes J (m, n) are in units, as of `Linkage.slopes_by_rates`.
    """
    values = rates.values
    gap = J @ (values / link.units) + link.drift
    again = PASSES if J.shape[0] > MOST_ROWS else 1  # sparse factors leave more than rounding
    for free in (~rates.stated & ~link.turns, *[~rates.stated] * again):
        values -= link.units * least_turning(link, J, free, gap)
        gap = J @ (values / link.units) + link.drift
        if magnitude(gap) < none:
            break
    return np.asarray(gap)


def least_turning(link: Linkage, J: Matrix, free: BoolArray, gap: Array) -> Array:
    """Return rates (n,), zero where not free, that close gaps: with the smallest spins, then velocities.

    One after the other: what both at once make smallest depends on the unit of length.  All are in units.
    """
    step, shifts, spins = np.zeros(len(free)), free & ~link.turns, free & link.turns
    if spins.any() and J.shape[0] <= MOST_ROWS:
        left, rows = left_over(J, shifts)
        step[spins] = smallest_step(rows[:, spins], left @ gap)
    elif spins.any():
        light = np.where(link.turns, LIGHT, 1.0)[free]
        rows = rescaled(J[:, free], light, np.ones(len(gap)))
        for _ in range(PASSES):
            step[free] += light * smallest_step(rows, gap - rows @ (step[free] / light))
    step[shifts] += smallest_step(J[:, shifts], gap - J @ step)
    return step


def left_over(J: Array, free: BoolArray) -> tuple[Array, Array]:
    """Return the combinations of equations that free coordinates do not change, and their derivatives.

    Shapes are (k, m) and (k, n), those of the derivatives J (m, n), in units.  What is rounding beside these
    is zero: alone, nothing would tell it from slopes.
    """
    sides, sizes, _ = np.linalg.svd(J[:, free])
    left = sides[:, int(np.sum(sizes > CLOSED * magnitude(J))) :].T
    rows = left @ J
    return left, np.where(np.abs(rows) > CLOSED * magnitude(J), rows, 0.0)
