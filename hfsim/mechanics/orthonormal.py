"""What keeps axes that are coordinates orthonormal: those of rigid bodies in space and of sections."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from hfsim.maths.arrays import Array, IntArray, on_components
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.products import LinearVector, Product


@frozen
class Orthonormal(Constraint):
    """The axes among the second marker's columns, which follow a position, are orthonormal."""

    unit: ClassVar[str] = "-"
    why_kept: ClassVar[str] = "axes of bodies and sections keep lengths and angles"

    @property
    def axis_columns(self) -> IntArray:
        """Columns of the axes."""
        return np.arange(self.second.columns.start + self.second.n_dim, self.second.columns.stop)

    @property
    def _count(self) -> int:
        """Number of axes: three of a rigid body in space, of a beam's section one less than dimensions."""
        return int(self.second.columns.stop - self.second.columns.start) // self.second.n_dim - 1

    @property
    def rows(self) -> int:
        """As many lengths as axes, and an angle of each pair."""
        return self._count * (self._count + 1) // 2

    def _axes(self, x: Array) -> Array:
        """Return the axes, shape (n_batch, n_axes, n_dim)."""
        return x[:, self.second.columns].reshape(len(x), -1, self.second.n_dim)[:, 1:]

    @property
    def products(self) -> tuple[Product, ...]:
        """The products of its axes."""
        _, first, other = PAIRS[self._count]
        columns = np.arange(self.second.columns.start, self.second.columns.stop)
        d = [LinearVector.at(own) for own in columns.reshape(-1, self.second.n_dim)[1:]]
        angles = (Product(d[i], d[j]) for i, j in zip(first, other, strict=True))
        return (*(Product(one, one, 0.5, 0.5) for one in d), *angles)

    def gap(self, x: Array) -> Array:
        """Return half of what squares miss of one, and products of zero."""
        D, (equal, one, other) = self._axes(x), PAIRS[self._count]
        G = D @ D.swapaxes(1, 2)
        return np.concatenate([0.5 * (G[:, equal, equal] - 1.0), G[:, one, other]], axis=1)

    def jacobian(self, end: int, x: Array) -> Array:
        """Return the products of axes with changes of axes."""
        marker, (equal, one, other) = self.ends[end], PAIRS[self._count]
        J = np.zeros((len(x), self.rows, marker.columns.stop - marker.columns.start))
        if end:
            D = self._axes(x)
            blocks = J.reshape(len(x), self.rows, -1, marker.n_dim)[:, :, 1:]
            for k in equal:
                blocks[:, k, k] = D[:, k]
            for row, (i, j) in enumerate(zip(one, other, strict=True), self._count):
                blocks[:, row, i], blocks[:, row, j] = D[:, j], D[:, i]
        return J

    def bias(self, x: Array, u: Array) -> Array:
        """Return twice the products of the rates of axes, once for equal ones."""
        D, (equal, one, other) = self._axes(u), PAIRS[self._count]
        G = D @ D.swapaxes(1, 2)
        return np.concatenate([G[:, equal, equal], 2.0 * G[:, one, other]], axis=1)

    def stiffness(self, x: Array, multipliers: Array) -> Entries:
        """Return the symmetric matrix of the multipliers, the same for each component."""
        (_, one, other), n_dim = PAIRS[self._count], self.second.n_dim
        L = np.diag(multipliers[0, : self._count])
        L[one, other] = L[other, one] = multipliers[0, self._count :]
        return Entries.of_block(self.axis_columns, self.axis_columns, on_components(L, n_dim))

    def reaction(self, x: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return nothing: these forces are inside the body."""
        return np.zeros((len(x), self.second.n_dim)), np.zeros((len(x), self.second.n_spin))


PAIRS: dict[int, tuple[list[int], list[int], list[int]]] = {
    1: ([0], [], []),
    2: ([0, 1], [0], [1]),
    3: ([0, 1, 2], [1, 2, 0], [2, 0, 1]),
}
"""By the number of axes: which have a length, and both axes of each pair."""
