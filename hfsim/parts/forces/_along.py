"""Places along beams at which loads are evaluated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.shapes import gauss_legendre

ROUNDING = 1e-9
"""Distance, over the length of a beam, that counts as none."""


def gauss_points(
    length: float, elements: int, degree: int, shape: Sequence[tuple[float, float]] | None = None
) -> tuple[Array, Array, Array]:
    """Return cells, and places there with weights, a factor along the beam included.

    Parameters
    ----------
    degree : int
        Of polynomials for which they are exact, times the factor.
    shape : sequence of (float, float), optional
        Distances from the root and the factor there, between which it is linear; 1 without it.
    """
    ends = np.linspace(0.0, length, elements + 1)
    rows = np.array(shape or ((0.0, 1.0), (length, 1.0)))
    kinks = np.clip(rows[:, 0], 0.0, length)
    inside = ends[(ends > kinks[0]) & (ends < kinks[-1])]
    near = np.abs(inside[:, None] - kinks).min(axis=1, initial=length) <= ROUNDING * length
    grid = np.sort(np.concatenate([inside[~near], kinks]))
    xi, w = gauss_legendre((degree + 3) // 2)
    steps = np.diff(grid)
    places = (grid[:-1, None] + steps[:, None] * xi).ravel()
    return grid, places, (steps[:, None] * w).ravel() * np.interp(places, kinks, rows[:, 1])


def in_axes(spec: Any, places: Array, vector: Sequence[float] | Array) -> Array:
    """Return a vector of the sections of a beam, at places, in the axes that markers turn, (n, n_dim)."""
    from hfsim.parts.bodies.beam_axis import Axis

    return np.asarray(Axis.of(spec, len(vector)).sections(places)[1] @ vector)
