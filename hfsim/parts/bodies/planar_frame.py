"""Hybrid coordinates: a body frame and relative nodal vectors, as a change of variables.

The state of a beam is q = (r0, theta, p): place and angle of the body frame, and the nodal positions
and slopes p relative to it (paper, eq. 1-3).  The frame sits at the root with its first axis along
the root tangent, so the root position and the transverse root slope are not in p.  The absolute
nodal vectors follow as r = r0 + A(theta) s', a square map that is inverted at sight; in them the
mass matrix is constant.

Planar vectors are complex numbers here; everything takes a leading batch axis.  The root slope has no
direction of its own in the frame, only a length: its place holds the angle of the frame as real part and
that length as imaginary part (`ROOT`, `angle_of`, `with_root`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, ComplexArray
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import as_complex, wrap
from hfsim.mechanics.chart import Chart

ROOT = 1
"""Place of the root slope among the vectors of a beam."""


def angle_of(c: ComplexArray) -> Array:
    """Return the angle of the frame, or its rate or change, from the coordinates of a beam, (..., 1)."""
    return c.real[..., ROOT : ROOT + 1]


def relative(c: ComplexArray) -> ComplexArray:
    """Return the nodal vectors in the body frame, or their rates, from the coordinates of a beam."""
    p = c.copy()
    p[..., 0] = 0.0
    p[..., ROOT] = c.imag[..., ROOT]
    return p


def with_root(c: ComplexArray, angle: Array, length: Array) -> ComplexArray:
    """Put the angle of the frame and the length of the root slope in their place, in ``c`` itself."""
    c.imag[..., ROOT] = length
    c.real[..., ROOT] = angle
    return c


class Frames(NamedTuple):
    """Body frames of alike beams in a batch of states.

    Attributes
    ----------
    turn : ndarray of complex, shape (n_batch, n_bodies, 1)
        exp(i theta), the rotation into inertial axes.
    p : ndarray of complex, shape (n_batch, n_bodies, n_vectors)
        All nodal vectors in body axes, those of the root included.
    origin : ndarray of complex, shape (n_batch, n_bodies, 1)
        Root positions, inertial axes.
    """

    turn: ComplexArray
    p: ComplexArray
    origin: ComplexArray


@frozen
class FrameChart(Chart):
    """Map between hybrid coordinates and absolute nodal coordinates of alike beams.

    Attributes
    ----------
    stride : int
        Vectors from one nodal position to the next.

    Notes
    -----
    The coordinates of one beam stand in the order r0 (2), theta, axial root slope, then the other
    nodal vectors: as many as in absolute coordinates.
    """

    stride: int

    def _complex(self, q: Array) -> ComplexArray:
        block = np.ascontiguousarray(q[:, self.columns])
        return block.view(np.complex128).reshape(len(q), self.bodies, -1)

    def _flat(self, z: ComplexArray) -> Array:
        return z.reshape(len(z), -1).view(np.float64)

    def frames(self, q: Array) -> Frames:
        """Return the frames and relative nodal vectors of a batch of states."""
        c = self._complex(q)
        return Frames(turn=np.exp(1j * angle_of(c)), p=relative(c), origin=c[..., :1])

    def absolute(self, frames: Frames) -> Array:
        """Return absolute nodal coordinates, eq. (2), shape (n_batch, n_columns)."""
        z = frames.p * frames.turn
        z[..., :: self.stride] += frames.origin
        return self._flat(z)

    def absolute_velocity(self, frames: Frames, v: Array) -> Array:
        """Return the rates of the absolute nodal coordinates, eq. (4)."""
        w = self._complex(v)
        z = (relative(w) + (1j * angle_of(w)) * frames.p) * frames.turn
        z[..., :: self.stride] += w[..., :1]
        return self._flat(z)

    def relative_acceleration(self, frames: Frames, v: Array, ax: Array) -> Array:
        """Return q'' from the absolute accelerations ``ax``: eq. (5) solved for q''."""
        w = self._complex(v)
        z = self._complex(ax)
        omega = angle_of(w)
        g = self._in_frame(frames, z)
        g -= relative(w) * (2j * omega)
        spin = g.imag[..., ROOT : ROOT + 1] / frames.p.real[..., ROOT : ROOT + 1]
        g += frames.p * (omega * omega - 1j * spin)
        return self._joined(g, z, spin)

    def _in_frame(self, frames: Frames, z: ComplexArray) -> ComplexArray:
        """Return vectors relative to the first position, turned into the body frame."""
        g = z * frames.turn.conj()
        g[..., :: self.stride] -= g[..., :1].copy()
        return g

    def _joined(self, g: ComplexArray, z: ComplexArray, angle: Array) -> Array:
        """Return (r0, theta, p), or rates of them, with ``g`` holding p for all nodal vectors."""
        g[..., 0] = z[..., 0]
        return self._flat(with_root(g, angle[..., 0], g.real[..., ROOT]))

    def hybrid(self, x: Array, near: Array) -> Array:
        """Return hybrid coordinates; of all full turns the angle nearest to that of ``near`` is taken."""
        z = self._complex(x)
        guess = angle_of(self._complex(near))
        angle = guess + wrap(np.angle(z[..., ROOT : ROOT + 1]) - guess)
        frames = Frames(turn=np.exp(1j * angle), p=z, origin=z[..., :1])
        return self._joined(self._in_frame(frames, z), z, angle)

    def hybrid_velocity(self, frames: Frames, u: Array) -> Array:
        """Return the rates of the hybrid coordinates from those of the absolute ones."""
        z = self._complex(u)
        g = self._in_frame(frames, z)
        omega = g.imag[..., ROOT : ROOT + 1] / frames.p.real[..., ROOT : ROOT + 1]
        return self._joined(g - (1j * omega) * frames.p, z, omega)


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
    slope = z[..., ROOT : ROOT + 1]
    return z[..., :1], slope / np.abs(slope), z
