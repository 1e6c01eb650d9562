"""The model lowOrder in space: axial variable w with the foreshortening of both deflections (eq. 44-46).

Relative position of the centre line: s' = [x + w - 1/2 (v2^T H v2 + v3^T H v3), v2, v3] with
H(x) = int_0^x N'^T N'.  Without the foreshortening, this is a line in the nodal vectors of every other model,
so absolute nodal vectors X of that line are the coordinates: X = r0 + A (x + w, v2, v3).  Mass matrix and
inertia force are those of `hfsim.parts.bodies.root_frame`, kept through second order in the elastic
coordinates and their rates jointly (or whole with ``truncation: none``), then carried over to X.  So both are
the same however a scene is turned, and in a plane those of `hfsim.parts.bodies.planar_low_order`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array, BoolArray
from hfsim.maths.frozen import frozen
from hfsim.parts.bodies.blueprint import Blueprint
from hfsim.parts.bodies.foreshortened import Fields, ForeshortenedBeam
from hfsim.parts.bodies.root_frame import ACROSS, RootFrame, RootRates

_TWO = range(2)


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

    @cached_property
    def lengths(self) -> BoolArray:
        """Those of the nodal positions."""
        return np.repeat(self.mesh.positions > 0.0, 3)

    def vectors(self, x: Array) -> Array:
        """Return X, shape (n_batch, n_vectors, 3)."""
        return x[:, self.columns].reshape(len(x), -1, 3)

    def frame(self, x: Array) -> RootFrame:
        """Return its body frame in a batch of states."""
        return RootFrame.of(self.vectors(x), self.mesh.positions)

    def _fields(self, x: Array) -> Fields:
        return self._fields_in(self.frame(x))

    def _fields_in(self, frame: RootFrame) -> Fields:
        own, v = self.shortening, self.shortening.of_elements(frame.v)
        w = own.values(own.of_elements(frame.p[:, 1:, 0] - self.mesh.undeformed[1:, 0]))
        bent = own.bent(v)
        return Fields(w, own.values(v), bent, 0.5 * self._short(bent, v))

    def _short(self, bent: Array, v: Array) -> Array:
        """Return u^T H v of both deflections, of H v and coordinates u of elements (n_batch, 2, ...)."""
        pairs = (self.shortening.short(bent[:, c], v[:, None, c])[:, 0] for c in _TWO)
        return np.asarray(sum(pairs))

    # ------------------------------------------------------------------ mass

    def momenta(self, x: Array, rates: Array) -> Array:
        """Return the mass matrix times rates, (n_batch, m, n)."""
        frame = self.frame(x)
        return self._momenta(frame, self._fields_in(frame), rates)

    def _momenta(self, frame: RootFrame, f: Fields, rates: Array) -> Array:
        U = rates.reshape(*rates.shape[:2], -1, 3)
        beta, p1 = frame.relative(U)
        p1[:, :, 0] = (U[:, :, :1] @ frame.A[:, None])[:, :, 0]
        p1[:, :, 1, ACROSS] = beta
        return frame.onto_vectors(self._borne(f, p1)).reshape(rates.shape)

    @property
    def inner(self) -> int:
        """Where the coordinates that the root holds begin: its place and slope go before."""
        return 6

    def condensed(self, x: Array) -> tuple[Array, Callable[[Array], Array]]:
        """Return rows of the mass matrix, of the coordinates before, and what solves with the rest of it."""
        frame = self.frame(x)
        f, n = self._fields_in(frame), 3 * self.mesh.n_vectors
        rows = self._momenta(frame, f, np.broadcast_to(np.eye(self.inner, n), (len(x), self.inner, n)))
        solve, A = self.shortening.solver([f.bent[:, c] for c in _TWO]), frame.A[:, None]

        def solved(force: Array) -> Array:
            own = force.reshape(*force.shape[:2], -1, 3)
            return np.asarray((solve(own @ A) @ A.swapaxes(2, 3)).reshape(force.shape))

        return rows, solved

    # ------------------------------------------------------------------ forces

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add inertia force (13)-(14) and weight."""
        frame = self.frame(x)
        f, rates = self._fields_in(frame), frame.rates(self.vectors(u))
        force = self._inertia_force(f, rates) - self._borne(f, rates.bias[:, None])[:, 0]
        if any(self.gravity):
            g = np.einsum("i,bij->bj", np.array(self.gravity), frame.A)[:, :, None]
            force += self._pulled(f, np.broadcast_to(g, (len(x), 3, self.n_points))[:, None])[:, 0]
        out[:, self.columns] += frame.onto_vectors(force[:, None]).reshape(len(x), -1)

    def _pulled(self, f: Fields, a: Array) -> Array:
        """Return forces on the coordinates of forces per mass at the points, (n_batch, m, 3, n_points)."""
        own, each = self.shortening, a * self.points[1]
        axial, v = self._axial(f)[:, None], f.v[:, None]
        n_w, n_v = self.n_w, self.n_v
        F = np.zeros((*a.shape[:2], self.mesh.n_vectors, 3))
        F[:, :, 0] = each.sum(axis=3)
        F[:, :, 1:, 0] = own.pulled(each[:, :, 0], n_w)
        for c in _TWO:
            F[:, :, 1, 1 + c] = np.sum(each[:, :, 1 + c] * axial - each[:, :, 0] * v[:, :, c], axis=2)
            bent = own.weighted(each[:, :, 0], f.bent[:, c], n_v)
            F[:, :, 2:, 1 + c] = own.pulled(each[:, :, 1 + c], n_v) - bent
        return F

    def _borne(self, f: Fields, rates: Array) -> Array:
        """Return the mass matrix times rates of the coordinates, both (n_batch, m, n_vectors, 3)."""
        own, beta = self.shortening, rates[:, :, 1, ACROSS, None]
        root, w, v = rates[:, :, 0, :, None], rates[:, :, 1:, 0], rates[:, :, 2:, ACROSS].swapaxes(2, 3)
        a = np.empty((*rates.shape[:2], 3, self.n_points))
        turned = np.sum(beta * f.v[:, None], axis=2)
        a[:, :, 0] = root[:, :, 0] + own.values(own.of_elements(w)) - turned
        for c in _TWO:
            each = own.of_elements(v[:, :, c])
            a[:, :, 0] -= own.short(f.bent[:, c], each)
            a[:, :, 1 + c] = root[:, :, 1 + c] + beta[:, :, c] * self._axial(f)[:, None] + own.values(each)
        F = self._pulled(f, a)
        F[:, :, 1, ACROSS] += (self._left_out(f) @ self.points[1])[:, None, None] * beta[..., 0]
        return F

    def _inertia_force(self, f: Fields, rates: RootRates) -> Array:
        own, m, beta = self.shortening, self.points[1], rates.beta[:, :, None]
        dv = own.of_elements(rates.p[:, 2:, ACROSS].swapaxes(1, 2))
        v1, w1 = own.values(dv), own.values(own.of_elements(rates.p[:, 1:, 0]))
        short1, short2 = self._short(f.bent, dv), self._short(own.bent(dv), dv)
        square, spun, turned = np.sum(beta**2, axis=1), *(np.sum(beta * a, axis=1) for a in (f.v, v1))
        a = np.empty((len(beta), 3, self.n_points))
        a[:, 0] = -square * self._axial(f) - 2.0 * turned - short2
        a[:, 1:] = beta * (2.0 * (w1 - short1) - spun)[:, None]
        F = self._pulled(f, a[:, None])[:, 0]
        if not self.whole:
            # of third order and above: along the beam on H v and v, across it on the axial place
            dropped = (square * f.short - short2) * m
            across = (f.short * spun - 2.0 * (f.short * (w1 - short1) + f.w * short1)) * m
            for c in _TWO:
                F[:, 2:, 1 + c] += own.weighted(dropped[:, None], f.bent[:, c], self.n_v)[:, 0]
                F[:, 1, 1 + c] += np.sum(dropped * f.v[:, c] - across * beta[:, c], axis=1)
        return -F

    # ------------------------------------------------------------------ energies

    def potential_energy(self, t: Array, x: Array) -> Array:
        """Return the energy of the weight [J]."""
        m, frame, X = self.points[1], self.frame(x), self.vectors(x)
        f = self._fields_in(frame)
        arm = np.concatenate([(self._axial(f) @ m)[:, None], f.v @ m], axis=1)
        at = m.sum() * X[:, 0] + (frame.A @ arm[:, :, None])[:, :, 0]
        return np.asarray(-at @ np.array(self.gravity))
