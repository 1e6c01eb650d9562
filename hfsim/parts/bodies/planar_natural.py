"""Natural increments: coordinates in which the stiffness of a beam hardly changes as it moves.

The axial stiffness of a beam couples to the change of its slopes: in nodal vectors a Newton matrix
taken at one state serves only for small changes.  In *natural* coordinates it serves for large ones:
the logarithm of each gradient vector (stretch and angle), and of each element the mean Green strain
of its centre line and the angle of its chord.  Only Newton corrections are expressed in them; the
equations stay those of the state coordinates, and so do the results.

Planar vectors are complex numbers; everything has a leading batch axis.  Natural coordinates stand
where the coordinates they replace stand: root position; logarithm of a gradient vector; mean strain
+ i chord angle of element e in the place of the position of node e + 1; strain moment + i normal
component in the place of an interior vector.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array, ComplexArray
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.maths.traced import changeable
from hfsim.mechanics.increments import BodyIncrements
from hfsim.parts.bodies.planar_frame import ROOT, relative, with_root
from hfsim.parts.elements.polynomial import mean_square_slope


@frozen
class PlanarIncrements(BodyIncrements):
    """Increments of beams whose vectors are complex numbers.

    Attributes
    ----------
    stride : int
        Vectors from one nodal position to the next.
    """

    stride: int

    def _complex(self, q: Array) -> ComplexArray:
        part = q[:, self.columns].reshape(len(q), self.bodies, -1)
        return np.ascontiguousarray(part).view(np.complex128)

    def _put(self, z: ComplexArray, out: Array) -> None:
        out[:, self.columns] = z.reshape(len(out), -1).view(np.float64)

    def turned(self) -> Entries:
        """Return the map from changes to their rates where all vectors of beams turn at 1 rad/s."""
        x = np.arange(self.columns.start, self.columns.stop).reshape(-1, 2)
        return Entries.of_turns(x, x)

    def shifted(self) -> Entries:
        """Return what makes of these rates those about their first nodes."""
        x = np.arange(self.columns.start, self.columns.stop).reshape(self.bodies, -1, 2)
        places = x[:, :: self.stride]
        return Entries.of_turns(places, np.broadcast_to(places[:, :1], places.shape), -1.0)


@frozen
class BeamIncrements(PlanarIncrements):
    """What natural increments of all beams have in common.

    Attributes
    ----------
    length : float
        Element length [m].
    framed : bool
        Whether the state has a body frame.
    """

    length: float
    framed: bool

    def spins(self, y1: Array) -> Array:
        """Return the mean rates of the chords; nothing turns in its own frame."""
        chords = self._complex(y1).imag[..., self.stride :: self.stride]
        share = 0.0 if self.framed else 1.0 / chords.shape[-1]
        return np.asarray(share * chords.sum(axis=-1))

    def _vectors(self, c: ComplexArray) -> ComplexArray:
        """Return nodal vectors, or changes of them, as seen from the frame."""
        return relative(c) if self.framed else c

    def _parts(self, z: ComplexArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return chords over the element length, first and last slopes of all elements."""
        places, slopes = z[..., :: self.stride], z[..., 1 :: self.stride]
        return (places[..., 1:] - places[..., :-1]) * (1.0 / self.length), slopes[..., :-1], slopes[..., 1:]

    def _small_turns(self, z: ComplexArray, c: ComplexArray) -> ComplexArray:
        """Return small changes of gradient vectors by stretch and angle; those of positions as they may."""
        dz = np.asarray(c * z)
        if self.framed:
            dz[..., ROOT] = c.real[..., ROOT] * z[..., ROOT]
        return dz

    def _on_slopes(
        self, z: ComplexArray, c: ComplexArray, first: ComplexArray, last: ComplexArray
    ) -> ComplexArray:
        """Return forces with those on stretch and angle of gradient vectors in place.

        ``first`` and ``last`` are what the given strains take from each element's slopes.
        """
        left = c.copy()
        slopes = left[..., 1 :: self.stride]
        slopes[..., :-1] -= first
        slopes[..., 1:] -= last
        return np.asarray(left * z.conj())

    def _beyond(self, c: ComplexArray) -> ComplexArray:
        """Return the sum of the forces on all nodes beyond each element."""
        places = c[..., self.stride :: self.stride]
        return np.asarray(np.cumsum(places[..., ::-1], axis=-1)[..., ::-1])

    def _join(self, dz: ComplexArray, dd: ComplexArray, c: ComplexArray, out: Array) -> None:
        """Put changes of chords and gradient vectors together into a change of the state."""
        root = 0.0 if self.framed else c[..., :1]
        dz[..., self.stride :: self.stride] = np.cumsum(dd * self.length, axis=-1) + root
        dz[..., 0] = c[..., 0]
        if self.framed:
            with_root(dz, c.imag[..., ROOT], dz.real[..., ROOT])
        self._put(dz, out)


@frozen
class Geometry:
    """Nodal vectors of alike beams in a batch of states.

    Attributes
    ----------
    z : ndarray of complex, shape (n_batch, n_bodies, n_vectors)
        Nodal vectors, with a body frame those relative to it.
    d : ndarray of complex, shape (n_batch, n_bodies, n_elements)
        Chords over element lengths.
    gradient : tuple of ndarray, each of the shape of d
        Half the derivative of the mean square slope by chord, first and last slope.
    """

    z: ComplexArray
    d: ComplexArray
    gradient: tuple[ComplexArray, ComplexArray, ComplexArray]


@frozen
class NaturalBeams(BeamIncrements):
    """Natural increments of alike beams whose elements have no interior vectors."""

    @cached_property
    def _metric(self) -> tuple[float, float, float, float]:
        g = mean_square_slope()
        return float(g[0, 0]), float(g[0, 1]), float(g[1, 1]), float(g[1, 2])

    def _gradient(
        self, d: ComplexArray, s: ComplexArray, e: ComplexArray
    ) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        g00, g01, g11, g12 = self._metric
        both = g01 * d
        return g00 * d + g01 * (s + e), both + g11 * s + g12 * e, both + g12 * s + g11 * e

    def geometry(self, q: Array) -> Geometry:
        """Return what the maps below need of a batch of states."""
        z = self._vectors(self._complex(q))
        d, s, e = self._parts(z)
        return Geometry(z, d, self._gradient(d, s, e))

    def to_natural(self, at: Geometry, dq: Array, out: Array) -> None:
        """Write the natural increments of small changes ``dq`` into ``out``."""
        c = self._complex(dq)
        dz = self._vectors(c)
        dd, ds, de = self._parts(dz)
        gd, gs, ge = at.gradient
        strain = (gd.conj() * dd + gs.conj() * ds + ge.conj() * de).real
        y = changeable(dz)
        for k in range(1, self.stride):
            y[..., k :: self.stride] /= at.z[..., k :: self.stride]
        y.real[..., self.stride :: self.stride] = strain
        y.imag[..., self.stride :: self.stride] = (dd / at.d).imag
        y[..., 0] = c[..., 0]
        if self.framed:
            y.imag[..., ROOT] = c.real[..., ROOT]
        self._put(y, out)

    def from_natural(self, at: Geometry, y: Array, out: Array) -> None:
        """Write the changes of the state that belong to small natural increments into ``out``."""
        c = self._complex(y)
        dz = self._small_turns(at.z, c)
        _, ds, de = self._parts(dz)
        gd, gs, ge = at.gradient
        chord = c[..., self.stride :: self.stride]
        turning = gd.conj() * at.d
        rest = (gs.conj() * ds + ge.conj() * de).real
        stretch = (chord.real - rest + turning.imag * chord.imag) / turning.real
        self._join(dz, (stretch + 1j * chord.imag) * at.d, c, out)

    def to_natural_forces(self, at: Geometry, f: Array, out: Array) -> None:
        """Write forces on natural increments into ``out``: the transpose of `from_natural`, without frame."""
        c = self._complex(f)
        gd, gs, ge = at.gradient
        beyond = self._beyond(c)
        along = (beyond * self.length).conj() * at.d
        turning = gd.conj() * at.d
        strain = along.real / turning.real
        y = self._on_slopes(at.z, c, strain * gs, strain * ge)
        y[..., self.stride :: self.stride] = strain + 1j * (strain * turning.imag - along.imag)
        y[..., 0] = c[..., 0] + beyond[..., 0]
        self._put(y, out)

    def advance(self, at: Geometry, y: Array, out: Array) -> None:
        """Write the change of the state that adds finite natural increments, exactly, into ``out``."""
        c = self._complex(y)
        z = self._turned(at.z, c)
        _, s, e = self._parts(z)
        d0, s0, e0 = self._parts(at.z)
        gd, gs, ge = at.gradient
        square = (gd.conj() * d0 + gs.conj() * s0 + ge.conj() * e0).real
        chord = c[..., self.stride :: self.stride]
        direction = np.exp(1j * chord.imag) * ((1.0 / np.abs(at.d)) * at.d)
        g00, g01, g11, g12 = self._metric
        slopes = g11 * (s * s.conj() + e * e.conj()).real + 2.0 * g12 * (s.conj() * e).real
        half = (g01 / g00) * (direction.conj() * (s + e)).real
        length = np.sqrt((square + 2.0 * chord.real - slopes) / g00 + half * half) - half
        self._join(z - at.z, length * direction - at.d, c, out)

    def _turned(self, z: ComplexArray, c: ComplexArray) -> ComplexArray:
        """Return gradient vectors stretched and turned; positions come out as they may."""
        factor = np.exp(c)
        if self.framed:
            factor[..., ROOT] = np.abs(factor[..., ROOT])
        return np.asarray(factor * z)

    def convective(self, at: Geometry, v: Array, y1: Array, out: Array) -> None:
        """Write what velocities alone make of the second derivatives of natural coordinates into ``out``.

        ``y1`` are their first derivatives.
        """
        w = self._vectors(self._complex(v))
        dd, ds, de = self._parts(w)
        hd, hs, he = self._gradient(dd, ds, de)
        first = self._complex(y1)
        bend = -(first * first)
        chords = slice(self.stride, None, self.stride)
        bend[..., chords] = 1j * (-((dd / at.d) ** 2)).imag
        bend.real[..., chords] = (hd.conj() * dd + hs.conj() * ds + he.conj() * de).real
        bend[..., 0] = 0.0
        if self.framed:
            bend[..., ROOT] = -(first.real[..., ROOT] ** 2)
        self._put(bend, out)
