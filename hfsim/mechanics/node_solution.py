"""The equations of motion solved node by node, with what is left of them at the joints."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array, IntArray, distinct
from hfsim.maths.matrices import Matrix, dense
from hfsim.mechanics.axes_rows import AxesAt, AxesRows
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.joint_rows import JointRows
from hfsim.mechanics.orthonormal import Orthonormal
from hfsim.mechanics.reduction import Reduction

Solve = Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class NodeSolution:
    """Accelerations and multipliers where axes of nodes are kept orthonormal.

    Attributes
    ----------
    nodes : tuple of AxesRows
    joints : JointRows
        The other equations.
    rows : ndarray of int, shape (n_joint_rows,)
        Theirs in Phi.
    reduction : Reduction
    unconstrained : callable
        Forces on the free coordinates (..., n) -> accelerations without any of the equations.
    """

    nodes: tuple[AxesRows, ...]
    joints: JointRows
    rows: IntArray
    reduction: Reduction
    unconstrained: Solve

    @classmethod
    def of(
        cls, phi: JointRows, mass: Matrix, reduction: Reduction, unconstrained: Solve
    ) -> NodeSolution | None:
        """Return the solution for equations phi and a constant mass matrix of x; None without such axes."""
        known = set(reduction.rows.tolist())
        kinds: dict[int, list[tuple[Orthonormal, int]]] = {}
        others: list[tuple[Constraint, slice]] = []
        for c, rows in zip(phi.constraints, phi.rows, strict=True):
            if isinstance(c, Orthonormal) and known.issuperset(c.axis_columns.tolist()):
                kinds.setdefault(c.rows, []).append((c, rows.start))
            else:
                others.append((c, rows))
        if not kinds:
            return None
        nodes = tuple(AxesRows.of(own, reduction, mass) for own in kinds.values())
        joints = JointRows(tuple(c for c, _ in others), phi.n_x, phi.sparse)
        left = np.array([k for _, rows in others for k in range(rows.start, rows.stop)], dtype=np.intp)
        return cls(nodes, joints, left, reduction, unconstrained)

    @cached_property
    def _spreading(self) -> tuple[Array, IntArray]:
        """What unit forces at the joints accelerate, (k, n_moved), and which free coordinates these are.

        Those of the nodes there among them.
        """
        spreading = self.unconstrained(dense(self.reduction.basis[self.joints.support]))
        moved: list[IntArray] = [np.flatnonzero(spreading.any(axis=0))]
        moved += [kind.free[touched].ravel() for kind, touched in zip(self.nodes, self._touched, strict=True)]
        columns = distinct(np.concatenate(moved))
        return np.ascontiguousarray(spreading[:, columns]), columns

    @cached_property
    def _touched(self) -> list[IntArray]:
        """Nodes of each kind at which joints act."""
        return [np.flatnonzero(np.isin(kind.columns, self.joints.support).any(axis=1)) for kind in self.nodes]

    @cached_property
    def _reading(self) -> Array:
        """From the free coordinates that move to those at the joints, (n_moved, k)."""
        return np.ascontiguousarray(dense(self.reduction.basis[self.joints.support][:, self._spreading[1]]).T)

    @cached_property
    def _places(self) -> list[IntArray]:
        """Axes of the nodes at joints among the free coordinates that move, (n_touched, 3 k) of each kind."""
        pairs = zip(self.nodes, self._touched, strict=True)
        return [np.searchsorted(self._spreading[1], kind.free[own]) for kind, own in pairs]

    def solve(self, x: Array, f: Array, gamma: Array) -> tuple[Array, Array]:
        """Return accelerations (n_batch, n) and multipliers (n_batch, n_rows) for forces f (n_batch, n)."""
        return self._solved(x, [kind.at(x) for kind in self.nodes], self.joints.at_joints(x), f, gamma)

    def missing(self, x: Array, f: Array, gamma: Array, a: Array) -> tuple[Array, Array]:
        """Return what accelerations a (n_batch, n) miss of the solution, and what the rows miss."""
        at, J = [kind.at(x) for kind in self.nodes], self.joints.at_joints(x)
        missing = self._solved(x, at, J, f, gamma)[0] - a
        gaps = np.empty_like(gamma)
        for kind, own in zip(self.nodes, at, strict=True):
            gaps[:, kind.rows] = (own.jacobian @ missing[:, kind.free][..., None])[..., 0]
        at_joints = missing[:, self._spreading[1]] @ self._reading
        gaps[:, self.rows] = (J @ at_joints[..., None])[..., 0]
        return missing, gaps

    def _solved(
        self, x: Array, at: Sequence[AxesAt], J: Array, f: Array, gamma: Array
    ) -> tuple[Array, Array]:
        a, multipliers = np.array(self.unconstrained(f)), np.empty_like(gamma)
        for kind, own in zip(self.nodes, at, strict=True):
            held, found = own.held(a[:, kind.free][..., None], gamma[:, kind.rows][..., None])
            a[:, kind.free], multipliers[:, kind.rows] = held[..., 0], found[..., 0]
        if not len(self.rows):
            return a, multipliers
        spreading, columns = self._spreading
        moved, answers = np.repeat(J @ spreading, len(x) // len(J), axis=0), list[Array]()
        for own, touched, places in zip(at, self._touched, self._places, strict=True):
            sides = moved[:, :, places].transpose(0, 2, 3, 1)
            nothing = np.zeros((1, 1, own.inverse.shape[-1], 1))
            held, found = own.of(touched).held(sides, nothing)
            moved[:, :, places] = held.transpose(0, 3, 1, 2)
            answers.append(found)
        gap = (J @ (a[:, columns] @ self._reading)[..., None])[..., 0] - gamma[:, self.rows]
        at_joints = np.linalg.solve(J @ (moved @ self._reading).swapaxes(1, 2), gap[..., None])
        a[:, columns] -= (at_joints.swapaxes(1, 2) @ moved)[:, 0]
        multipliers[:, self.rows] = at_joints[..., 0]
        for kind, touched, found in zip(self.nodes, self._touched, answers, strict=True):
            multipliers[:, kind.rows[touched]] -= (found @ at_joints[:, None])[..., 0]
        return a, multipliers
