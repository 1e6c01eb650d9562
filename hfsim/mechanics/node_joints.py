"""The equations solved node by node where many joints act: what is left at the joints is sparse.

Forces on the axes of a node move no other node, so that the matrix from multipliers of joints to the gaps
that they close has entries only where joints act on the same node: it is far smaller than the whole matrix.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, IntArray, distinct, slices
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import AT_ONCE, Entries, Matrix
from hfsim.maths.scattered import ScatteredSums, SymmetricSums
from hfsim.maths.traced import product
from hfsim.mechanics.axes_rows import AxesAt
from hfsim.mechanics.node_solution import NodeSolution


class _Moved(NamedTuple):
    """What as many rows of joints act on each, of one kind: nodes, or other free coordinates.

    Attributes
    ----------
    kind : int
        Of the nodes; their number for other coordinates.
    own : ndarray of int, shape (m,)
        Which nodes.
    columns : ndarray of int, shape (m, k)
        Free coordinates.
    rows : ndarray of int, shape (m, n_acting)
        Rows of joints that act on them.
    span : slice
        Of the derivatives of these rows, (m, n_acting, k), among those of all.
    """

    kind: int
    own: IntArray
    columns: IntArray
    rows: IntArray
    span: slice


class _Joined(NamedTuple):
    """A batch of states: its nodes, and for all that is moved, part by part, what joints do to it.

    Attributes
    ----------
    jacobians : list of ndarray, shapes (n_batch, m, n_acting, k)
    moved : list of ndarray, shapes (n_batch, m, k, n_acting)
        Accelerations by unit multipliers of joints.
    by_nodes : list of ndarray, shapes (n_batch, m, n_rows, n_acting)
        Multipliers of the nodes by these.
    closing : callable
        From gaps (n_batch, n_joint_rows) to the multipliers that close them.
    """

    at: Sequence[AxesAt]
    jacobians: list[Array]
    moved: list[Array]
    by_nodes: list[Array]
    closing: Callable[[Array], Array]


@frozen
class NodeJoints:
    """Accelerations and multipliers of a scene of many joints where axes of nodes are kept orthonormal.

    Attributes
    ----------
    by_nodes : NodeSolution
        Nodes and joints.
    mass : ndarray, shape (n,)
        Of the free coordinates, each taken alone, with ballast.
    """

    by_nodes: NodeSolution
    mass: Array

    @classmethod
    def of(cls, by_nodes: NodeSolution, whole_mass: Matrix) -> NodeJoints | None:
        """Return the solution; None without joints or where these act on coordinates of coupled mass."""
        if not len(by_nodes.rows):
            return None
        from scipy.sparse import csr_array

        others = csr_array(whole_mass, copy=True)
        found = cls(by_nodes, others.diagonal())
        others.setdiag(0.0)
        coupled = np.asarray(abs(others).sum(axis=1)).ravel()[found._kinds[-1]].any()
        return None if coupled else found

    def _entries(self, x: Array) -> Entries:
        """Return the entries of the derivatives of the joints' rows, (n_joint_rows, n)."""
        return self.by_nodes.reduction.free_entries(self.by_nodes.joints.entries(x))

    @cached_property
    def _at_zero(self) -> Entries:
        return self._entries(np.zeros((1, len(self.by_nodes.reduction.offset))))

    @cached_property
    def _kinds(self) -> list[IntArray]:
        """Free coordinates of the nodes of each kind, and what else joints act on, (n_nodes, k) each."""
        nodes = [kind.free for kind in self.by_nodes.nodes]
        others = np.setdiff1d(self._at_zero.columns, np.concatenate([one.ravel() for one in nodes]))
        return [*nodes, others[:, None]]

    @cached_property
    def _parts(self) -> tuple[tuple[_Moved, ...], ScatteredSums]:
        """All that joints move, and how the entries make the derivatives by it."""
        found, places, end = list[_Moved](), np.empty(len(self._at_zero.rows), dtype=np.intp), 0
        for kind, free in enumerate(self._kinds):
            for part, entries, own in self._acted_on(kind, free):
                size = part.rows.size * free.shape[1]
                places[entries] = end + own
                found.append(part._replace(span=slice(end, end + size)))
                end += size
        return tuple(found), ScatteredSums(places, end)

    def _acted_on(self, kind: int, free: IntArray) -> Iterator[tuple[_Moved, IntArray, IntArray]]:
        """Yield nodes of a kind with as many rows each, their entries, and where in the block these are."""
        rows, columns, _ = self._at_zero
        n_rows, (node, place) = len(self.by_nodes.rows), np.full((2, len(self.mass)), -1)
        node[free], place[free] = np.indices(free.shape)
        entries = np.flatnonzero(node[columns] >= 0)
        acting = node[columns[entries]] * n_rows + rows[entries]
        pairs = distinct(acting)
        counts = np.bincount(pairs // n_rows, minlength=len(free))
        for count in distinct(counts[counts > 0]):
            mine = counts[pairs // n_rows] == count
            own, some = np.flatnonzero(counts == count), np.isin(acting, pairs[mine])
            part = _Moved(kind, own, free[own], (pairs[mine] % n_rows).reshape(-1, count), slice(0))
            number = np.searchsorted(pairs[mine], acting[some])
            yield part, entries[some], number * free.shape[1] + place[columns[entries[some]]]

    @cached_property
    def _sums(self) -> SymmetricSums:
        """Of what parts that are moved contribute to the matrix of the joints."""
        pairs = [np.broadcast_arrays(part.rows[:, :, None], part.rows[:, None]) for part in self._parts[0]]
        i, j = (np.concatenate([one[k].ravel() for one in pairs]) for k in (0, 1))
        return SymmetricSums.of(i, j, len(self.by_nodes.rows))

    @cached_property
    def _alone(self) -> list[Array]:
        """Inverse masses, (m, k, k), by which parts are moved without the nodes' equations."""
        found = list[Array]()
        for kind, own, columns, *_ in self._parts[0]:
            if kind == len(self.by_nodes.nodes):
                found.append(1.0 / self.mass[columns][..., None])
                continue
            nodes = self.by_nodes.nodes[kind]
            mass = nodes.mass[own] + nodes.ballast[own, None, None] * np.eye(nodes.mass.shape[1])
            whole = np.linalg.inv(mass)[:, :, None, :, None] * np.eye(nodes.n_dim)[:, None]
            found.append(whole.reshape(len(own), columns.shape[1], -1))
        return found

    def _joined(self, x: Array) -> _Joined:
        """Return what solutions in states (n_batch, n_x) need."""
        at, (parts, sums) = [kind.at(x) for kind in self.by_nodes.nodes], self._parts
        every = sums.of(self._entries(x).values)
        jacobians, movements, multipliers, pairs = list[Array](), list[Array](), list[Array](), list[Array]()
        for part, alone in zip(parts, self._alone, strict=True):
            J = every[:, part.span].reshape(len(x), *part.rows.shape, -1)
            moved: Array = alone @ J.swapaxes(-1, -2)
            by_nodes = moved[..., :0, :]
            if part.kind < len(at):
                own = at[part.kind].of(part.own)
                moved, by_nodes = own.held(moved, np.zeros((1, 1, own.inverse.shape[-1], 1)))
            jacobians.append(J)
            movements.append(moved)
            multipliers.append(by_nodes)
            pairs.append((J @ moved).reshape(len(x), -1))
        closing = self._sums.factorised(np.concatenate(pairs, axis=1))
        return _Joined(at, jacobians, movements, multipliers, closing)

    @cached_property
    def _by_rows(self) -> ScatteredSums:
        """What opens the rows of the joints, part by part."""
        rows = [part.rows.ravel() for part in self._parts[0]]
        return ScatteredSums(np.concatenate(rows), len(self.by_nodes.rows))

    def _opened(self, joined: _Joined, a: Array) -> Array:
        """Return what accelerations (n_batch, n) open the joints by, (n_batch, n_joint_rows)."""
        pairs = zip(self._parts[0], joined.jacobians, strict=True)
        opened = [(J @ a[:, part.columns][..., None]).reshape(len(a), -1) for part, J in pairs]
        return self._by_rows.of(np.concatenate(opened, axis=1))

    def _solved(self, joined: _Joined, f: Array, gamma: Array) -> tuple[Array, Array]:
        """Return accelerations and multipliers; with slender bodies also of what rounding leaves."""
        a, multipliers = self._solved_once(joined, f, gamma)
        if self.by_nodes.slender:
            left = f - product(self.by_nodes.mass, a.T).T - self._pull(joined, multipliers)
            more = self._solved_once(joined, left, gamma - self._opening(joined, a, gamma))
            a, multipliers = a + more[0], multipliers + more[1]
        return a, multipliers

    def _solved_once(self, joined: _Joined, f: Array, gamma: Array) -> tuple[Array, Array]:
        at, nodes = joined.at, self.by_nodes
        a, multipliers = nodes.without_joints(at, f, gamma)
        found = joined.closing(self._opened(joined, a) - gamma[:, nodes.rows])
        multipliers[:, nodes.rows] = found
        for part, moved, by_nodes in zip(self._parts[0], joined.moved, joined.by_nodes, strict=True):
            acting = found[:, part.rows][..., None]
            a[:, part.columns] -= (moved @ acting)[..., 0]
            if part.kind < len(at):
                multipliers[:, nodes.nodes[part.kind].rows[part.own]] -= (by_nodes @ acting)[..., 0]
        return a, multipliers

    def _pull(self, joined: _Joined, multipliers: Array) -> Array:
        """Return Phi_z^T lambda, shape (n_batch, n)."""
        pull, at_joints = np.zeros((len(multipliers), len(self.mass))), multipliers[:, self.by_nodes.rows]
        for part, J in zip(self._parts[0], joined.jacobians, strict=True):
            pull[:, part.columns] += (at_joints[:, part.rows][..., None, :] @ J)[..., 0, :]
        self.by_nodes.pull_nodes(joined.at, multipliers, pull)
        return pull

    def _opening(self, joined: _Joined, a: Array, gamma: Array) -> Array:
        """Return Phi_z a, of the shape of gamma."""
        opening = np.empty_like(gamma)
        self.by_nodes.open_nodes(joined.at, a, opening)
        opening[:, self.by_nodes.rows] = self._opened(joined, a)
        return opening

    def solve(self, x: Array, f: Array, gamma: Array) -> tuple[Array, Array]:
        """Return accelerations (n_batch, n) and multipliers (n_batch, n_rows) for forces f (n_batch, n).

        Raises
        ------
        numpy.linalg.LinAlgError
            If the equations of the joints are singular.
        """
        return self._in_turn(self._found, x, f, gamma)

    def _found(self, x: Array, f: Array, gamma: Array) -> tuple[Array, Array]:
        return self._solved(self._joined(x), f, gamma)

    def at(self, x: Array) -> Callable[[Array, Array], tuple[Array, Array]]:
        """Return what does so in states (n_batch, n_x), for several forces and gammas."""
        return partial(self._solved, self._joined(x))

    def missing(self, x: Array, f: Array, gamma: Array, a: Array) -> tuple[Array, Array]:
        """Return what accelerations a (n_batch, n) miss of the solution, and what the rows miss."""
        return self._in_turn(self._missing, x, f, gamma, a)

    def _missing(self, x: Array, f: Array, gamma: Array, a: Array) -> tuple[Array, Array]:
        joined = self._joined(x)
        missing = self._solved(joined, f, gamma)[0] - a
        return missing, self._opening(joined, missing, gamma)

    def _in_turn(
        self, solve: Callable[..., tuple[Array, Array]], x: Array, f: Array, *others: Array
    ) -> tuple[Array, Array]:
        """Return results for as many states at a time as memory should hold."""
        turns = slices(len(f), AT_ONCE // (f.shape[1] + others[0].shape[1]))
        found = [solve(x[some], f[some], *(one[some] for one in others)) for some in turns]
        first, second = (list(part) for part in zip(*found, strict=True))
        return np.concatenate(first), np.concatenate(second)
