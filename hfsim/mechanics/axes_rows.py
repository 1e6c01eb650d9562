"""Equations that keep axes of bodies and sections orthonormal, solved node by node.

Each binds the axes of one node alone, whose mass is coupled to nothing else: their multipliers follow from
small matrices, those of all nodes and states at once, and only the rows of joints are left to be solved
together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.matrices import Matrix, dense
from hfsim.mechanics.orthonormal import PAIRS, Orthonormal
from hfsim.mechanics.reduction import Reduction


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
    """

    jacobian: Array
    moved: Array
    inverse: Array

    def of(self, nodes: IntArray) -> AxesAt:
        """Return those of some nodes."""
        return AxesAt(*(part[:, nodes] for part in self))

    def held(self, a: Array, gamma: Array) -> tuple[Array, Array]:
        """Return accelerations that the rows allow, and their multipliers.

        Parameters
        ----------
        a : ndarray, shape (n_batch, n_nodes, n_dim k, n_sides)
            Accelerations without these rows, of several right-hand sides.
        gamma : ndarray, shape (n_batch, n_nodes, n_rows, n_sides)
            What the rows ask for.
        """
        multipliers = self.inverse @ (self.jacobian @ a - gamma)
        return a - self.moved.swapaxes(-1, -2) @ multipliers, multipliers


@dataclass(frozen=True, eq=False)
class AxesRows:
    """Equations of all nodes with equally many axes.

    Attributes
    ----------
    columns : ndarray of int, shape (n_nodes, n_dim k)
        Of their axes in x.
    free : ndarray of int, shape (n_nodes, n_dim k)
        The same among free coordinates.
    rows : ndarray of int, shape (n_nodes, n_rows)
        In Phi.
    inverse_mass : ndarray, shape (n_nodes, k, k)
        Of the axes, the same for each component.
    n_dim : int
        Of space.
    """

    columns: IntArray
    free: IntArray
    rows: IntArray
    inverse_mass: Array
    n_dim: int

    @classmethod
    def of(
        cls, constraints: Sequence[tuple[Orthonormal, int]], reduction: Reduction, mass: Matrix
    ) -> AxesRows:
        """Return the rows of constraints with equally many axes, each with the first row in Phi.

        ``mass`` is the constant mass matrix of x.
        """
        columns = np.array([c.axis_columns for c, _ in constraints])
        number = np.zeros(len(reduction.offset), dtype=np.intp)
        number[reduction.rows] = np.arange(len(reduction.rows))
        rows = np.array([start for _, start in constraints])[:, None] + np.arange(constraints[0][0].rows)
        n_dim = constraints[0][0].second.n_dim
        blocks = np.array([dense(mass[one][:, one]) for one in columns[:, ::n_dim]])
        return cls(columns, number[columns], rows, np.linalg.inv(blocks), n_dim)

    def __len__(self) -> int:
        """Return the number of nodes."""
        return len(self.columns)

    @property
    def _count(self) -> int:
        return int(self.columns.shape[1]) // self.n_dim

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
        moved = (self.inverse_mass[:, None] @ J).reshape(*J.shape[:3], -1)
        flat = J.reshape(moved.shape)
        return AxesAt(flat, moved, np.linalg.inv(moved @ flat.swapaxes(-1, -2)))
