"""The frame at the root of beams with sections: the section's own axes there, and steps relative to it.

Its axes D = (d1, d..) are section vectors of the root node, of which the first follows from the others: in
space d1 = d2 x d3, in the plane a quarter turn back.  So no angles are needed: the state of a beam stepped in
its body frame is place and section vectors of the root as they are, and p = D^-1 (X - r0) of all other nodes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import cross, normal
from hfsim.mechanics.chart import Chart


def triad(d: Array) -> Array:
    """Return D, axes as columns, from section vectors, shape (..., n_dim - 1, n_dim)."""
    return _beside(-normal(d[..., 0, :]) if d.shape[-1] == 2 else cross(d[..., 0, :], d[..., 1, :]), d)


def triad_rate(d: Array, d1: Array) -> Array:
    """Return D'."""
    if d.shape[-1] == 2:
        return triad(d1)
    return _beside(cross(d1[..., 0, :], d[..., 1, :]) + cross(d[..., 0, :], d1[..., 1, :]), d1)


def triad_acceleration(d: Array, d1: Array, d2: Array) -> Array:
    """Return D''."""
    turning = triad_rate(d, d2)
    if d.shape[-1] == 3:
        turning[..., 0] += 2.0 * cross(d1[..., 0, :], d1[..., 1, :])
    return turning


def onto_sections(d: Array, G: Array) -> Array:
    """Return forces on section vectors, shape of d, from those on D, (..., n_dim, n_dim) as columns."""
    on, first = G.swapaxes(-1, -2)[..., 1:, :].copy(), G[..., 0]
    if d.shape[-1] == 2:
        return np.asarray(on + normal(first)[..., None, :])
    on[..., 0, :] += cross(d[..., 1, :], first)
    on[..., 1, :] += cross(first, d[..., 0, :])
    return on


def _beside(first: Array, d: Array) -> Array:
    return np.concatenate([first[..., None, :], d], axis=-2).swapaxes(-1, -2)


class SectionFrames(NamedTuple):
    """Body frames of alike beams in a batch of states; shapes (n_batch, n_bodies, ...).

    Attributes
    ----------
    D : ndarray, shape (..., n_dim, n_dim)
    c : ndarray, shape (..., n_vectors, n_dim)
        The state: root vectors in ground axes, all others in the frame.
    """

    D: Array
    c: Array


@frozen
class SectionFrameChart(Chart):
    """Map between coordinates in the body frame and absolute nodal vectors of alike beams.

    Attributes
    ----------
    n_dim : int
        Of space; so many vectors has a node.
    """

    n_dim: int

    def _vectors(self, q: Array) -> Array:
        return q[:, self.columns].reshape(len(q), self.bodies, -1, self.n_dim)

    def _root(self, c: Array) -> Array:
        return c[:, :, 1 : self.n_dim]

    def _joined(self, c: Array, rest: Array, origin: Array | None = None) -> Array:
        """Return the root's vectors of ``c`` and others, positions from an origin on."""
        out = np.concatenate([c[:, :, : self.n_dim], rest], axis=2)
        if origin is not None:
            out[:, :, self.n_dim :: self.n_dim] += origin
        return out.reshape(len(c), -1)

    def frames(self, q: Array) -> SectionFrames:
        """Return the frames of a batch of states."""
        c = self._vectors(q)
        return SectionFrames(triad(self._root(c)), c)

    def absolute(self, frames: SectionFrames) -> Array:
        """Return absolute nodal vectors, eq. (2), shape (n_batch, n_columns)."""
        c = frames.c
        return self._joined(c, c[:, :, self.n_dim :] @ frames.D.swapaxes(-1, -2), c[:, :, :1])

    def absolute_velocity(self, frames: SectionFrames, v: Array) -> Array:
        """Return the rates of the absolute nodal vectors, eq. (4)."""
        w, n = self._vectors(v), self.n_dim
        turning = triad_rate(self._root(frames.c), self._root(w)).swapaxes(-1, -2)
        rates = w[:, :, n:] @ frames.D.swapaxes(-1, -2) + frames.c[:, :, n:] @ turning
        return self._joined(w, rates, w[:, :, :1])

    def relative_acceleration(self, frames: SectionFrames, v: Array, ax: Array) -> Array:
        """Return q'' from the absolute accelerations ``ax``: eq. (5) solved for q''."""
        w, a, n = self._vectors(v), self._vectors(ax), self.n_dim
        root = self._root(frames.c), self._root(w)
        bent = 2.0 * w[:, :, n:] @ triad_rate(*root).swapaxes(-1, -2)
        bent += frames.c[:, :, n:] @ triad_acceleration(*root, self._root(a)).swapaxes(-1, -2)
        return self._joined(a, self._in_frame(frames.D, self._shifted(a) - bent))

    def hybrid(self, x: Array, near: Array) -> Array:
        """Return the state of absolute nodal vectors."""
        r = self._vectors(x)
        return self._joined(r, self._in_frame(triad(self._root(r)), self._shifted(r)))

    def hybrid_velocity(self, frames: SectionFrames, u: Array) -> Array:
        """Return the rates of the state from those of the absolute nodal vectors."""
        w = self._vectors(u)
        turning = triad_rate(self._root(frames.c), self._root(w)).swapaxes(-1, -2)
        rest = self._shifted(w) - frames.c[:, :, self.n_dim :] @ turning
        return self._joined(w, self._in_frame(frames.D, rest))

    def _shifted(self, r: Array) -> Array:
        """Return the vectors of all nodes but the root, positions from that on."""
        rest = r[:, :, self.n_dim :].copy()
        rest[:, :, :: self.n_dim] -= r[:, :, :1]
        return rest

    def _in_frame(self, D: Array, vectors: Array) -> Array:
        return np.linalg.solve(D, vectors.swapaxes(-1, -2)).swapaxes(-1, -2)
