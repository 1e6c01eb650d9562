"""The equations of motion solved node by node, with what is left of them at the joints."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, IntArray, distinct
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Matrix, dense
from hfsim.mechanics.axes_rows import AxesAt, AxesRows
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.joint_rows import JointRows
from hfsim.mechanics.orthonormal import Orthonormal
from hfsim.mechanics.reduction import Reduction

Solve = Callable[[Array], Array]
LIGHT = 1e6
"""How much more easily a joint turns nodes than it moves them, from which rounding turns its force too: of a
body of 5 kg with 1e-6 kg m2 on a lever of 10 m, 5e8."""


class _Answers(NamedTuple):
    """What unit multipliers of joints cause in a batch of states.

    Attributes
    ----------
    moved : ndarray, shape (n_batch, n_joint_rows, n_moved)
        Accelerations.
    mobility : ndarray, shape (n_batch, n_joint_rows, n_joint_rows)
        The same at the joints.
    by_nodes : list of ndarray
        Multipliers of the nodes of each kind that joints touch.
    """

    moved: Array
    mobility: Array
    by_nodes: list[Array]


@frozen
class NodeSolution:
    """Accelerations and multipliers where axes of nodes are kept orthonormal.

    Attributes
    ----------
    joints : JointRows
        The other equations.
    rows : ndarray of int, shape (n_joint_rows,)
        Theirs in Phi.
    mass : Matrix, shape (n, n)
        Of the free coordinates.
    unconstrained : callable
        Forces on the free coordinates (..., n) -> accelerations without any of the equations, with ballast.
    """

    nodes: tuple[AxesRows, ...]
    joints: JointRows
    rows: IntArray
    reduction: Reduction
    mass: Matrix
    unconstrained: Solve

    @classmethod
    def of(
        cls, phi: JointRows, mass: Matrix, ballast: Matrix | None, reduction: Reduction, unconstrained: Solve
    ) -> NodeSolution | None:
        """Return the solution for equations phi and a constant mass matrix of x; None without such axes.

        ``unconstrained`` is that of the mass matrix with ``ballast``.
        """
        known = set(reduction.rows.tolist())
        lacking = np.zeros(len(reduction.offset)) if ballast is None else ballast.diagonal()
        kinds: dict[tuple[int, bool], list[tuple[Orthonormal, int]]] = {}
        others: list[tuple[Constraint, slice]] = []
        for c, rows in zip(phi.constraints, phi.rows, strict=True):
            if isinstance(c, Orthonormal) and known.issuperset(c.axis_columns.tolist()):
                kinds.setdefault((c.rows, lacking[c.axis_columns[0]] > 0.0), []).append((c, rows.start))
            else:
                others.append((c, rows))
        if not kinds:
            return None
        nodes = tuple(AxesRows.of(own, reduction, mass, lacking) for own in kinds.values())
        joints = JointRows(tuple(c for c, _ in others), phi.n_x, phi.sparse)
        left = np.array([k for _, rows in others for k in range(rows.start, rows.stop)], dtype=np.intp)
        return cls(nodes, joints, left, reduction, reduction.reduced(mass), unconstrained)

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
    def slender(self) -> bool:
        """Whether nodes turn so easily about an axis that rounding spoils what joints make of it."""
        return any(kind.slender for kind in self.nodes) or self._light

    @property
    def _light(self) -> bool:
        """Whether joints turn nodes by levers so far more easily than they move them.

        Where equations of joints are linear, and levers therefore the same in all states.
        """
        rows, columns, values = self.reduction.free_entries(self.joints.still_entries)
        mass = self.mass.diagonal()[columns]
        easily = np.divide(values[0] ** 2, mass, out=np.zeros(len(mass)), where=mass > 0.0)
        axes = np.isin(columns, np.concatenate([kind.free.ravel() for kind in self.nodes]))
        turned, moved = (np.bincount(rows[some], easily[some], len(self.rows)) for some in (axes, ~axes))
        return bool(((moved > 0.0) & (turned > LIGHT * moved)).any())

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
        return self.at(x)(f, gamma)

    def at(self, x: Array) -> Callable[[Array, Array], tuple[Array, Array]]:
        """Return what does so in states (n_batch, n_x), for several forces and gammas."""
        return partial(self._solved, *self._parts(x))

    def _parts(self, x: Array) -> tuple[Sequence[AxesAt], Array, _Answers | None]:
        at, J = [kind.at(x) for kind in self.nodes], self.joints.at_joints(x)
        return at, J, self._answers(at, J, len(x)) if len(self.rows) else None

    def missing(self, x: Array, f: Array, gamma: Array, a: Array) -> tuple[Array, Array]:
        """Return what accelerations a (n_batch, n) miss of the solution, and what the rows miss."""
        at, J, answers = self._parts(x)
        missing = self._solved(at, J, answers, f, gamma)[0] - a
        return missing, self._opening(at, J, missing)

    def _opening(self, at: Sequence[AxesAt], J: Array, a: Array) -> Array:
        """Return Phi_z a, shape (n_batch, n_rows)."""
        opening = np.empty((len(a), len(self.rows) + sum(kind.rows.size for kind in self.nodes)))
        self.open_nodes(at, a, opening)
        at_joints = a[:, self._spreading[1]] @ self._reading
        opening[:, self.rows] = (J @ at_joints[..., None])[..., 0]
        return opening

    def open_nodes(self, at: Sequence[AxesAt], a: Array, opening: Array) -> None:
        """Write the rows of the nodes into what accelerations a (n_batch, n) open, (n_batch, n_rows)."""
        for kind, own in zip(self.nodes, at, strict=True):
            opening[:, kind.rows] = (own.jacobian @ a[:, kind.free][..., None])[..., 0]

    def _pull(self, at: Sequence[AxesAt], J: Array, multipliers: Array) -> Array:
        """Return Phi_z^T lambda, shape (n_batch, n)."""
        pull, columns = np.zeros((len(multipliers), self.mass.shape[0])), self._spreading[1]
        pull[:, columns] = (multipliers[:, None, self.rows] @ J)[:, 0] @ self._reading.T
        self.pull_nodes(at, multipliers, pull)
        return pull

    def pull_nodes(self, at: Sequence[AxesAt], multipliers: Array, pull: Array) -> None:
        """Add what the rows of the nodes pull at coordinates, (n_batch, n)."""
        for kind, own in zip(self.nodes, at, strict=True):
            pull[:, kind.free] += (multipliers[:, kind.rows][..., None, :] @ own.jacobian)[..., 0, :]

    def _solved(
        self, at: Sequence[AxesAt], J: Array, answers: _Answers | None, f: Array, gamma: Array
    ) -> tuple[Array, Array]:
        """Return accelerations and multipliers; with slender bodies also of what rounding leaves."""
        a, multipliers = self._solved_once(at, J, answers, f, gamma)
        if self.slender:
            left = f - a @ self.mass - self._pull(at, J, multipliers)
            rest = self._solved_once(at, J, answers, left, gamma - self._opening(at, J, a))
            a, multipliers = a + rest[0], multipliers + rest[1]
        return a, multipliers

    def _answers(self, at: Sequence[AxesAt], J: Array, count: int) -> _Answers:
        spreading, _ = self._spreading
        moved, answers = np.repeat(J @ spreading, count // len(J), axis=0), list[Array]()
        for own, touched, places in zip(at, self._touched, self._places, strict=True):
            sides = moved[:, :, places].transpose(0, 2, 3, 1)
            nothing = np.zeros((1, 1, own.inverse.shape[-1], 1))
            held, found = own.of(touched).held(sides, nothing)
            moved[:, :, places] = held.transpose(0, 3, 1, 2)
            answers.append(found)
        return _Answers(moved, J @ (moved @ self._reading).swapaxes(1, 2), answers)

    def without_joints(self, at: Sequence[AxesAt], f: Array, gamma: Array) -> tuple[Array, Array]:
        """Return accelerations and multipliers where the nodes' rows alone hold: of joints anything."""
        a, multipliers = np.array(self.unconstrained(f)), np.empty_like(gamma)
        for kind, own in zip(self.nodes, at, strict=True):
            held, found = own.held(a[:, kind.free][..., None], gamma[:, kind.rows][..., None])
            a[:, kind.free], multipliers[:, kind.rows] = held[..., 0], found[..., 0]
        return a, multipliers

    def _solved_once(
        self, at: Sequence[AxesAt], J: Array, answers: _Answers | None, f: Array, gamma: Array
    ) -> tuple[Array, Array]:
        a, multipliers = self.without_joints(at, f, gamma)
        if answers is None:
            return a, multipliers
        (moved, mobility, by_nodes), columns = answers, self._spreading[1]
        gap = (J @ (a[:, columns] @ self._reading)[..., None])[..., 0] - gamma[:, self.rows]
        at_joints = np.linalg.solve(mobility, gap[..., None])
        a[:, columns] -= (at_joints.swapaxes(1, 2) @ moved)[:, 0]
        multipliers[:, self.rows] = at_joints[..., 0]
        for kind, touched, found in zip(self.nodes, self._touched, by_nodes, strict=True):
            multipliers[:, kind.rows[touched]] -= (found @ at_joints[:, None])[..., 0]
        return a, multipliers
