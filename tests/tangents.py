"""What holds the derivatives of a force against differences of it."""

import numpy as np


def forces(part, x, u):
    """The generalised force of a part in states (n_batch, n)."""
    out = np.zeros_like(x)
    part.add_force(np.zeros(len(x)), x, u, out)
    return out


def check_tangents(part, x, u, step, within):
    """Hold both derivatives in one state against central differences, within a part of the largest entry."""
    t, n = np.zeros(1), x.shape[1]
    xs, us, moved = np.repeat(x, n, axis=0), np.repeat(u, n, axis=0), step * np.eye(n)
    for entries, ahead, back in (
        (part.tangent(t, x, u), forces(part, xs + moved, us), forces(part, xs - moved, us)),
        (part.rate_tangent(t, x, u), forces(part, xs, us + moved), forces(part, xs, us - moved)),
    ):
        matrix = np.zeros((n, n))
        np.add.at(matrix, (entries.rows, entries.columns), entries.values)
        slopes = -(ahead - back).T / (2.0 * step)
        np.testing.assert_allclose(matrix, slopes, atol=within * np.abs(slopes).max())
