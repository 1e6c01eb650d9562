"""The joint equations Phi(x, t) = 0 of a scene: one row below the other, for all states at once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, BoolArray, IntArray, Places, run_of
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import NOTHING, Entries, Matrix, assemble, is_sparse
from hfsim.maths.rotations import wrap
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.markers import joint_support
from hfsim.mechanics.products import Product, Products, VectorProducts

MANY = 6
"""Equations with axes across sections from which they are evaluated all at once, in large scenes."""
FEW_DENSE = 100_000
"""Entries up to which dense rows win in large scenes (at 60,000, 7 us against 14; at 300,000, 37 and 17)."""


class End(NamedTuple):
    """One end of a constraint: a block of the Jacobian.

    Attributes
    ----------
    number : int
        0 for the first end, 1 for the second.
    rows : slice
        Of the constraint in Phi.
    columns : ndarray of int
        Coordinates in x that the end depends on.
    kept, place : slice or ndarray of int
        Where these stand among the coordinates of the body, and among those at the joints.
    """

    constraint: Constraint
    number: int
    rows: slice
    columns: IntArray
    kept: Places
    place: Places

    @classmethod
    def of(cls, constraint: Constraint, number: int, rows: slice, support: IntArray) -> End:
        """Return an end of a constraint, ``support`` being the coordinates at the joints."""
        marker = constraint.ends[number]
        kept = run_of(marker.support - marker.columns.start)
        place = run_of(np.searchsorted(support, marker.support))
        return cls(constraint, number, rows, marker.support, kept, place)

    @property
    def still(self) -> bool:
        """Whether the block never changes."""
        return self.constraint.still[self.number]

    @property
    def places(self) -> tuple[IntArray, IntArray]:
        """Rows and columns of the entries of the block."""
        rows = np.arange(self.rows.start, self.rows.stop)
        return np.repeat(rows, len(self.columns)), np.tile(self.columns, len(rows))

    def jacobian(self, x: Array) -> Array:
        """Return the block, shape (n_batch or 1, rows, k)."""
        return self.constraint.jacobian(self.number, x)[..., self.kept]

    def values(self, x: Array) -> Array:
        """Return its entries, shape (n_batch, n_entries)."""
        block = self.jacobian(x)
        return np.broadcast_to(block.reshape(len(block), -1), (len(x), block[0].size))


@frozen
class JointRows:
    """Constraints of a scene.

    Attributes
    ----------
    n_x : int
        Number of coordinates.
    sparse : bool
        Whether `jacobian_at` gives a sparse matrix.
    """

    constraints: tuple[Constraint, ...]
    n_x: int
    sparse: bool

    @cached_property
    def rows(self) -> tuple[slice, ...]:
        """Rows of each constraint in Phi."""
        ends = np.cumsum([0] + [c.rows for c in self.constraints])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))

    @cached_property
    def n_rows(self) -> int:
        """Number of equations."""
        return sum(c.rows for c in self.constraints)

    @cached_property
    def _of_unit_axes(self) -> BoolArray:
        """Which rows hold lengths and angles of unit vectors: of size one in any scene."""
        return np.array([c.unit == "-" for c in self.constraints for _ in range(c.rows)], dtype=bool)

    def about(self, columns: slice) -> slice:
        """Return the rows from the first to the last one that depends on some of these coordinates."""
        found = [
            rows
            for c, rows in self._pairs
            if any(((end.support >= columns.start) & (end.support < columns.stop)).any() for end in c.ends)
        ]
        return slice(found[0].start, found[-1].stop) if found else slice(0, 0)

    def scales(self, size: Array) -> Array:
        """Return the sizes of what rows compare, (n_rows,), where coordinates are of a size, shape ()."""
        return np.where(self._of_unit_axes, 1.0, size)

    @cached_property
    def constant(self) -> bool:
        """Whether Phi_x is the same for every state."""
        return all(c.constant for c in self.constraints)

    @cached_property
    def support(self) -> IntArray:
        """Columns of x that the constraints depend on."""
        return joint_support(*(marker for c in self.constraints for marker in c.ends))

    @property
    def _pairs(self) -> Iterator[tuple[Constraint, slice]]:
        return zip(self.constraints, self.rows, strict=True)

    @cached_property
    def _products(self) -> tuple[VectorProducts[Any], ...]:
        """The equations that are products, where there are any and not all equations are linear.

        Those with axes across sections are too where there are many.
        """
        if self.constant:
            return ()
        linear = [(one, rows.start + k) for c, rows in self._pairs for k, one in enumerate(c.products)]
        found = [Products(*self._listed(linear))] if linear else list[VectorProducts[Any]]()
        pairs = self._pairs if self.sparse else ()
        crossed = [(one, rows.start + k) for c, rows in pairs for k, one in enumerate(c.crossed)]
        if len(crossed) < MANY:
            return tuple(found)
        from hfsim.mechanics.crossed import CrossedProducts

        return *found, CrossedProducts(*self._listed(crossed))

    def _listed(self, found: list[tuple[Product, int]]) -> tuple[IntArray, list[Product], int, bool]:
        rows = np.array([row for _, row in found], dtype=np.intp)
        return rows, [one for one, _ in found], self.n_x, self.sparse

    @cached_property
    def _others(self) -> tuple[tuple[Constraint, slice], ...]:
        """The other constraints, with their rows."""
        own = {row for part in self._products for row in part.rows.tolist()}
        return tuple((c, rows) for c, rows in self._pairs if rows.start not in own)

    @cached_property
    def _changing(self) -> tuple[tuple[Constraint, slice], ...]:
        """Those of them whose Jacobian depends on the state."""
        return tuple((c, rows) for c, rows in self._others if not c.constant)

    # ------------------------------------------------------------------ what they miss

    def residual(self, t: Array, x: Array) -> Array:
        """Return Phi, shape (n_batch, n_rows)."""
        out = self._constant_product(x) + self._origin_residual
        if len(self._wrapped):
            out[:, self._wrapped] = wrap(out[:, self._wrapped])
        for constraint, rows in self._changing:
            out[:, rows] = constraint.residual(t, x)
        for part in self._products:
            out[:, part.rows] = part.gap(x)
        return out

    def drift(self, t: Array, x: Array, u: Array) -> Array:
        """Return Phi' = Phi_x u + Phi_t, shape (n_batch, n_rows)."""
        drift = self._constant_product(u) + self.rate(t)
        for end in self._changing_ends:
            drift[:, end.rows] += (end.jacobian(x) @ u[:, end.columns, None])[..., 0]
        for part in self._products:
            drift[:, part.rows] = part.rate(x, u)
        return drift

    def rate(self, t: Array) -> Array:
        """Return Phi_t, shape (n_batch, n_rows)."""
        rate = np.zeros((len(t), self.n_rows))
        for constraint, rows in self._changing:
            if constraint.driven:
                rate[:, rows] = constraint.rate(t)
        return rate

    def curvature(self, t: Array, x: Array, u: Array) -> Array:
        """Return gamma of eq. (37), shape (n_batch, n_rows)."""
        gamma = np.zeros((len(x), self.n_rows))
        for constraint, rows in self._changing:
            gamma[:, rows] = constraint.acceleration(t, x, u)
        for part in self._products:
            gamma[:, part.rows] = -part.bias(x, u)
        return gamma

    def _constant_product(self, x: Array) -> Array:
        """Return what the constant part of the Jacobian makes of coordinates, shape (n_batch, n_rows)."""
        transpose = self._constant_transpose
        return np.asarray((x if is_sparse(transpose) else x[:, self.support]) @ transpose)

    @cached_property
    def _constant_transpose(self) -> Matrix:
        """That part, transposed: by the coordinates at the joints, or by all where it is sparse."""
        if self.sparse and (self.constant or self.n_rows * len(self.support) > FEW_DENSE):
            return self._assembled(self.still_entries).T.tocsr()
        return np.ascontiguousarray(self._constant_rows[0].T)

    @cached_property
    def _origin_residual(self) -> Array:
        """Residual of linear constraints where all coordinates are zero, (1, n_rows); zero for others."""
        out = np.zeros((1, self.n_rows))
        for constraint, rows in self._others:
            if constraint.constant:
                out[:, rows] = constraint.residual(np.zeros(1), self._origin)
        return out

    @cached_property
    def _wrapped(self) -> IntArray:
        """Rows of linear constraints in which full turns do not count."""
        rows = [np.r_[rows] for c, rows in self._others if c.constant and c.wraps]
        return np.concatenate([np.zeros(0, dtype=np.intp), *rows])

    @cached_property
    def _origin(self) -> Array:
        """Coordinates zero, (1, n_x): where a Jacobian that never changes is evaluated."""
        return np.zeros((1, self.n_x))

    # ------------------------------------------------------------------ how that depends on the coordinates

    @cached_property
    def ends(self) -> tuple[End, ...]:
        """The ends, on bodies, of the constraints that are not evaluated as products."""
        return tuple(
            End.of(c, k, rows, self.support)
            for c, rows in self._others
            for k, marker in enumerate(c.ends)
            if not marker.grounded
        )

    @cached_property
    def _changing_ends(self) -> tuple[End, ...]:
        """Those of them whose block depends on the state."""
        return tuple(end for end in self.ends if not end.still)

    def jacobians(self, x: Array) -> Array:
        """Return Phi_x by the coordinates x, dense, shape (n_batch or 1, n_rows, n_x)."""
        J = self.at_joints(x)
        Phi_x = np.zeros((*J.shape[:2], x.shape[1]))
        Phi_x[..., self.support] = J
        return Phi_x

    def jacobian_at(self, x: Array) -> Matrix:
        """Return Phi_x of one state (1, n_x), shape (n_rows, n_x)."""
        if not self.sparse:
            return self.jacobians(x)[0]
        return self._assembled(self.entries(x))

    def _assembled(self, entries: Entries) -> Matrix:
        """Return the sparse matrix of entries of one state, values (1, n_entries)."""
        return assemble([entries._replace(values=entries.values[0])], (self.n_rows, self.n_x), sparse=True)

    def entries(self, x: Array) -> Entries:
        """Return the entries of Phi_x in states (n_batch, n_x), their values (n_batch, n_entries)."""
        still = self.still_entries
        parts = [still._replace(values=np.broadcast_to(still.values, (len(x), still.values.shape[1])))]
        changing = zip(self._changing_ends, self._changing_places, strict=True)
        parts += [Entries(*places, end.values(x)) for end, places in changing]
        return Entries.joined([*parts, *(part.entries(x) for part in self._products)])

    @cached_property
    def still_entries(self) -> Entries:
        """Entries of Phi_x that never change, values (1, n_entries)."""
        nothing = NOTHING._replace(values=np.zeros((1, 0)))
        still = (end for end in self.ends if end.still)
        return Entries.joined([nothing, *(Entries(*end.places, end.values(self._origin)) for end in still)])

    @cached_property
    def _changing_places(self) -> tuple[tuple[IntArray, IntArray], ...]:
        """Places of the others, end by end."""
        return tuple(end.places for end in self._changing_ends)

    def at_joints(self, x: Array) -> Array:
        """Return Phi_x by the coordinates `support` alone, shape (n_batch or 1, n_rows, k)."""
        if self.constant:
            return self._constant_rows
        J = self._with(self._changing_ends, np.repeat(self._constant_rows, len(x), axis=0), x)
        for part in self._products:
            J[:, part.rows] += part.jacobian(x, self.support)
        return J

    @cached_property
    def _constant_rows(self) -> Array:
        """What never changes of the Jacobian by the coordinates at the joints, shape (1, n_rows, k)."""
        still = [end for end in self.ends if end.still]
        return self._with(still, np.zeros((1, self.n_rows, len(self.support))), self._origin)

    def _with(self, ends: Iterable[End], J: Array, x: Array) -> Array:
        """Add the blocks of ends."""
        for end in ends:
            J[:, end.rows, end.place] += end.jacobian(x)
        return J

    def stiffness(self, x: Array, multipliers: Array) -> list[Entries]:
        """Return the derivative of Phi_x^T lambda by x in one state, multipliers (1, n_rows)."""
        parts = [c.stiffness(x, multipliers[:, rows]) for c, rows in self._changing]
        return parts + [part.stiffness(x, multipliers[0, part.rows]) for part in self._products]

    @property
    def are_products(self) -> bool:
        """Whether the derivative of Phi_x is the same in all states."""
        return not self._changing and all(isinstance(part, Products) for part in self._products)

    def bend(self) -> Array:
        """Return that derivative, (n_rows, n_x, n_x), where it is."""
        bend = np.zeros((self.n_rows, self.n_x, self.n_x))
        for part in self._products:
            assert isinstance(part, Products)
            bend[part.rows] = part.bend()
        return bend
