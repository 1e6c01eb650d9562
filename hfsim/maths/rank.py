"""Rank of joint equations: which joints depend on one another, by the null vectors of their Jacobian."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array

LOST = 1e-9
"""Singular value over the largest below which rows count as dependent."""


class Dependence(NamedTuple):
    """How near rows of a constraint Jacobian are to depending on one another.

    Attributes
    ----------
    missing : int
        Rows too many.
    size : float
        Smallest singular value over the largest, of rows of unit length.
    joints : tuple of str
        Joints whose rows make up the left null vectors, or that of the smallest singular value.
    """

    missing: int
    size: float
    joints: tuple[str, ...]


def dependence(
    Phi_x: Array, rows: Sequence[slice], joints: Mapping[str, Sequence[int]], share: float = 1e-6
) -> Dependence:
    """Measure the dependence of joint equations in one state.

    Parameters
    ----------
    Phi_x : ndarray, shape (n_rows, n)
    rows : sequence of slice
        Rows of each constraint.
    joints : mapping of str to sequence of int
        Constraints of each joint.
    share : float
        Component of a null vector from which a joint takes part.
    """
    if not len(Phi_x):
        return Dependence(0, 1.0, ())
    unit = Phi_x / np.maximum(np.linalg.norm(Phi_x, axis=1, keepdims=True), 1e-300)
    left, sizes, _ = np.linalg.svd(unit, full_matrices=True)
    rank = int(np.sum(sizes > LOST * sizes[0]))
    null = left[:, rank:] if rank < len(Phi_x) else left[:, -1:]
    weight = np.abs(null).max(axis=1)
    involved = (n for n, members in joints.items() if any(weight[rows[k]].max() > share for k in members))
    size = float(sizes[-1] / sizes[0]) if len(sizes) == len(Phi_x) and sizes[0] > 0.0 else 0.0
    return Dependence(len(Phi_x) - rank, size, tuple(involved))
