"""Modes of damped motions next to a crowd of others that decay at one rate."""

import numpy as np
from scipy.sparse import csr_array, diags_array

from hfsim.maths.eigenpairs import eigenpairs
from hfsim.maths.pencils import Pencil

N, TIME = 400, 0.05
"""Links of a clamped bar, and by what time its damping is that of its stiffness [s]."""


def test_what_a_crowd_may_hide_is_not_taken_for_complete():
    """Overdamped motions decay at 1/TIME, however fast they were: of these, iterations find some."""
    squares = 4.0 * np.sin(0.5 * np.pi * np.arange(1, N + 1) / (N + 1)) ** 2
    scale = 400.0 / squares[0]
    off = np.full(N - 1, -scale)
    K = csr_array(diags_array([off, np.full(N, 2.0 * scale), off], offsets=[-1, 0, 1]))
    found = eigenpairs(Pencil(csr_array(diags_array(np.ones(N))), TIME * K, K, csr_array((0, N))), 24)
    half = 0.5 * TIME * scale * squares
    root = np.sqrt((half**2 - scale * squares).astype(complex))
    every = np.concatenate([-half + root, -half - root])
    assert np.abs(found.values[:, None] - every).min(axis=1).max() < 1e-6 * np.abs(found.values).max()
    assert found.complete is None
