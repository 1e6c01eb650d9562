"""Hybrid coordinates of beams in space: place and direction of a body frame, nodal vectors relative to it.

The state of a beam is q = (r0, lambda, d, p): the frame sits at the root, its first axis along the root slope
r_x = lambda t.  The direction d has two numbers, the angle [rad] by which the smallest rotation takes the
ground's first axis to t, along where it goes: t = (cos |d|, sin |d| d / |d|).  A line has no other direction,
so its roll is that of this rotation.  The nodal vectors p are relative to the frame (paper, eq. 1-3), and so
are omega' and pi'.

No two numbers serve all directions.  With lambda negative, t points the other way and the frame is turned by
half a turn more, about its second axis: both charts together do.  Each is good to well beyond a quarter turn,
and where a step ends beyond `EDGE`, the motion goes on in the other one (`SpatialFrameChart.better`).
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import skew
from hfsim.maths.traced import sometimes
from hfsim.mechanics.chart import Chart

EDGE = 1.8
"""Angle from the middle of a chart beyond which the other one is better [rad]: more than a quarter turn."""
_SMALL = 0.5
"""Angle below which series are more exact than closed forms [rad]."""
_TERMS = 8
_UNIT = np.eye(2)


def _sines(angle: Array, cosine: Array) -> tuple[Array, Array, Array]:
    """Return f = sin a / a and, each time over a, its derivative g and that of g, for angles a (..., 1)."""
    a = np.maximum(angle, _SMALL)
    square = a * a
    f = np.sin(a) / a
    g = (cosine - f) / square
    h = -(f + 3.0 * g) / square
    small = angle < _SMALL
    if sometimes(small):
        square = np.minimum(angle, _SMALL) ** 2
        near = _SERIES[-1]
        for coefficients in _SERIES[-2::-1]:
            near = near * square + coefficients
        f, g, h = (np.where(small, near[..., k : k + 1], one) for k, one in enumerate((f, g, h)))
    return f, g, h


def _series() -> Array:
    """Return the series of these three in squares of the angle, shape (_TERMS, 3)."""
    f = np.cumprod([1.0, *(-1.0 / (2 * k * (2 * k + 1)) for k in range(1, _TERMS + 2))])
    g = 2.0 * np.arange(1, len(f)) * f[1:]
    h = 2.0 * np.arange(1, len(g)) * g[1:]
    return np.stack([one[:_TERMS] for one in (f, g, h)], axis=1)


_SERIES = _series()


def _dot(a: Array, b: Array) -> Array:
    """Return products of vectors, (..., 1): summing their components' costs more than these for few."""
    return np.asarray((a[..., None, :] @ b[..., :, None])[..., 0])


class SpatialFrames(NamedTuple):
    """Body frames of alike beams in a batch of states; shapes (n_batch, n_bodies, ...).

    Attributes
    ----------
    turn : ndarray, shape (..., 3, 3)
        A, the frame's axes as columns.
    p : ndarray, shape (..., n_vectors, 3)
        All nodal vectors in the frame, those of the root included.
    origin : ndarray, shape (..., 3)
        Root positions.
    length, t, d : ndarray, shape (..., 1), (..., 3) and (..., 2)
        Of the root slope.
    sines : tuple of ndarray, shape (..., 1) each
        f, g, h of the angle |d|.
    """

    turn: Array
    p: Array
    origin: Array
    length: Array
    t: Array
    d: Array
    sines: tuple[Array, Array, Array]


class Spin(NamedTuple):
    """How frames turn: t', angular velocity in the frame, its part about t: (..., 3), (..., 3), (..., 1)."""

    t1: Array
    omega: Array
    roll: Array


@frozen
class SpatialFrameChart(Chart):
    """Map between hybrid and absolute nodal coordinates of alike beams in space.

    Attributes
    ----------
    stride : int
        Vectors from one nodal position to the next.
    """

    several: ClassVar[bool] = True
    stride: int

    def _vectors(self, q: Array) -> Array:
        return q[:, self.columns].reshape(len(q), self.bodies, -1, 3)

    def _flat(self, vectors: Array) -> Array:
        return vectors.reshape(len(vectors), -1)

    def frames(self, q: Array) -> SpatialFrames:
        """Return the frames and relative nodal vectors of a batch of states."""
        c = self._vectors(q)
        length, d = c[:, :, 1, :1], c[:, :, 1, 1:]
        angle = np.sqrt(_dot(d, d))
        cosine = np.cos(angle)
        sines = _sines(angle, cosine)
        t = np.concatenate([cosine, sines[0] * d], axis=-1)
        p = c.copy()
        p[:, :, 0] = 0.0
        p[:, :, 1] = 0.0
        p[:, :, 1, :1] = np.abs(length)
        return SpatialFrames(turned_to(t, length), p, c[:, :, :1], length, t, d, sines)

    def absolute(self, frames: SpatialFrames) -> Array:
        """Return absolute nodal coordinates, eq. (2), shape (n_batch, n_columns)."""
        x = frames.p @ frames.turn.swapaxes(-1, -2)
        x[:, :, :: self.stride] += frames.origin
        return self._flat(x)

    def absolute_velocity(self, frames: SpatialFrames, v: Array) -> Array:
        """Return the rates of the absolute nodal coordinates, eq. (4)."""
        w = self._vectors(v)
        W = skew(self._spin(frames, w).omega)
        u = (self._relative(frames, w) - frames.p @ W) @ frames.turn.swapaxes(-1, -2)
        u[:, :, :: self.stride] += w[:, :, :1]
        return self._flat(u)

    def _relative(self, frames: SpatialFrames, w: Array) -> Array:
        """Return the rates of the nodal vectors in the frame."""
        p1 = w.copy()
        p1[:, :, 0] = 0.0
        p1[:, :, 1] = 0.0
        p1[:, :, 1, :1] = np.sign(frames.length) * w[:, :, 1, :1]
        return p1

    def _spin(self, frames: SpatialFrames, w: Array) -> Spin:
        f, g, _ = frames.sines
        d, d1 = frames.d, w[:, :, 1, 1:]
        y = _dot(d, d1)
        t1 = np.concatenate([-f * y, f * d1 + g * y * d], axis=-1)
        roll = _roll(frames.t, t1)
        return Spin(t1, _angular(frames, t1, roll), roll)

    def relative_acceleration(self, frames: SpatialFrames, v: Array, ax: Array) -> Array:
        """Return q'' from the absolute accelerations ``ax``: eq. (5) solved for q''."""
        w, a = self._vectors(v), self._vectors(ax)
        spin, t, length = self._spin(frames, w), frames.t, frames.length
        along = _dot(a[:, :, 1], t)
        stretching = along + length * _dot(spin.t1, spin.t1)
        t2 = (a[:, :, 1] - stretching * t - 2.0 * w[:, :, 1, :1] * spin.t1) / length
        roll = _roll(t, t2) - spin.roll * spin.t1[..., :1] / (1.0 + t[..., :1])
        alpha = _angular(frames, t2, roll) + _in_frame(frames, spin.roll * spin.t1)
        W = skew(spin.omega)
        # what comes of this for the root's own vectors is not used
        p2 = self._shifted(a) @ frames.turn
        p2 += frames.p @ (skew(alpha) - W @ W)
        p2 += w @ (2.0 * W)
        turning = self._directions(frames, t2 - self._bend(frames, w[:, :, 1, 1:]))
        return self._joined(p2, a[:, :, 0], stretching, turning)

    def _shifted(self, x: Array) -> Array:
        """Return vectors relative to the first position."""
        shifted = x.copy()
        shifted[:, :, :: self.stride] -= x[:, :, :1]
        return shifted

    def _bend(self, frames: SpatialFrames, d1: Array) -> Array:
        """Return t'' where d'' is zero."""
        (f, g, h), d = frames.sines, frames.d
        y, square = _dot(d, d1), _dot(d1, d1)
        across = 2.0 * g * y * d1 + (h * y * y + g * square) * d
        return np.concatenate([-g * y * y - f * square, across], axis=-1)

    def _directions(self, frames: SpatialFrames, t1: Array) -> Array:
        """Return the rates of d that make those of t."""
        (f, g, _), d, t = frames.sines, frames.d, frames.t
        across = t1[..., 1:]
        y = t[..., :1] * _dot(d, across)
        y -= f * _dot(d, d) * t1[..., :1]
        return np.asarray((across - g * y * d) / f)

    def _joined(self, p: Array, origin: Array, length: Array, d: Array) -> Array:
        """Return (r0, lambda, d, p), or rates of them, with ``p`` for all nodal vectors."""
        p[:, :, 0] = origin
        p[:, :, 1] = np.concatenate([length, d], axis=-1)
        return self._flat(p)

    def hybrid(self, x: Array, near: Array) -> Array:
        """Return hybrid coordinates, in the chart of ``near`` or, where that has none, in the better one."""
        r = self._vectors(x)
        slope, side = r[:, :, 1], np.sign(self._vectors(near)[:, :, 1, :1])
        side = np.where(side == 0.0, np.where(slope[..., :1] < 0.0, -1.0, 1.0), side)
        length = side * np.linalg.norm(slope, axis=-1, keepdims=True)
        t = slope / length
        sine = np.linalg.norm(t[..., 1:], axis=-1, keepdims=True)
        d = np.arctan2(sine, t[..., :1]) / np.where(sine > 0.0, sine, 1.0) * t[..., 1:]
        return self._joined(self._shifted(r) @ turned_to(t, length), r[:, :, 0], length, d)

    def hybrid_velocity(self, frames: SpatialFrames, u: Array) -> Array:
        """Return the rates of the hybrid coordinates from those of the absolute ones."""
        w, t = self._vectors(u), frames.t
        along = _dot(w[:, :, 1], t)
        t1 = (w[:, :, 1] - along * t) / frames.length
        omega = _angular(frames, t1, _roll(t, t1))
        p1 = self._shifted(w) @ frames.turn + frames.p @ skew(omega)
        return self._joined(p1, w[:, :, 0], along, self._directions(frames, t1))

    def better(self, q: Array) -> Array:
        """Return the columns (n_batch, n_columns) of a state of which the charts are those to go on in."""
        c = self._vectors(q).copy()
        over = np.linalg.norm(c[:, :, 1, 1:], axis=-1) > EDGE
        c[:, :, 1, 0] *= np.where(over, -1.0, 1.0)
        return self._flat(c)


def turned_to(t: Array, length: Array) -> Array:
    """Return the axes (..., 3, 3), as columns, of the smallest rotation to t (..., 3).

    Where the length (..., 1) of the root slope along t is negative, they are turned by half a turn more.
    """
    A = np.zeros((*t.shape, 3))
    across = t[..., 1:]
    A[..., :, 0] = t
    A[..., 0, 1:] = -across
    A[..., 1:, 1:] = _UNIT - across[..., :, None] * across[..., None, :] / (1.0 + t[..., :1, None])
    A[..., :, ::2] *= np.sign(length)[..., None]
    return A


def _roll(t: Array, t1: Array) -> Array:
    """Return by how much the smallest rotation turns about t where that changes, (..., 1)."""
    turned = t[..., 1:2] * t1[..., 2:] - t[..., 2:] * t1[..., 1:2]
    return np.asarray(-turned / (1.0 + t[..., :1]))


def _in_frame(frames: SpatialFrames, a: Array) -> Array:
    return np.asarray((a[..., None, :] @ frames.turn)[..., 0, :])


def _angular(frames: SpatialFrames, t1: Array, roll: Array) -> Array:
    """Return t x t1 + roll t in the frame, (..., 3): there t is the first axis, or opposite to it."""
    a = _in_frame(frames, t1)
    return np.asarray(np.sign(frames.length) * np.concatenate([roll, -a[..., 2:], a[..., 1:2]], axis=-1))
