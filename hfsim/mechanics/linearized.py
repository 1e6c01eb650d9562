"""Equations of motion linearised at a state, as stiff methods and stability studies need them."""

from __future__ import annotations

from typing import NamedTuple

from hfsim.maths.arrays import Array
from hfsim.maths.matrices import Matrix


class Linearized(NamedTuple):
    """M y'' + D y' + K y + Phi^T lambda = 0 with Phi y = 0, for small changes y of a state.

    Inertia forces that change with the state (centrifugal and gyroscopic ones) are not in it: they
    never make a problem stiff.

    Attributes
    ----------
    mass, stiffness : Matrix, shape (n, n)
        Dense or sparse alike; the stiffness is symmetric unless following loads make it otherwise.
    damping : Matrix, shape (n, n), or None
        None where nothing dissipates.
    jacobian : Matrix, shape (n_rows, n), or None
        None without constraints.
    inverse_root : ndarray, shape (n, n), or None
        Rows are orthonormal in the metric of the mass; None if matrices are sparse.
    """

    mass: Matrix
    stiffness: Matrix
    damping: Matrix | None
    jacobian: Matrix | None
    inverse_root: Array | None
