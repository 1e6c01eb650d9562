"""The smallest rates that joints ask for, spins before velocities, and what is left of gaps in them."""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array, BoolArray, magnitude
from hfsim.maths.matrices import Matrix, rescaled, smallest_step
from hfsim.mechanics.constraints import Constraint
from hfsim.scene.closing import CLOSED, MOST_ROWS, Linkage
from hfsim.scene.stated import Stated

LIGHT, PASSES = 1e-4, 3
"""Unit of spins in larger scenes, beside the size for velocities, and steps that such units take: spins are
the smallest but for 1e-8 of them."""


def opened(link: Linkage, J: Array, free: BoolArray, gap: Array, joint: Constraint) -> float:
    """Return by how much a joint misses the rates where all others hold, or nearly so [m/s or rad/s]."""
    own = link.equations.rows[link.constraints.index(joint)]
    others = np.ones(len(J), dtype=bool)
    others[own] = False
    return float(np.linalg.norm((gap - J @ least_turning(link, J[others], free, gap[others]))[own]))


def follow_rates(link: Linkage, J: Matrix, rates: Stated, none: float) -> Array:
    """Change what is not stated, velocities first, until gaps are none; return those that are left."""
    values = rates.values
    gap = J @ values + link.drift
    again = PASSES if J.shape[0] > MOST_ROWS else 1  # sparse factors leave more than rounding
    for free in (~rates.stated & ~link.turns, *[~rates.stated] * again):
        values -= least_turning(link, J, free, gap)
        gap = J @ values + link.drift
        if magnitude(gap / link.scales) < none:
            break
    return np.asarray(gap)


def least_turning(link: Linkage, J: Matrix, free: BoolArray, gap: Array) -> Array:
    """Return rates (n,), zero where not free, that close gaps: with the smallest spins, then velocities.

    One after the other: what both at once make smallest depends on the unit of length.
    """
    step, shifts, spins = np.zeros(len(free)), free & ~link.turns, free & link.turns
    if spins.any() and J.shape[0] <= MOST_ROWS:
        left = left_over(J[:, shifts])
        step[spins] = smallest_step(left @ J[:, spins], left @ gap)
    elif spins.any():
        units = np.where(link.turns, LIGHT, link.size)[free]
        rows, missed = rescaled(J[:, free], units, link.scales), gap / link.scales
        for _ in range(PASSES):
            step[free] += units * smallest_step(rows, missed - rows @ (step[free] / units))
    step[shifts] += smallest_step(J[:, shifts], gap - J @ step)
    return step


def left_over(J: Array) -> Array:
    """Return the combinations of equations (k, m) that coordinates with derivatives (m, n) do not change."""
    sides, sizes, _ = np.linalg.svd(J)
    return np.asarray(sides[:, int(np.sum(sizes > CLOSED * sizes.max(initial=0.0))) :].T)
