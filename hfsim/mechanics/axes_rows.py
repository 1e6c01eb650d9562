"""Equations that keep axes of bodies and sections orthonormal, solved node by node.

Each binds the axes of one node alone, whose mass is coupled to nothing else: their multipliers follow from
small matrices, those of all nodes and states at once, and only the rows of joints are left to be solved
together.

Axes of flat and slender bodies have a mass E without an inverse, or with one that rounding spoils.  There
motions are taken apart into turns, which fulfil the rows, and what closes gaps across them.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Matrix, dense
from hfsim.maths.rotations import cross
from hfsim.mechanics.orthonormal import PAIRS, Orthonormal
from hfsim.mechanics.reduction import Reduction

SLENDER = 1e-3
"""Smallest moment of inertia, over the largest, with which one solution is precise enough."""


class Turning(NamedTuple):
    """How three axes in space turn, of nodes with ballast; shapes (n_batch or 1, n_nodes, ...).

    Attributes
    ----------
    mobility : ndarray, shape (..., 9, 9)
        From forces on the axes to accelerations that only turn them.
    mass : ndarray, shape (..., 9, 9)
        E of all components, without ballast.
    ballast : ndarray, shape (..., 1, 1)
    """

    mobility: Array
    mass: Array
    ballast: Array

    @classmethod
    def of(cls, D: Array, mass: Array, ballast: Array) -> Turning:
        """Return it of axes (n_batch, n_nodes, 3, 3): turns about each of them do not mix its moments."""
        turns = cross(D[:, :, :, None], D[:, :, None]).reshape(*D.shape[:2], 3, 9)
        moments = turns @ mass @ turns.swapaxes(-1, -2)
        mobility = turns.swapaxes(-1, -2) @ np.linalg.solve(moments, turns)
        return cls(mobility, mass, ballast[None, :, None, None])

    def forces(self, a: Array, less: Array) -> Array:
        """Return the forces behind accelerations with ballast, less those that others need without it."""
        return self.mass @ (a - less) + self.ballast * a


class AxesAt(NamedTuple):
    """The equations of nodes in a batch of states.

    Attributes
    ----------
    jacobian : ndarray, shape (n_batch, n_nodes, n_rows, n_dim k)
        By the axes of each node.
    moved : ndarray, shape (n_batch, n_nodes, n_rows, n_dim k)
        The accelerations of these that unit multipliers cause.
    inverse : ndarray, shape (n_batch, n_nodes, n_rows, n_rows)
        Of the matrix from multipliers to the accelerations of the rows.
    turns : Turning or None
        Of nodes with ballast; unit masses make the other two then.
    """

    jacobian: Array
    moved: Array
    inverse: Array
    turns: Turning | None = None

    def of(self, nodes: IntArray) -> AxesAt:
        """Return those of some nodes."""
        turns = None if self.turns is None else Turning(*(part[:, nodes] for part in self.turns))
        return AxesAt(self.jacobian[:, nodes], self.moved[:, nodes], self.inverse[:, nodes], turns)

    def held(self, a: Array, gamma: Array) -> tuple[Array, Array]:
        """Return accelerations that the rows allow, and their multipliers.

        Parameters
        ----------
        a : ndarray, shape (n_batch, n_nodes, n_dim k, n_sides)
            Accelerations without these rows, with ballast, of several right-hand sides.
        gamma : ndarray, shape (n_batch, n_nodes, n_rows, n_sides)
            What the rows ask for.
        """
        if self.turns is not None:
            closing = self.moved.swapaxes(-1, -2) @ (self.inverse @ gamma)
            turned = closing + self.turns.mobility @ self.turns.forces(a, closing)
            return turned, self.inverse @ (self.jacobian @ self.turns.forces(a, turned))
        multipliers = self.inverse @ (self.jacobian @ a - gamma)
        return a - self.moved.swapaxes(-1, -2) @ multipliers, multipliers


@frozen
class AxesRows:
    """Equations of all nodes with equally many axes, all with ballast or all without.

    Attributes
    ----------
    columns : ndarray of int, shape (n_nodes, n_dim k)
        Of their axes in x.
    free : ndarray of int, shape (n_nodes, n_dim k)
        The same among free coordinates.
    rows : ndarray of int, shape (n_nodes, n_rows)
        In Phi.
    mass : ndarray, shape (n_nodes, k, k)
        Of the axes, the same for each component.
    ballast : ndarray, shape (n_nodes,)
        What is added on its diagonal.
    n_dim : int
        Of space.
    """

    columns: IntArray
    free: IntArray
    rows: IntArray
    mass: Array
    ballast: Array
    n_dim: int

    @classmethod
    def of(
        cls,
        constraints: Sequence[tuple[Orthonormal, int]],
        reduction: Reduction,
        mass: Matrix,
        ballast: Array,
    ) -> AxesRows:
        """Return the rows of constraints with equally many axes, each with the first row in Phi.

        ``mass`` is the constant mass matrix of x, ``ballast`` what is added on its diagonal, (n_x,).
        """
        columns = np.array([c.axis_columns for c, _ in constraints])
        number = np.zeros(len(reduction.offset), dtype=np.intp)
        number[reduction.rows] = np.arange(len(reduction.rows))
        rows = np.array([start for _, start in constraints])[:, None] + np.arange(constraints[0][0].rows)
        n_dim = constraints[0][0].second.n_dim
        blocks = np.array([dense(mass[one][:, one]) for one in columns[:, ::n_dim]])
        return cls(columns, number[columns], rows, blocks, ballast[columns[:, 0]], n_dim)

    def __len__(self) -> int:
        """Return the number of nodes."""
        return len(self.columns)

    @property
    def slender(self) -> bool:
        """Whether a node with ballast has next to no moment of inertia about one of its axes."""
        sizes = np.linalg.eigvalsh(self.mass[self.ballast > 0.0])
        return bool((sizes[:, :2].sum(axis=1) < SLENDER * sizes[:, 1:].sum(axis=1)).any())

    @property
    def _count(self) -> int:
        return int(self.columns.shape[1]) // self.n_dim

    @cached_property
    def _inverse_mass(self) -> Array:
        return np.linalg.inv(self.mass)

    @cached_property
    def _whole_mass(self) -> Array:
        """The mass of all components, shape (1, n_nodes, n_dim k, n_dim k)."""
        return np.array([[np.kron(own, np.eye(self.n_dim)) for own in self.mass]])

    def axes(self, x: Array) -> Array:
        """Return the axes, shape (n_batch, n_nodes, k, n_dim), in states or of rates (n_batch, n_x)."""
        return x[:, self.columns].reshape(len(x), len(self), -1, self.n_dim)

    def at(self, x: Array) -> AxesAt:
        """Return the equations in states (n_batch, n_x)."""
        D, (equal, one, other) = self.axes(x), PAIRS[self._count]
        J = np.zeros((len(x), len(self), self.rows.shape[1], self._count, self.n_dim))
        for k in equal:
            J[:, :, k, k] = D[:, :, k]
        for row, (i, j) in enumerate(zip(one, other, strict=True), self._count):
            J[:, :, row, i], J[:, :, row, j] = D[:, :, j], D[:, :, i]
        flat = J.reshape(*J.shape[:3], -1)
        turns = Turning.of(D, self._whole_mass, self.ballast) if self.ballast.any() else None
        moved = (self._inverse_mass[:, None] @ J).reshape(flat.shape) if turns is None else flat
        return AxesAt(flat, moved, np.linalg.inv(moved @ flat.swapaxes(-1, -2)), turns)
