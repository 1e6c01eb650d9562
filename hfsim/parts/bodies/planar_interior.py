"""Natural increments of beams whose elements have interior vectors.

Interior vectors of an element bring as many more axial strains.  Their natural coordinates are the
moments of the Green strain with the slopes of the interior functions and, across, the components of the
vectors normal to the chord: with the mean strain and the stretch of the slopes at the ends, these
determine every strain of the element's degree.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array, ComplexArray
from hfsim.maths.frozen import frozen
from hfsim.maths.traced import changeable, sometimes
from hfsim.parts.bodies.planar_frame import ROOT
from hfsim.parts.bodies.planar_natural import BeamIncrements
from hfsim.parts.elements.polynomial import strain_moments

_MOST_CORRECTIONS = 5
_ENOUGH = 1e-8
"""Newton correction of a stretch after which the next one, quadratically smaller, is round-off."""


@frozen
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


@frozen
class InteriorBeams(BeamIncrements):
    """Natural increments of alike beams with interior vectors: a small solve an element gives the strains."""

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

    def geometry(self, q: Array) -> InteriorGeometry:
        """Return what the maps below need of a batch of states."""
        z = self._vectors(self._complex(q))
        V = self._differences(z)
        chord = V[..., 2:3]
        return InteriorGeometry(z, V, chord / np.abs(chord), self._strain_gradient(V))

    def to_natural(self, at: InteriorGeometry, dq: Array, out: Array) -> None:
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
        y = changeable(c)
        slopes = slice(1, None, self.stride)
        y[..., slopes] = self._vectors(c)[..., slopes] / at.z[..., slopes]
        if self.framed:
            y.imag[..., ROOT] = c.real[..., ROOT]
        y[..., self.stride :: self.stride] = strains[..., 0] + 1j * turn
        self._blocks(y)[..., self._interior] = strains[..., 1:] + 1j * normal
        self._put(y, out)

    def _read(self, c: ComplexArray) -> tuple[Array, Array, Array]:
        """Return strains and moments (..., degree - 2), chord turns (..., 1) and normal components."""
        chord, inner = c[..., self.stride :: self.stride, None], self._blocks(c)[..., self._interior]
        own = np.concatenate([chord, inner], axis=-1)
        return own.real, own.imag[..., :1], own.imag[..., 1:]

    def from_natural(self, at: InteriorGeometry, y: Array, out: Array) -> None:
        """Write the changes of the state that belong to small natural increments into ``out``."""
        c = self._complex(y)
        strains, turn, normal = self._read(c)
        dz = self._small_turns(at.z, c)
        dV = self._differences(dz)
        dV[..., 2:] = (1j * turn) * at.V[..., 2:]
        dV[..., 3:] += normal * (1j * at.along)
        self._stretch(at.gradient, at.along, strains - _strain_changes(at.gradient, dV), dV)
        self._join_all(dz, dV, c, out)

    def to_natural_forces(self, at: InteriorGeometry, f: Array, out: Array) -> None:
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

    def advance(self, at: InteriorGeometry, y: Array, out: Array) -> None:
        """Write the change of the state that adds finite natural increments, to round-off, into ``out``."""
        c = self._complex(y)
        strains, turn, normal = self._read(c)
        factor = np.ones_like(c)
        factor[..., 1 :: self.stride] = np.exp(c[..., 1 :: self.stride])
        if self.framed:
            factor[..., ROOT] = np.abs(factor[..., ROOT])
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
            if not sometimes(np.abs(by) > _ENOUGH):
                break
        self._join_all(z - at.z, V - at.V, c, out)

    def _join_all(self, dz: ComplexArray, dV: ComplexArray, c: ComplexArray, out: Array) -> None:
        self._blocks(dz)[..., self._interior] = dV[..., 3:]
        self._join(dz, dV[..., 2], c, out)

    def convective(self, at: InteriorGeometry, v: Array, y1: Array, out: Array) -> None:
        """Write what velocities alone make of the second derivatives of natural coordinates into ``out``."""
        dV = self._differences(self._vectors(self._complex(v)))
        first = self._complex(y1)
        bend = -(first * first)
        bend[..., 0] = 0.0
        if self.framed:
            bend[..., ROOT] = -(first.real[..., ROOT] ** 2)
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
