"""Places that lead others along: a line is moved on as a whole where its beginning moves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries, Matrix, assemble, factorised, is_sparse
from hfsim.mechanics.reduction import Reduction


@frozen
class Leading:
    """Changes of the state, those of some places relative to the places that lead them along.

    Attributes
    ----------
    matrix : Matrix, shape (n, n)
        Relative changes, as rows, are changes of the state times this.
    """

    matrix: Matrix

    @classmethod
    def of(cls, chains: Sequence[IntArray], reduction: Reduction) -> Leading | None:
        """Return that of chains of places, columns of x (n_places, 3) each of which leads the next one.

        A chain begins at the ground or at a place of another one; what else it is tied to need not turn
        along, as a ring in which a shaft turns, and does not lead.  None is returned where nothing leads, or
        all lead one another in a ring.
        """
        n, basis, number = len(reduction.rows), reduction.basis, reduction.numbers
        before = np.concatenate([one[:-1].ravel() for one in chains])
        after = number[np.concatenate([one[1:].ravel() for one in chains])]
        before, after = before[after >= 0], after[after >= 0]
        led, column = basis[before].nonzero()
        ours = np.isin(column, number[np.concatenate([one.ravel() for one in chains])])
        led, column = led[ours], column[ours]
        if not len(led):
            return None
        every, rates = np.arange(n), np.asarray(basis[before[led], column]).ravel()
        entries = [Entries(every, every, np.ones(n)), Entries(column, after[led], -rates)]
        found = cls(assemble(entries, (n, n), is_sparse(basis)))
        try:
            found.absolute(np.zeros((1, n)))
        except np.linalg.LinAlgError:
            return None
        return found

    def relative(self, changes: Array) -> Array:
        """Return changes (n_batch, n) of the state relative to what leads them along."""
        return np.asarray(changes @ self.matrix)

    def absolute(self, changes: Array) -> Array:
        """Return the changes of the state that relative ones make."""
        return self._solve(changes) if is_sparse(self.matrix) else np.asarray(changes @ self._inverse)

    def forces(self, f: Array) -> Array:
        """Return forces on relative changes: the transpose of `absolute`."""
        return self._solve_forces(f) if is_sparse(self.matrix) else np.asarray(f @ self._inverse.T)

    @cached_property
    def _inverse(self) -> Array:
        return np.linalg.inv(self.matrix)

    @cached_property
    def _solve(self) -> Callable[[Array], Array]:
        return factorised(self.matrix.T)

    @cached_property
    def _solve_forces(self) -> Callable[[Array], Array]:
        return factorised(self.matrix)
