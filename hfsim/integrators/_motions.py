"""Derivatives of the accelerations in the motions that joints allow."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from hfsim.integrators._derivative import Derivative, Stages
from hfsim.integrators._problem import Increments, PlainIncrements, Problem
from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen, mutable
from hfsim.mechanics.linearized import Linearized


@frozen
class Joints:
    """What joints forbid, in the coordinates of a derivative.

    Attributes
    ----------
    jacobian : ndarray, shape (n_rows, n)
    closing : ndarray, shape (n_rows, n)
        The smallest motions, measured by the mass matrix, that close unit gaps.
    forces : ndarray, shape (n_rows, n_motions)
        Forces on the motions that these cause by the stiffness.
    drags : ndarray, shape (n_rows, n_motions), or None
        Those that they cause at unit rates by the damping, if there is any.
    """

    jacobian: Array
    closing: Array
    forces: Array
    drags: Array | None
    holds_arrays: ClassVar[bool] = True

    def closed(self, gaps: Array) -> Array:
        """Return the motions that close gaps (..., n_rows)."""
        return np.asarray(gaps @ self.closing)


@mutable
class MotionsDerivative(Derivative):
    """J_q = -R S, and likewise J_v, with motions R that joints allow.

    Where the mass matrix is known, a residual has a column for each motion and then one for each joint
    equation, and comes from forces, f - M a.  Accelerations that are missing in *another* state would depend
    on its mass matrix in natural increments, and stiff modes would be corrected by the wrong amount.

    Attributes
    ----------
    increments : Increments
    R : ndarray, shape (n, n_motions)
        Motions as columns.
    L : ndarray, shape (n_motions, n)
        L R = 1: with as many motions as coordinates the inverse of R.
    joints : Joints, or None
        None where there are as many motions as coordinates.
    mass : ndarray, shape (n, n), or None
        Of the state's coordinates; R^T then turns forces into accelerations of the motions.
    """

    increments: Increments
    R: Array
    L: Array
    joints: Joints | None
    mass: Array | None

    def __post_init__(self) -> None:
        rows = self.L if self.joints is None else np.concatenate([self.L, self.joints.jacobian])
        self._columns = np.ascontiguousarray(rows.T)

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return int(self.L.shape[1])

    def residual(self, problem: Problem, stages: Stages) -> Array:
        """Return missing accelerations of the motions and gaps of joints."""
        if self.mass is None or problem.imbalance is None:
            r = self.reading(super().residual(problem, stages))
        else:
            forces, gaps = problem.unbalanced(*stages[1:5], stages.expected)
            own = self.increments.to_natural_forces(stages.at, forces) @ self.R
            r = np.asarray(own if self.joints is None else np.concatenate([own, gaps], axis=1))
        if stages.strained is not None:
            r[:, : len(self.L)] -= self.pull(stages.strained) @ self.R
        return r

    def reading(self, r: Array) -> Array:
        """Return accelerations in natural increments as accelerations of the motions and gaps of joints."""
        return r if self.mass is None else np.asarray(r @ self._columns)

    def _read(self, r: Array) -> Array:
        """Return residuals (..., n_r) by motions and gaps, if they are not yet."""
        return np.asarray(r @ self._columns) if self.mass is None else r


def motions_of(
    at: Linearized, natural: Increments, q: Array, rows: Array, pull: Array, drag: Array | None = None
) -> tuple[Array, Array, Joints | None, Array | None]:
    """Return R, L, joints and mass of a dense linearised system at a state.

    Parameters
    ----------
    at : Linearized
    natural : Increments
    q : ndarray, shape (n,)
    rows : ndarray, shape (n_motions, n)
        The motions that joints allow, orthonormal in the metric of the mass.
    pull, drag : ndarray, shape (n_motions, n)
        Forces on them that coordinates and their rates cause: rows times stiffness, and times damping.
    """
    joints = None
    if at.jacobian is not None:
        closing = at.closing()
        joints = Joints(at.jacobian, closing, closing @ pull.T, None if drag is None else closing @ drag.T)
    L = rows @ at.mass
    if isinstance(natural, PlainIncrements):
        return np.ascontiguousarray(rows.T), L, joints, None
    geometry = natural.geometry(q[None])
    moved = np.ascontiguousarray(rows) if joints is None else np.concatenate([rows, joints.closing])
    moved = natural.to_natural(geometry, moved)
    unit = natural.from_natural(geometry, np.eye(len(q))).T
    if joints is not None:
        joints = replace(joints, jacobian=joints.jacobian @ unit, closing=moved[len(rows) :])
    return np.ascontiguousarray(moved[: len(rows)].T), L @ unit, joints, at.mass
