"""Natural increments of planar beams whose elastic force is linear in the axes of their root.

All vectors are seen in these axes, places relative to the root; of the slope there, which turns them, stretch
and angle.  The mass matrix of a beam is constant so, and its stiffness changes with its deflection alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, ComplexArray
from hfsim.maths.frozen import frozen
from hfsim.maths.traced import changeable
from hfsim.parts.bodies.planar_frame import ROOT
from hfsim.parts.bodies.planar_seen import SeenIncrements


class Seen(NamedTuple):
    """Alike beams in a batch of states.

    Attributes
    ----------
    slope : ndarray of complex, shape (n_batch, n_bodies, 1)
        Slope at the root.
    turn, p : ndarray of complex, shape (n_batch, n_bodies, n_vectors)
        The directions that vectors are seen from, that of the slope at the root but for section vectors of
        nodes, and the vectors seen so.
    """

    slope: ComplexArray
    turn: ComplexArray
    p: ComplexArray


@frozen
class RootedBeams(SeenIncrements):
    """Natural increments of alike beams of the model linear."""

    def geometry(self, q: Array) -> Seen:
        """Return what the maps below need of a batch of states."""
        z = self._complex(q)
        turn = self._directions(z, np.full_like(self._numbers, ROOT))
        return Seen(_root(z), turn, self._seen(z, turn))

    def spins(self, y1: Array) -> Array:
        """Return the rates of the roots."""
        return np.asarray(self._complex(y1).imag[..., ROOT])

    def to_natural(self, at: Seen, dq: Array, out: Array) -> None:
        """Write the natural increments of small changes ``dq`` into ``out``."""
        c = self._complex(dq)
        self._join(self._seen(c, at.turn), c[..., :1], _root(c) / at.slope, out)

    def from_natural(self, at: Seen, y: Array, out: Array) -> None:
        """Write the changes of the state that belong to small natural increments into ``out``."""
        c = self._complex(y)
        self._place(c * at.turn, c, _root(c) * at.slope, out)

    def to_natural_forces(self, at: Seen, f: Array, out: Array) -> None:
        """Write forces on natural increments into ``out``: the transpose of `from_natural`."""
        c = self._complex(f)
        whole = c[..., :: self.stride].sum(axis=-1)[..., None]
        self._join(c * at.turn.conj(), whole, _root(c) * at.slope.conj(), out)

    def advance(self, at: Seen, y: Array, out: Array) -> None:
        """Write the change of the state that adds finite natural increments into ``out``.

        The beam turns with its root, and deforms in the axes there by what else is asked for.
        """
        c = self._complex(y)
        root = _root(c)
        angle = 1j * root.imag
        deformed = at.p + c - angle * at.p
        dz = (deformed * np.exp(angle) - at.p) * at.turn
        self._place(dz, c, (np.exp(root) - 1.0) * at.slope, out)

    def convective(self, at: Seen, u: Array, y1: Array, out: Array) -> None:
        """Write what velocities alone make of the second derivatives of natural coordinates into ``out``."""
        rate = self._complex(y1)
        root = _root(rate)
        spin = np.where(self._sections, rate.imag / np.where(self._sections, at.p.real, 1.0), root.imag)
        self._join((-1j * spin) * rate, np.zeros_like(root), -(root * root), out)

    def _seen(self, z: ComplexArray, turn: ComplexArray) -> ComplexArray:
        """Return vectors, or changes of them, in the axes of the root."""
        found = changeable(z)
        found[..., :: self.stride] -= z[..., :1]
        return np.asarray(found * turn.conj())

    def _place(self, dz: ComplexArray, c: ComplexArray, slope: ComplexArray, out: Array) -> None:
        """Write changes ``dz`` beside the root, of which ``c`` has the place, into ``out``."""
        dz[..., :: self.stride] += c[..., :1]
        self._join(dz, c[..., :1], slope, out)

    def _join(self, y: ComplexArray, place: ComplexArray, slope: ComplexArray, out: Array) -> None:
        """Write vectors, of which those of the root are these, into ``out``."""
        y[..., :1], y[..., ROOT : ROOT + 1] = place, slope
        self._put(y, out)


def _root(z: ComplexArray) -> ComplexArray:
    """Return the slope at the root, or its change."""
    return z[..., ROOT : ROOT + 1]
