"""Increments of planar beams with section vectors, as seen from directions that turn with them."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from hfsim.maths.arrays import BoolArray, ComplexArray, IntArray
from hfsim.maths.frozen import frozen
from hfsim.parts.bodies.planar_natural import PlanarIncrements


@frozen
class SeenIncrements(PlanarIncrements):
    """Increments of vectors as seen from directions.

    Section vectors of nodes are seen from their own: a clamp leaves their length alone, which has to be one
    of the increments.

    Attributes
    ----------
    per_node : int
        Vectors of a node: its place, the slope, and section vectors.
    """

    per_node: int

    @cached_property
    def _numbers(self) -> IntArray:
        """Those of the vectors of a beam, (n_vectors,)."""
        return np.arange((self.columns.stop - self.columns.start) // (2 * self.bodies))

    @cached_property
    def _sections(self) -> BoolArray:
        """Which of them are section vectors of nodes."""
        kind = self._numbers % self.stride
        return (kind > 1) & (kind < self.per_node)

    def _directions(self, z: ComplexArray, others: IntArray) -> ComplexArray:
        """Return the directions, of length one, that vectors are seen from.

        Parameters
        ----------
        z : ndarray, shape (n_batch, n_bodies, n_vectors)
        others : ndarray of int, shape (n_vectors,)
            The vectors that those are seen from that are no section vectors of nodes.
        """
        seen = z.take(np.where(self._sections, self._numbers, others), axis=-1)
        return np.asarray(seen / np.abs(seen))
