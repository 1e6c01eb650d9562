"""Equations of motion without the coordinates of a beam that its root holds (static condensation).

In a body frame, the mass matrix depends on the state and is full.  But what the root holds, the *inner*
coordinates, no other body shares, and it is solved with in time proportional to the elements of the beam.  So
it goes first; what is left are the places and angles of frames, other bodies, and the joint forces.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.matrices import dense, is_sparse
from hfsim.maths.traced import changeable
from hfsim.mechanics.joint_rows import JointRows
from hfsim.mechanics.reduction import Reduction
from hfsim.mechanics.variable_mass import VariableMass


class _Part(NamedTuple):
    """A body whose inner coordinates go.

    Attributes
    ----------
    outer : slice
        Where its others stand among those that are left of x.
    inner, free : slice
        Where its inner ones stand in x, and among the free coordinates.
    rows : slice
        Joint equations, the first to the last one that depends on these.
    """

    body: VariableMass
    outer: slice
    inner: slice
    free: slice
    rows: slice


class Condensed:
    """Solves eq. (37).

    Parameters
    ----------
    mass : ndarray, shape (n_x, n_x)
        Constant part of the mass matrix.
    left : ndarray of int
        Coordinates of x that are left.
    """

    def __init__(self, mass: Array, reduction: Reduction, left: IntArray, parts: Sequence[_Part]) -> None:
        self._mass, self._left, self._parts = mass[np.ix_(left, left)], left, parts
        kept = np.ones(len(reduction.rows), dtype=bool)
        for part in parts:
            kept[part.free] = False
        self._free = np.flatnonzero(kept)
        self._basis = dense(reduction.basis)[np.ix_(left, self._free)]

    @classmethod
    def of(
        cls, bodies: Iterable[VariableMass], joints: JointRows, mass: Array, reduction: Reduction
    ) -> Condensed | None:
        """Return it, or None where joints tie inner coordinates to others beforehand."""
        inner = [slice(body.columns.start + body.inner, body.columns.stop) for body in bodies]
        free = [reduction.free_columns(own) for own in inner]
        if is_sparse(mass) or not all(map(reduction.keeps, inner, free)):
            return None
        left = np.setdiff1d(np.arange(len(mass)), np.concatenate([np.r_[own] for own in inner]))
        parts = []
        for body, own, place in zip(bodies, inner, free, strict=True):
            first = int(np.searchsorted(left, body.columns.start))
            parts.append(_Part(body, slice(first, first + body.inner), own, place, joints.about(own)))
        return cls(mass, reduction, left, parts)

    def solve(self, x: Array, f: Array, gamma: Array, jacobian: Array) -> tuple[Array, Array]:
        """Solve M a + Phi_z^T lambda = f, Phi_z a = gamma for the free coordinates.

        Parameters
        ----------
        f : ndarray, shape (n_batch, n)
        gamma : ndarray, shape (n_batch, n_rows)
        jacobian : ndarray, shape (n_batch or 1, n_rows, n_x)
            Phi_x.
        """
        b, m, B = len(x), gamma.shape[1], self._basis
        M = np.repeat(self._mass[None], b, axis=0)
        J = changeable(np.broadcast_to(jacobian[..., self._left], (b, m, len(self._left))))
        corner, forces, gaps = np.zeros((b, m, m)), np.zeros((b, len(self._left))), changeable(gamma)
        answers = []
        for part in self._parts:
            outer, rows, k = part.outer, part.rows, part.body.inner
            own, answering = part.body.condensed(x)
            ties = jacobian[:, rows, part.inner]
            sides = [own[..., k:], np.broadcast_to(ties, (b, *ties.shape[1:])), f[:, None, part.free]]
            given = np.concatenate(sides, axis=1)
            answer = answering(given)
            work = given @ answer.swapaxes(1, 2)
            M[:, outer, outer] = own[..., :k] - work[:, :k, :k]
            J[:, rows, outer] -= work[:, k:-1, :k]
            corner[:, rows, rows] -= work[:, k:-1, k:-1]
            forces[:, outer] = work[:, :k, -1]
            gaps[:, rows] -= work[:, k:-1, -1]
            answers.append(answer)
        left, multipliers = _saddle_point(B.T @ M @ B, J @ B, corner, f[:, self._free] - forces @ B, gaps)
        a, moved = np.empty((b, f.shape[1])), left @ B.T
        a[:, self._free] = left
        for part, answer in zip(self._parts, answers, strict=True):
            driving = np.concatenate([moved[:, part.outer], multipliers[:, part.rows]], axis=1)
            a[:, part.free] = answer[:, -1] - (driving[:, None] @ answer[:, :-1])[:, 0]
        return a, multipliers


def _saddle_point(M: Array, J: Array, corner: Array, f: Array, gaps: Array) -> tuple[Array, Array]:
    """Solve M a + J^T lambda = f, J a + corner lambda = gaps."""
    m, n = J.shape[1:]
    matrix = np.empty((len(M), n + m, n + m))
    matrix[:, :n, :n], matrix[:, n:, :n] = M, J
    matrix[:, :n, n:], matrix[:, n:, n:] = J.swapaxes(1, 2), corner
    found = np.linalg.solve(matrix, np.concatenate([f, gaps], axis=1)[..., None])[..., 0]
    return found[:, :n], found[:, n:]
