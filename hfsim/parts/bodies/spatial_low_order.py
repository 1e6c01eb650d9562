"""The model lowOrder in space: axial variable w with the foreshortening of both deflections (eq. 44-46).

Relative position of the centre line: s' = [x + w - 1/2 (v2^T H v2 + v3^T H v3), v2, v3] with
H(x) = int_0^x N'^T N'.  Without the foreshortening, this is a line in the nodal vectors of every other model,
so absolute nodal vectors X of that line are the coordinates: X = r0 + A (x + w, v2, v3).  Mass matrix and
inertia force are those of `hfsim.parts.bodies.root_frame`, kept through second order in the elastic
coordinates and their rates jointly (or whole with ``truncation: none``), then carried over to X.  So both are
the same however a scene is turned, and in a plane those of `hfsim.parts.bodies.planar_low_order`.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.parts.bodies.blueprint import Blueprint
from hfsim.parts.bodies.foreshortened import ForeshortenedBeam, weighted
from hfsim.parts.bodies.root_frame import ACROSS, RootFrame, RootRates

_TWO = range(2)


class _Fields(NamedTuple):
    """Values at the quadrature points, (n_batch, n_points) or (n_batch, 2, n_points) of both deflections."""

    w: Array
    v: Array
    Hv: Array
    """H v, shape (n_batch, 2, n_points, n_v)."""
    short: Array
    """Foreshortening [m]."""


@frozen
class SpatialLowOrderBeam(ForeshortenedBeam):
    """Inertia and weight of one beam of the model lowOrder in space."""

    @classmethod
    def of(cls, beam: Blueprint) -> SpatialLowOrderBeam:
        """Return the beam of a deck."""
        gravity = tuple(map(float, beam.gravity))
        return cls(beam.name, beam.mesh, beam.nodal_columns, gravity, beam.whole, item=beam.item)

    def straightened(self, x: Array) -> Array:
        """Return coordinates with no deformation."""
        X = x.reshape(-1, 3)
        t = X[1] / np.linalg.norm(X[1])
        line = np.outer(self.mesh.undeformed[:, 0], t)
        return np.asarray(self.mesh.positions[:, None] * X[0] + line).ravel()

    def vectors(self, x: Array) -> Array:
        """Return X, shape (n_batch, n_vectors, 3)."""
        return x[:, self.columns].reshape(len(x), -1, 3)

    def frame(self, x: Array) -> RootFrame:
        """Return its body frame in a batch of states."""
        return RootFrame.of(self.vectors(x), self.mesh.positions)

    def _fields(self, frame: RootFrame) -> _Fields:
        _, _, N_w, N_v, _ = self.points
        v, Hv = frame.v, self._bent(frame.v)
        w = (frame.p[:, 1:, 0] - self.mesh.undeformed[1:, 0]) @ N_w.T
        return _Fields(w, v @ N_v.T, Hv, 0.5 * np.einsum("bcpk,bck->bp", Hv, v))

    def _bent(self, v: Array) -> Array:
        return (v @ self.points[4]).reshape(len(v), 2, -1, self.n_v)

    # ------------------------------------------------------------------ mass

    @cached_property
    def _constant(self) -> tuple[Array, Array]:
        """Mass matrices of w and of each deflection alone."""
        _, m, N_w, N_v, _ = self.points
        return (N_w.T * m) @ N_w, (N_v.T * m) @ N_v

    def mass(self, x: Array) -> Array:
        """Return the mass matrix (10)-(12) kept as eq. (46) says, shape (n_batch, n, n)."""
        frame = self.frame(x)
        M = self._local_mass(self._fields(frame))
        n = 3 * self.mesh.n_vectors
        half = frame.onto_vectors(M.reshape(len(x), n, -1, 3)).reshape(len(x), n, n)
        whole = half.swapaxes(1, 2).reshape(len(x), n, -1, 3)
        return frame.onto_vectors(whole).reshape(len(x), n, n)

    def _local_mass(self, f: _Fields) -> Array:
        """Return that of the coordinates in the frame, shape (n_batch, n_vectors, 3, n_vectors, 3)."""
        place, m, N_w, N_v, _ = self.points
        axial, K = place + f.w - f.short, self.mesh.n_vectors
        M = np.zeros((len(f.w), K, 3, K, 3))
        M[:, 0, 0, 1:, 0] = m @ N_w
        for c in _TWO:
            y, own = 1 + c, f.v[:, c] * m
            M[:, 0, 0, 1, y] = -own.sum(axis=1)
            M[:, 0, y, 1, y] = axial @ m
            M[:, 0, 0, 2:, y] = -weighted(m, f.Hv[:, c])
            M[:, 0, y, 2:, y] = m @ N_v
            M[:, 1, y, 1:, 0] = -own @ N_w
            M[:, 1:, 0, 2:, y] -= (N_w.T * m) @ f.Hv[:, c]
            M[:, 1, y, 2:, y] = (axial * m) @ N_v
            for d in _TWO:
                M[:, 1, y, 2:, 1 + d] += weighted(own, f.Hv[:, d])
        M += M.transpose(0, 3, 4, 1, 2)
        M[:, 0, range(3), 0, range(3)] = m.sum()
        M[:, 1:, 0, 1:, 0] += self._constant[0]
        for c in _TWO:
            for d in _TWO:
                M[:, 1, 1 + c, 1, 1 + d] = (f.v[:, c] * f.v[:, d]) @ m
                M[:, 2:, 1 + c, 2:, 1 + d] = (f.Hv[:, c].swapaxes(1, 2) * m) @ f.Hv[:, d]
            M[:, 1, 1 + c, 1, 1 + c] += self._square(f) @ m
            M[:, 2:, 1 + c, 2:, 1 + c] += self._constant[1]
        return M

    def _square(self, f: _Fields) -> Array:
        """Return the square of the axial place; the w v^2 and v^4 parts only when whole."""
        place = self.points[0]
        square = place**2 + 2.0 * place * (f.w - f.short) + f.w**2
        return np.asarray(square - self._third_order(f) if self.whole else square)

    def _third_order(self, f: _Fields) -> Array:
        return np.asarray(2.0 * f.w * f.short - f.short**2)

    def third_order_inertia(self, x: Array) -> float:
        """Return the largest part of the moment of inertia that eq. (46) leaves out, over the part kept."""
        place, m, _, _, _ = self.points
        left_out = self._third_order(self._fields(self.frame(x))) @ m
        return float(np.abs(left_out).max(initial=0.0) / (place**2 @ m))

    # ------------------------------------------------------------------ forces

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add inertia force (13)-(14) and weight."""
        frame = self.frame(x)
        f, rates = self._fields(frame), frame.rates(self.vectors(u))
        force = self._inertia_force(frame, f, rates) - self._borne(f, rates.bias)
        if any(self.gravity):
            g = np.einsum("i,bij->bj", np.array(self.gravity), frame.A)[:, :, None]
            force += self._pulled(f, np.broadcast_to(g, (len(x), 3, self.n_points)))
        out[:, self.columns] += frame.onto_vectors(force[:, None]).reshape(len(x), -1)

    def _pulled(self, f: _Fields, a: Array) -> Array:
        """Return forces on the coordinates of forces per mass at the points, (n_batch, 3, n_points)."""
        place, m, N_w, N_v, _ = self.points
        axial, own = place + f.w - f.short, a * m
        F = np.zeros((len(a), self.mesh.n_vectors, 3))
        F[:, 0] = own.sum(axis=2)
        F[:, 1:, 0] = own[:, 0] @ N_w
        for c in _TWO:
            F[:, 1, 1 + c] = np.sum(own[:, 1 + c] * axial - own[:, 0] * f.v[:, c], axis=1)
            F[:, 2:, 1 + c] = own[:, 1 + c] @ N_v - weighted(own[:, 0], f.Hv[:, c])
        return F

    def _borne(self, f: _Fields, bias: Array) -> Array:
        """Return the mass matrix times second derivatives of the coordinates, (n_batch, n_vectors, 3)."""
        place, m, N_w, N_v, _ = self.points
        beta, v2 = bias[:, 1, ACROSS, None], bias[:, 2:, ACROSS].swapaxes(1, 2)
        a = np.empty((len(bias), 3, self.n_points))
        bent = np.einsum("bcpk,bck->bp", f.Hv, v2)
        a[:, 0] = bias[:, 1:, 0] @ N_w.T - bent - np.sum(beta * f.v, axis=1)
        a[:, 1:] = beta * (place + f.w - f.short)[:, None] + v2 @ N_v.T
        F = self._pulled(f, a)
        if not self.whole:
            F[:, 1, ACROSS] += (self._third_order(f) @ m)[:, None] * beta[..., 0]
        return F

    def _inertia_force(self, frame: RootFrame, f: _Fields, rates: RootRates) -> Array:
        place, m, N_w, N_v, _ = self.points
        beta, dv = rates.beta[:, :, None], rates.p[:, 2:, ACROSS].swapaxes(1, 2)
        v1, w1 = dv @ N_v.T, rates.p[:, 1:, 0] @ N_w.T
        short1 = np.einsum("bcpk,bck->bp", f.Hv, dv)
        short2 = np.einsum("bcpk,bck->bp", self._bent(dv), dv)
        square, spun, turned = np.sum(beta**2, axis=1), *(np.sum(beta * a, axis=1) for a in (f.v, v1))
        a = np.empty((len(beta), 3, self.n_points))
        a[:, 0] = -square * (place + f.w - f.short) - 2.0 * turned - short2
        a[:, 1:] = beta * (2.0 * (w1 - short1) - spun)[:, None]
        F = self._pulled(f, a)
        if not self.whole:
            # of third order and above: along the beam on H v and v, across it on the axial place
            dropped = (square * f.short - short2) * m
            across = (f.short * spun - 2.0 * (f.short * (w1 - short1) + f.w * short1)) * m
            for c in _TWO:
                F[:, 2:, 1 + c] += weighted(dropped, f.Hv[:, c])
                F[:, 1, 1 + c] += np.sum(dropped * f.v[:, c] - across * beta[:, c], axis=1)
        return -F

    # ------------------------------------------------------------------ energies

    def kinetic_energy(self, x: Array, u: Array) -> Array:
        """Return 1/2 u^T M u with the mass matrix of the model [J]."""
        w = u[:, self.columns]
        return np.asarray(0.5 * np.einsum("bi,bij,bj->b", w, self.mass(x), w))

    def potential_energy(self, t: Array, x: Array) -> Array:
        """Return the energy of the weight [J]."""
        place, m, _, _, _ = self.points
        frame, X = self.frame(x), self.vectors(x)
        f = self._fields(frame)
        arm = np.concatenate([((place + f.w - f.short) @ m)[:, None], f.v @ m], axis=1)
        at = m.sum() * X[:, 0] + (frame.A @ arm[:, :, None])[:, :, 0]
        return np.asarray(-at @ np.array(self.gravity))

