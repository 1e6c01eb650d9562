"""A beam cut into equal elements: nodal vectors, mass matrix, shape rows, difference vectors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hfsim.arrays import Array
from hfsim.elements import Element
from hfsim.elements._base import Inertia


@dataclass(frozen=True)
class BeamMesh:
    """Equal elements in a row; the nodal vectors are those of node 0, node 1, ...

    Each node has ``element.per_node`` vectors: its position, its slope vector and, for elements with
    a section, the other gradient vector.

    Attributes
    ----------
    element : Element
    count : int
        Number of elements.
    inertia : Inertia
        Mass per length and the like.
    """

    element: Element
    count: int
    inertia: Inertia

    @property
    def length(self) -> float:
        """Undeformed length [m]."""
        return self.element.length * self.count

    @property
    def n_vectors(self) -> int:
        """Number of nodal vectors."""
        return (self.count + 1) * self.element.per_node

    @cached_property
    def undeformed(self) -> Array:
        """Nodal vectors of the straight beam along the first axis, shape (n_vectors, 2)."""
        P = np.zeros((self.count + 1, self.element.per_node, 2))
        P[:, 0, 0] = self.element.length * np.arange(self.count + 1)
        P[:, 1, 0] = 1.0
        P[:, 2:, 1] = 1.0
        return P.reshape(-1, 2)

    @cached_property
    def positions(self) -> Array:
        """One for nodal vectors that are positions, zero for gradients, shape (n_vectors,)."""
        return np.tile(np.eye(self.element.per_node)[0], self.count + 1)

    @cached_property
    def mass(self) -> Array:
        """Mass matrix of one vector component, int rho N^T N dV of eq. (12), shape (n_vectors, n_vectors)."""
        k = self.element.per_node
        M = np.zeros((self.n_vectors, self.n_vectors))
        block = self.element.mass(self.inertia)
        for e in range(self.count):
            M[e * k : (e + 2) * k, e * k : (e + 2) * k] += block
        return M

    @cached_property
    def differences(self) -> Array:
        """Matrix from nodal vectors to the difference vectors of all elements, (count * n, n_vectors)."""
        local = self.element.differences()
        k, n = self.element.per_node, len(local)
        D = np.zeros((self.count * n, self.n_vectors))
        for e in range(self.count):
            D[e * n : (e + 1) * n, e * k : (e + 2) * k] = local
        return D

    def shape(self, x: float, y: float = 0.0, derivative: tuple[int, int] = (0, 0)) -> Array:
        """Return the shape row N(x, y), or a derivative of it, over all nodal vectors, (n_vectors,)."""
        k = self.element.per_node
        e = min(int(x / self.element.length), self.count - 1)
        row = np.zeros(self.n_vectors)
        row[e * k : (e + 2) * k] = self.element.shape(x / self.element.length - e, y, derivative)
        return row
