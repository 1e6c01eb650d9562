"""Natural increments: coordinates in which the stiffness of a beam hardly changes as it moves.

The axial stiffness of a beam couples to the change of its slopes: in nodal vectors a Newton matrix
taken at one state serves only for small changes.  In *natural* coordinates it serves for large ones:
the logarithm of each gradient vector (stretch and angle), and of each element the mean Green strain
of its centre line and the angle of its chord.  Only Newton corrections are expressed in them; the
equations stay those of the state coordinates, and so do the results.

Interior vectors of an element bring as many more axial strains.  Their natural coordinates are the
moments of the Green strain with the slopes of the interior functions and, across, the components of the
vectors normal to the chord: with the mean strain and the stretch of the slopes at the ends, these
determine every strain of the element's degree.

Planar vectors are complex numbers; everything has a leading batch axis.  Natural coordinates stand
where the coordinates they replace stand: root position; logarithm of a gradient vector; mean strain
+ i chord angle of element e in the place of the position of node e + 1; strain moment + i normal
component in the place of an interior vector.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array, ComplexArray
from hfsim.mechanics.increments import BodyIncrements
from hfsim.parts.elements.cable import mean_square_slope, strain_moments

_MOST_CORRECTIONS = 8
_ENOUGH = 1e-8
"""Newton correction of a stretch after which the next one, quadratically smaller, is round-off."""


@dataclass(frozen=True)
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


@dataclass(frozen=True)
class NaturalBeams(BodyIncrements):
    """Natural increments of alike beams, without interior vectors, that stand side by side in the state.

    Attributes
    ----------
    stride : int
        Vectors from one nodal position to the next.
    length : float
        Element length [m].
    framed : bool
        Whether the state has a body frame.
    """

    stride: int
    length: float
    framed: bool

    @cached_property
    def _metric(self) -> tuple[float, float, float, float]:
        g = mean_square_slope()
        return float(g[0, 0]), float(g[0, 1]), float(g[1, 1]), float(g[1, 2])

    def _complex(self, q: Array) -> ComplexArray:
        part = q[:, self.columns].reshape(len(q), self.bodies, -1)
        return np.ascontiguousarray(part).view(np.complex128)

    def _vectors(self, c: ComplexArray) -> ComplexArray:
        """Return nodal vectors, or changes of them, as seen from the frame."""
        if not self.framed:
            return c
        z = c.copy()
        z[..., 0] = 0.0
        z[..., 1] = c[..., 1].imag
        return z

    def _parts(self, z: ComplexArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return chords over the element length, first and last slopes of all elements."""
        places, slopes = z[..., :: self.stride], z[..., 1 :: self.stride]
        return (places[..., 1:] - places[..., :-1]) * (1.0 / self.length), slopes[..., :-1], slopes[..., 1:]

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
        y = dz.copy()
        for k in range(1, self.stride):
            y[..., k :: self.stride] /= at.z[..., k :: self.stride]
        y.real[..., self.stride :: self.stride] = strain
        y.imag[..., self.stride :: self.stride] = (dd / at.d).imag
        y[..., 0] = c[..., 0]
        if self.framed:
            y.imag[..., 1] = c[..., 1].real
        self._put(y, out)

    def from_natural(self, at: Geometry, y: Array, out: Array) -> None:
        """Write the changes of the state that belong to small natural increments into ``out``."""
        c = self._complex(y)
        dz = c * at.z
        if self.framed:
            dz[..., 1] = c[..., 1].real * at.z[..., 1]
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

    def advance(self, at: Geometry, y: Array, out: Array) -> None:
        """Write the change of the state that adds finite natural increments, exactly, into ``out``."""
        c = self._complex(y)
        z = self._turned(at.z, c)
        _, s, e = self._parts(z)
        d0, s0, e0 = self._parts(at.z)
        gd, gs, ge = at.gradient
        square = (gd.conj() * d0 + gs.conj() * s0 + ge.conj() * e0).real
        chord = c[..., self.stride :: self.stride]
        direction = np.exp(1j * chord.imag) * (at.d / np.abs(at.d))
        g00, g01, g11, g12 = self._metric
        slopes = g11 * (np.abs(s) ** 2 + np.abs(e) ** 2) + 2.0 * g12 * (s.conj() * e).real
        half = (g01 / g00) * (direction.conj() * (s + e)).real
        length = np.sqrt((square + 2.0 * chord.real - slopes) / g00 + half * half) - half
        self._join(z - at.z, length * direction - at.d, c, out)

    def _turned(self, z: ComplexArray, c: ComplexArray) -> ComplexArray:
        """Return gradient vectors stretched and turned; positions come out as they may."""
        factor = np.exp(c)
        if self.framed:
            factor[..., 1] = np.abs(factor[..., 1])
        return np.asarray(factor * z)

    def _join(self, dz: ComplexArray, dd: ComplexArray, c: ComplexArray, out: Array) -> None:
        """Put changes of chords and gradient vectors together into a change of the state."""
        root = 0.0 if self.framed else c[..., :1]
        dz[..., self.stride :: self.stride] = np.cumsum(dd * self.length, axis=-1) + root
        dz[..., 0] = c[..., 0]
        if self.framed:
            dz[..., 1] = c[..., 1].imag + 1j * dz[..., 1].real
        self._put(dz, out)

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
            bend[..., 1] = -(first[..., 1].real ** 2)
        self._put(bend, out)

    def _put(self, z: ComplexArray, out: Array) -> None:
        out[:, self.columns] = z.reshape(len(out), -1).view(np.float64)


@dataclass(frozen=True)
class InteriorGeometry:
    """Vectors of alike beams whose elements have interior vectors, in a batch of states.

    Attributes
    ----------
    z : ndarray of complex, shape (n_batch, n_bodies, n_vectors)
        All vectors, with a body frame those relative to it.
    V : ndarray of complex, shape (n_batch, n_bodies, n_elements, degree)
        Difference vectors: first slope, last slope, then what only the strains of their own element
        determine: chord over length and interior vectors.
    along : ndarray of complex, shape (n_batch, n_bodies, n_elements, 1)
        Unit vectors along the chords.
    gradient : ndarray of complex, shape (n_batch, n_bodies, n_elements, degree - 2, degree)
        Derivatives of the mean strain and the strain moments by the difference vectors, conjugated.
    """

    z: ComplexArray
    V: ComplexArray
    along: ComplexArray
    gradient: ComplexArray


@dataclass(frozen=True)
class InteriorBeams(NaturalBeams):
    """The same for elements with interior vectors: a small solve an element where strains are given."""

    @cached_property
    def _interior(self) -> slice:
        return slice(2, self.stride)

    @cached_property
    def _moments(self) -> Array:
        """Matrix, shape (degree, (degree - 2) degree), from difference vectors to strain gradients."""
        order = [1, self.stride, 0, *range(2, self.stride)]
        T = strain_moments(self.stride + 1)[:, order][:, :, order]
        return np.ascontiguousarray(T.transpose(1, 0, 2).reshape(self.stride + 1, -1))

    def _blocks(self, z: ComplexArray) -> ComplexArray:
        """Return a view of all but the last node's vectors, shape (..., n_elements, stride)."""
        # splitting an axis never copies, so that what is written there goes into z
        return z[..., :-2].reshape(*z.shape[:-1], -1, self.stride)

    def _differences(self, z: ComplexArray) -> ComplexArray:
        d, s, e = self._parts(z)
        inner = self._blocks(z)[..., self._interior]
        return np.concatenate([s[..., None], e[..., None], d[..., None], inner], axis=-1)

    def _strain_gradient(self, V: ComplexArray) -> ComplexArray:
        return np.asarray((V.conj() @ self._moments).reshape(*V.shape[:-1], -1, V.shape[-1]))

    def geometry(self, q: Array) -> InteriorGeometry:  # type: ignore[override]
        """Return what the maps below need of a batch of states."""
        z = self._vectors(self._complex(q))
        V = self._differences(z)
        chord = V[..., 2:3]
        return InteriorGeometry(z, V, chord / np.abs(chord), self._strain_gradient(V))

    def to_natural(self, at: InteriorGeometry, dq: Array, out: Array) -> None:  # type: ignore[override]
        """Write the natural increments of small changes ``dq`` into ``out``."""
        c = self._complex(dq)
        dV = self._differences(self._vectors(c))
        strains = _strain_changes(at.gradient, dV)
        turn = (dV[..., 2:3] / at.V[..., 2:3]).imag
        seen, moved = (part[..., 3:] * at.along.conj() for part in (at.V, dV))
        self._assemble(at, c, strains, turn[..., 0], moved.imag - turn * seen.real, out)

    def _assemble(
        self, at: InteriorGeometry, c: ComplexArray, strains: Array, turn: Array, normal: Array, out: Array
    ) -> None:
        """Write natural increments, of which ``c`` gives root position, frame angle and gradient vectors."""
        y = c.copy()
        slopes = slice(1, None, self.stride)
        y[..., slopes] = self._vectors(c)[..., slopes] / at.z[..., slopes]
        if self.framed:
            y.imag[..., 1] = c[..., 1].real
        y[..., self.stride :: self.stride] = strains[..., 0] + 1j * turn
        self._blocks(y)[..., self._interior] = strains[..., 1:] + 1j * normal
        self._put(y, out)

    def _read(self, c: ComplexArray) -> tuple[Array, Array, Array]:
        """Return strains and moments (..., degree - 2), chord turns (..., 1) and normal components."""
        chord, inner = c[..., self.stride :: self.stride, None], self._blocks(c)[..., self._interior]
        own = np.concatenate([chord, inner], axis=-1)
        return own.real, own.imag[..., :1], own.imag[..., 1:]

    def from_natural(self, at: InteriorGeometry, y: Array, out: Array) -> None:  # type: ignore[override]
        """Write the changes of the state that belong to small natural increments into ``out``."""
        c = self._complex(y)
        strains, turn, normal = self._read(c)
        dz = c * at.z
        if self.framed:
            dz[..., 1] = c[..., 1].real * at.z[..., 1]
        dV = self._differences(dz)
        dV[..., 2:] = (1j * turn) * at.V[..., 2:]
        dV[..., 3:] += normal * (1j * at.along)
        self._stretch(at.gradient, at.along, strains - _strain_changes(at.gradient, dV), dV)
        self._join_all(dz, dV, c, out)

    def to_natural_forces(self, at: InteriorGeometry, f: Array, out: Array) -> None:  # type: ignore[override]
        """Write forces on natural increments into ``out``: the transpose of `from_natural`, without frame."""
        c = self._complex(f)
        beyond = self._beyond(c)
        own = np.concatenate([beyond[..., None] * self.length, self._blocks(c)[..., self._interior]], axis=-1)
        matrix = (at.gradient[..., 2:] * at.along[..., None]).real
        strains = np.linalg.solve(matrix.swapaxes(-1, -2), (own.conj() * at.along).real[..., None])
        spread = (strains.swapaxes(-1, -2) @ at.gradient)[..., 0, :].conj()
        rest = (own - spread[..., 2:]).conj()
        y = self._on_slopes(at.z, c, spread[..., 0], spread[..., 1])
        turn = -(rest * at.V[..., 2:]).imag.sum(axis=-1)
        y[..., self.stride :: self.stride] = strains[..., 0, 0] + 1j * turn
        normal = -(rest[..., 1:] * at.along).imag
        self._blocks(y)[..., self._interior] = strains[..., 1:, 0] + 1j * normal
        y[..., 0] = c[..., 0] + beyond[..., 0]
        self._put(y, out)

    def _stretch(self, gradient: ComplexArray, along: ComplexArray, strains: Array, V: ComplexArray) -> Array:
        """Add to chords and interior vectors, along the chord, what changes the strains as given."""
        matrix = (gradient[..., 2:] * along[..., None]).real
        if len(matrix) < len(strains):
            # one state for many changes: solving would factorise it again for each of them
            by = np.asarray(np.linalg.inv(matrix) @ strains[..., None])[..., 0]
        else:
            by = np.asarray(np.linalg.solve(matrix, strains[..., None]))[..., 0]
        V[..., 2:] += by * along
        return by

    def advance(self, at: InteriorGeometry, y: Array, out: Array) -> None:  # type: ignore[override]
        """Write the change of the state that adds finite natural increments, to round-off, into ``out``."""
        c = self._complex(y)
        strains, turn, normal = self._read(c)
        factor = np.ones_like(c)
        factor[..., 1 :: self.stride] = np.exp(c[..., 1 :: self.stride])
        if self.framed:
            factor[..., 1] = np.abs(factor[..., 1])
        z = factor * at.z
        V = self._differences(z)
        turned = np.exp(1j * turn)
        along = turned * at.along
        V[..., 2:] = turned * at.V[..., 2:]
        V[..., 3:] += normal * (1j * along)
        wanted = strains + 0.5 * _strain_changes(at.gradient, at.V)
        for _ in range(_MOST_CORRECTIONS):
            gradient = self._strain_gradient(V)
            by = self._stretch(gradient, along, wanted - 0.5 * _strain_changes(gradient, V), V)
            if not np.abs(by).max(initial=0.0) > _ENOUGH:
                break
        self._join_all(z - at.z, V - at.V, c, out)

    def _join_all(self, dz: ComplexArray, dV: ComplexArray, c: ComplexArray, out: Array) -> None:
        self._blocks(dz)[..., self._interior] = dV[..., 3:]
        self._join(dz, dV[..., 2], c, out)

    def convective(self, at: InteriorGeometry, v: Array, y1: Array, out: Array) -> None:  # type: ignore[override]
        """Write what velocities alone make of the second derivatives of natural coordinates into ``out``."""
        dV = self._differences(self._vectors(self._complex(v)))
        first = self._complex(y1)
        bend = -(first * first)
        bend[..., 0] = 0.0
        if self.framed:
            bend[..., 1] = -(first[..., 1].real ** 2)
        spin = dV[..., 2:3] / at.V[..., 2:3]
        seen, moved = (part[..., 3:] * at.along.conj() for part in (at.V, dV))
        turn = spin.imag
        normal = (spin * spin).imag * seen.real - turn * (2.0 * moved.real + turn * seen.imag)
        strains = _strain_changes(self._strain_gradient(dV), dV)
        bend[..., self.stride :: self.stride] = strains[..., 0] - 1j * (spin * spin).imag[..., 0]
        self._blocks(bend)[..., self._interior] = strains[..., 1:] + 1j * normal
        self._put(bend, out)


def _strain_changes(gradient: ComplexArray, dV: ComplexArray) -> Array:
    """Return the changes of strain moments with changes of difference vectors, shape (..., degree - 2)."""
    return np.asarray((gradient @ dV[..., None])[..., 0].real)
