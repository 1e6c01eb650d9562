"""Hybrid coordinates: a body frame and relative nodal vectors, as a change of variables.

The state of a beam is q = (r0, theta, p): place and angle of the body frame, and the nodal positions
and slopes p relative to it (paper, eq. 1-3).  The frame sits at the root with its first axis along
the root tangent, so the root position and the transverse root slope are not in p.  The absolute
nodal vectors follow as r = r0 + A(theta) s', a square map that is inverted at sight; in them the
mass matrix is constant.

Planar vectors are complex numbers here; everything takes a leading batch axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hfsim.arrays import Array, ComplexArray
from hfsim.rotations import as_complex, wrap


@dataclass(frozen=True)
class Frames:
    """Body frames of alike beams in a batch of states.

    Attributes
    ----------
    turn : ndarray of complex, shape (n_batch, n_bodies, 1)
        exp(i theta), the rotation into inertial axes.
    p : ndarray of complex, shape (n_batch, n_bodies, n_vectors)
        All nodal vectors in body axes, those of the root included.
    """

    turn: ComplexArray
    p: ComplexArray


@dataclass(frozen=True)
class FrameChart:
    """Map between hybrid coordinates and absolute nodal coordinates of alike beams.

    Attributes
    ----------
    columns : slice
        Where the coordinates of these beams stand, in q and in x alike.
    bodies : int
        Number of beams.
    positions : ndarray, shape (n_vectors,)
        One for nodal positions, zero for gradient vectors.

    Notes
    -----
    The coordinates of one beam stand in the order r0 (2), theta, axial root slope, then the other
    nodal vectors: as many as in absolute coordinates.
    """

    columns: slice
    bodies: int
    positions: Array

    def _split(self, q: Array) -> Array:
        return q[:, self.columns].reshape(len(q), self.bodies, -1)

    def _complex(self, q: Array) -> ComplexArray:
        return np.ascontiguousarray(self._split(q)).view(np.complex128)

    def _put(self, z: ComplexArray, out: Array) -> None:
        out[:, self.columns] = z.reshape(len(out), -1).view(np.float64)

    def _relative(self, b: Array) -> ComplexArray:
        """Return nodal vectors in the body frame, or their rates, as complex numbers."""
        p = b.copy()
        p[..., :2] = 0.0
        p[..., 2] = b[..., 3]
        p[..., 3] = 0.0
        return p.view(np.complex128)

    def frames(self, q: Array) -> Frames:
        """Return the frames and relative nodal vectors of a batch of states."""
        b = self._split(q)
        return Frames(turn=np.exp(1j * b[..., 2:3]), p=self._relative(b))

    def absolute(self, frames: Frames, q: Array, x: Array) -> None:
        """Write absolute nodal coordinates into ``x``, eq. (2)."""
        z = frames.p * frames.turn
        z += self.positions * self._complex(q)[..., :1]
        self._put(z, x)

    def absolute_velocity(self, frames: Frames, v: Array, u: Array) -> None:
        """Write the rates of the absolute nodal coordinates into ``u``, eq. (4)."""
        w = self._split(v)
        z = (self._relative(w) + (1j * w[..., 2:3]) * frames.p) * frames.turn
        z += self.positions * self._complex(v)[..., :1]
        self._put(z, u)

    def relative_acceleration(self, frames: Frames, v: Array, ax: Array, a: Array) -> None:
        """Write q'' into ``a`` from the absolute accelerations ``ax``: eq. (5) solved for q''."""
        w = self._split(v)
        z = self._complex(ax)
        origin = z[..., :1]
        omega = w[..., 2:3]
        g = (z - self.positions * origin) * frames.turn.conj()
        g -= (2j * omega) * self._relative(w)
        spin = g.imag[..., 1:2] / frames.p.real[..., 1:2]
        g += (omega * omega - 1j * spin) * frames.p
        self._write(g, origin, spin, a)

    def hybrid(self, x: Array, near: Array, q: Array) -> None:
        """Write hybrid coordinates into ``q``; of all full turns the angle nearest to ``near`` is taken."""
        z = self._complex(x)
        origin = z[..., :1]
        guess = self._split(near)[..., 2:3]
        angle = guess + wrap(np.angle(z[..., 1:2]) - guess)
        self._write((z - self.positions * origin) * np.exp(-1j * angle), origin, angle, q)

    def hybrid_velocity(self, frames: Frames, u: Array, v: Array) -> None:
        """Write the rates of the hybrid coordinates into ``v`` from those of the absolute ones."""
        z = self._complex(u)
        origin = z[..., :1]
        g = (z - self.positions * origin) * frames.turn.conj()
        omega = g.imag[..., 1:2] / frames.p.real[..., 1:2]
        self._write(g - (1j * omega) * frames.p, origin, omega, v)

    def _write(self, g: ComplexArray, origin: ComplexArray, angle: Array, out: Array) -> None:
        """Write (r0, theta, p), or rates of them, with ``g`` holding p for all nodal vectors."""
        g[..., :1] = origin
        g[..., 1:2] = angle + 1j * g.real[..., 1:2]
        self._put(g, out)


def relative_nodes(x: Array) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Split absolute nodal vectors, shape (..., n_vectors, 2), into origin, unit tangent and vectors.

    Returns
    -------
    origin, tangent : ndarray of complex, shape (..., 1)
        Root position; unit vector along the root slope.
    vectors : ndarray of complex, shape (..., n_vectors)
        The nodal vectors as complex numbers, inertial axes.
    """
    z = as_complex(x)
    slope = z[..., 1:2]
    return z[..., :1], slope / np.abs(slope), z
