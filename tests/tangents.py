"""What holds the derivatives of a force against differences of it."""

import numpy as np


def forces(part, x, u):
    """The generalised force of a part in states (n_batch, n)."""
    out = np.zeros_like(x)
    part.add_force(np.zeros(len(x)), x, u, out)
    return out


def check_tangents(part, x, u, step, within, rate_step=None):
    """Hold both derivatives in one state against central differences, within a part of the largest entry."""
    t, n = np.zeros(1), x.shape[1]
    xs, us, moved = np.repeat(x, n, axis=0), np.repeat(u, n, axis=0), np.eye(n)
    rate_step = step if rate_step is None else rate_step
    for entries, size, by_x, by_u in (
        (part.tangent(t, x, u), step, step, 0.0),
        (part.rate_tangent(t, x, u), rate_step, 0.0, rate_step),
    ):
        matrix = np.zeros((n, n))
        np.add.at(matrix, (entries.rows, entries.columns), entries.values)
        ahead, back = (forces(part, xs + way * by_x * moved, us + way * by_u * moved) for way in (1.0, -1.0))
        slopes = -(ahead - back).T / (2.0 * size)
        np.testing.assert_allclose(matrix, slopes, atol=within * np.abs(slopes).max())
