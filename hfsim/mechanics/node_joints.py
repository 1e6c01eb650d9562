"""The equations solved node by node where many joints act: what is left at the joints has sparse matrices.

Forces on the axes of a node move no other node, so that the matrix from multipliers of joints to the gaps
that they close has entries only where joints act on the same node: it is far smaller than the whole matrix.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, IntArray, slices
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import AT_ONCE, Entries, Matrix, SamePlaces, factorised
from hfsim.maths.traced import aside
from hfsim.mechanics.axes_rows import AxesAt
from hfsim.mechanics.node_solution import NodeSolution


class _Joined(NamedTuple):
    """A batch of states: its nodes, the derivatives of the joints' rows, and what multipliers close gaps."""

    at: Sequence[AxesAt]
    jacobian: Matrix
    closing: Callable[[Array], Array]


@frozen
class NodeJoints:
    """Accelerations and multipliers of a scene of many joints where axes of nodes are kept orthonormal.

    Attributes
    ----------
    by_nodes : NodeSolution
        Nodes and joints.
    mass : sparse array, shape (n, n)
        Of the free coordinates, with ballast.
    """

    by_nodes: NodeSolution
    mass: Matrix

    @classmethod
    def of(cls, by_nodes: NodeSolution, whole_mass: Matrix) -> NodeJoints | None:
        """Return the solution; None without joints, or where they act on coordinates whose mass is coupled.

        Nor is there one of slender bodies, of which rounding would have to be taken away.
        """
        if not len(by_nodes.rows):
            return None
        from scipy.sparse import csr_array

        found, others = cls(by_nodes, csr_array(whole_mass)), csr_array(whole_mass, copy=True)
        others.setdiag(0.0)
        coupled = np.asarray(abs(others).sum(axis=1)).ravel()[found._others].any()
        return None if coupled or by_nodes.slender else found

    def _entries(self, x: Array) -> Entries:
        """Return the entries of the derivatives of the joints' rows, (n_joint_rows, n)."""
        return self.by_nodes.reduction.free_entries(self.by_nodes.joints.entries(x))

    @cached_property
    def _places(self) -> SamePlaces:
        found, size = self._at_zero, (len(self.by_nodes.rows), self.mass.shape[0])
        return SamePlaces(found.rows, found.columns, size)

    @cached_property
    def _at_zero(self) -> Entries:
        return self._entries(np.zeros((1, len(self.by_nodes.reduction.offset))))

    @cached_property
    def _touched(self) -> list[IntArray]:
        """Nodes of each kind on which joints act."""
        columns = self._at_zero.columns
        return [np.flatnonzero(np.isin(kind.free, columns).any(axis=1)) for kind in self.by_nodes.nodes]

    @cached_property
    def _others(self) -> IntArray:
        """Free coordinates on which joints act, but for axes of nodes."""
        axes = [kind.free.ravel() for kind in self.by_nodes.nodes]
        return np.setdiff1d(self._at_zero.columns, np.concatenate(axes))

    @cached_property
    def _unbound(self) -> tuple[list[Array], Array]:
        """What unit forces accelerate without the nodes' equations: axes of touched nodes, and the others."""
        found = list[Array]()
        for kind, touched in zip(self.by_nodes.nodes, self._touched, strict=True):
            k = kind.mass.shape[1]
            inverse = np.linalg.inv(kind.mass + kind.ballast[:, None, None] * np.eye(k))[touched]
            whole = inverse[:, :, None, :, None] * np.eye(kind.n_dim)[:, None]
            found.append(whole.reshape(1, len(touched), k * kind.n_dim, -1))
        return found, np.asarray(1.0 / self.mass.diagonal()[None, self._others])

    @cached_property
    def _mobile(self) -> SamePlaces:
        """Places of mobilities, (n, n)."""
        n, others = self.mass.shape[0], self._others
        axes = [kind.free[own] for kind, own in zip(self.by_nodes.nodes, self._touched, strict=True)]
        parts = [Entries.of_block(one, one, np.zeros((*one.shape, one.shape[1]))) for one in axes]
        rows, columns, _ = Entries.joined([*parts, Entries(others, others, np.zeros(len(others)))])
        return SamePlaces(rows, columns, (n, n))

    def _mobility(self, at: Sequence[AxesAt]) -> Matrix:
        """Return what unit forces accelerate where the nodes' equations hold, state after state."""
        (axes, others), parts = self._unbound, list[Array]()
        for own, unbound, touched in zip(at, axes, self._touched, strict=True):
            nothing = np.zeros((1, 1, own.inverse.shape[-1], 1))
            held = own.of(touched).held(unbound, nothing)[0]
            parts.append(held.reshape(len(held), -1))
        parts.append(np.broadcast_to(others, (len(parts[0]), others.shape[1])))
        return self._mobile.of(np.concatenate(parts, axis=1))

    def _joined(self, x: Array) -> _Joined:
        """Return what solutions in states (n_batch, n_x) need."""
        at, J = [kind.at(x) for kind in self.by_nodes.nodes], self._places.of(self._entries(x).values)
        return _Joined(at, J, factorised(J @ self._mobility(at) @ J.T))

    def _solved(self, joined: _Joined, f: Array, gamma: Array) -> tuple[Array, Array]:
        (at, J, closing), rows, nodes = joined, self.by_nodes.rows, self.by_nodes
        a, multipliers = nodes.without_joints(at, f, gamma)
        found = closing(J @ a.ravel() - gamma[:, rows].ravel())
        pushed, more = nodes.without_joints(at, -(J.T @ found).reshape(f.shape), np.zeros_like(gamma))
        multipliers[:, rows], more[:, rows] = 0.0, found.reshape(len(f), -1)
        return a + pushed, multipliers + more

    def solve(self, x: Array, f: Array, gamma: Array) -> tuple[Array, Array]:
        """Return accelerations (n_batch, n) and multipliers (n_batch, n_rows) for forces f (n_batch, n).

        Raises
        ------
        numpy.linalg.LinAlgError
            If the equations of the joints are singular.
        """
        return self._written(self._write_solution, x, f, gamma)

    def at(self, x: Array) -> Callable[[Array, Array], tuple[Array, Array]]:
        """Return what does so in states (n_batch, n_x), for several forces and gammas."""
        return partial(self._solved, self._joined(x))

    def missing(self, x: Array, f: Array, gamma: Array, a: Array) -> tuple[Array, Array]:
        """Return what accelerations a (n_batch, n) miss of the solution, and what the rows miss."""
        return self._written(self._write_missing, x, f, gamma, a)

    def _written(self, write: Callable[..., None], x: Array, f: Array, *others: Array) -> tuple[Array, Array]:
        """Have results written by as many states at a time as suits; on a tape by a call of Python."""
        n, size = f.shape[1], f.shape[1] + others[0].shape[1]
        found = np.zeros((len(f), size))
        for some in slices(len(f), AT_ONCE // size):
            aside(write, x[some], f[some], *(one[some] for one in others), found[some])
        return found[:, :n], found[:, n:]

    def _write_solution(self, x: Array, f: Array, gamma: Array, found: Array) -> None:
        found[:] = np.concatenate(self._solved(self._joined(x), f, gamma), axis=1)

    def _write_missing(self, x: Array, f: Array, gamma: Array, a: Array, found: Array) -> None:
        joined, (n, rows) = self._joined(x), (f.shape[1], self.by_nodes.rows)
        missing = self._solved(joined, f, gamma)[0] - a
        found[:, :n], gaps = missing, found[:, n:]
        self.by_nodes.open_nodes(joined.at, missing, gaps)
        gaps[:, rows] = (joined.jacobian @ missing.ravel()).reshape(len(f), -1)
