"""Increments of planar beams as their nodes see them, for beams without natural coordinates of their strains.

The stiffness of a beam between its own nodes is nearly the same there however far it has turned.  Places of
nodes are relative to the first one, so that joints can lead the beam along.
"""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array, ComplexArray
from hfsim.maths.frozen import frozen
from hfsim.parts.bodies.planar_seen import SeenIncrements


@frozen
class CarriedBeams(SeenIncrements):
    """Vectors of alike beams as seen from the second vector of the node before them.

    A geometry are these directions of all vectors, (n_batch, n_bodies, n_vectors), of length one.
    """

    def geometry(self, q: Array) -> ComplexArray:
        """Return the direction that each vector is seen from."""
        return self._directions(self._complex(q), self._numbers // self.stride * self.stride + 1)

    def spins(self, y1: Array) -> Array:
        """Return the mean rates of the second vectors of nodes, which are about of length one."""
        turns = self._complex(y1).imag[..., 1 :: self.stride]
        return np.asarray(turns.sum(axis=-1) / turns.shape[-1])

    def to_natural(self, at: ComplexArray, dq: Array, out: Array) -> None:
        """Write small changes ``dq`` as the nodes see them into ``out``."""
        y = self._complex(dq).copy()
        root = y[..., :1].copy()
        y[..., :: self.stride] -= root
        y *= at.conj()
        y[..., :1] = root
        self._put(y, out)

    def from_natural(self, at: ComplexArray, y: Array, out: Array) -> None:
        """Write the changes of the state that belong to increments into ``out``."""
        c = self._complex(y)
        dz = np.asarray(c * at)
        dz[..., 0] = 0.0
        dz[..., :: self.stride] += c[..., :1]
        self._put(dz, out)

    advance = from_natural

    def to_natural_forces(self, at: ComplexArray, f: Array, out: Array) -> None:
        """Write forces on the increments into ``out``: the transpose of `from_natural`."""
        c = self._complex(f)
        y = np.asarray(c * at.conj())
        y[..., 0] = c[..., :: self.stride].sum(axis=-1)
        self._put(y, out)

    def convective(self, at: ComplexArray, u: Array, y1: Array, out: Array) -> None:
        """Leave ``out`` as it is: the directions stand still."""
