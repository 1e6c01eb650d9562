"""Low-order approximate model: axial variable w with the foreshortening term (paper, eq. 44-46).

Relative position of the centre line: s' = [x + w - 1/2 v^T H(x) v, v(x)] with
H(x) = int_0^x N'^T N' (design, decision 8).  Mass matrix and inertia force are kept through second
order in the elastic coordinates and their rates jointly, or whole with ``truncation: none``.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, BoolArray
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import normal, rotate
from hfsim.maths.shapes import gauss_legendre
from hfsim.parts.bodies.blueprint import Blueprint
from hfsim.parts.bodies.foreshortened import ForeshortenedBeam, weighted

PLACE, TURN, RIGID = slice(0, 2), 2, 3
"""Where place and angle of a beam's frame stand among its coordinates, and where its deformation begins."""


@frozen
class LowOrderBeam(ForeshortenedBeam):
    """One beam in the coordinates (r0, theta, w, v).

    The elastic coordinates are the nodal values and slopes of w (root value left out) followed by
    those of v (root value and slope left out), in the shapes of every other model; interior ones of
    an element stand between those of its nodes.
    """

    @classmethod
    def of(cls, beam: Blueprint) -> LowOrderBeam:
        """Return the beam of a deck."""
        return cls(
            name=beam.name,
            mesh=beam.mesh,
            columns=beam.columns(RIGID + 2 * beam.mesh.n_vectors - 3),
            gravity=tuple(beam.gravity),
            whole=beam.whole,
            item=beam.item,
        )

    def straightened(self, q: Array) -> Array:
        """Return coordinates with no deformation."""
        straight = q.copy()
        straight[RIGID:] = 0.0
        return straight

    @property
    def dissipates(self) -> bool:
        """Whether there is damping."""
        return self.mesh.properties.damped

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return RIGID + self.n_w + self.n_v

    @property
    def of_w(self) -> slice:
        """Where the axial coordinates stand among its own."""
        return slice(RIGID, RIGID + self.n_w)

    @property
    def of_v(self) -> slice:
        """Where the transverse coordinates stand among its own."""
        return slice(RIGID + self.n_w, self.n)

    @property
    def _elastic(self) -> slice:
        """Where the coordinates of the deformation stand in x."""
        return slice(self.columns.start + RIGID, self.columns.stop)

    @cached_property
    def _below(self) -> BoolArray:
        """Which entries of a matrix (n, n) are below its diagonal."""
        return np.tri(self.n, k=-1, dtype=bool)

    @cached_property
    def _resisting(self) -> tuple[Array, Array]:
        """Matrix of EA w'' and EI v'''' over all elastic coordinates, and that of their damping."""
        le = self.mesh.element.length
        xi, w = gauss_legendre(self.mesh.element.degree + 1)
        x = (np.arange(self.mesh.count)[:, None] + xi).ravel() * le
        weight = np.tile(w, self.mesh.count) * le
        strain = self.mesh.shape(x, 0.0, (1, 0))[:, 1:]
        bend = self.mesh.shape(x, 0.0, (2, 0))[:, 2:]
        size = self.n_w + self.n_v
        K, damping, own = np.zeros((size, size)), np.zeros((size, size)), self.mesh.at(x)
        each = zip((K, damping), (1.0, own.axial_damping), (1.0, own.bending_damping), strict=True)
        for matrix, axial, bending in each:
            by_length = (own.axial_stiffness * axial) * (strain.T * weight)
            matrix[: self.n_w, : self.n_w] = by_length @ strain
            matrix[self.n_w :, self.n_w :] = (own.bending_stiffness * bending) * (bend.T * weight) @ bend
        return K, damping

    def split(self, x: Array) -> tuple[Array, Array, Array, Array]:
        """Return r0, theta, w and v coordinates of a batch."""
        b = x[:, self.columns]
        return b[:, PLACE], b[:, TURN], b[:, self.of_w], b[:, self.of_v]

    def _fields(self, x: Array, u: Array) -> _Fields:
        _, _, N_w, N_v, H = self.points
        _, _, w, v = self.split(x)
        _, _, dw, dv = self.split(u)
        Hv = (v @ H).reshape(len(x), -1, self.n_v)
        Hdv = (dv @ H).reshape(len(x), -1, self.n_v)
        return _Fields(
            w=w @ N_w.T,
            v=v @ N_v.T,
            dw=dw @ N_w.T,
            dv=dv @ N_v.T,
            Hv=Hv,
            short=0.5 * (Hv @ v[:, :, None])[:, :, 0],
            dshort=(Hdv @ v[:, :, None])[:, :, 0],
            ddshort=(Hdv @ dv[:, :, None])[:, :, 0],
        )

    def mass(self, x: Array) -> Array:
        """Return the mass matrix (10)-(12) kept as eq. (46) says, shape (n_batch, n, n)."""
        place, m, N_w, N_v, _ = self.points
        f = self._fields(x, np.zeros_like(x))
        theta = self.split(x)[1]
        W, V, nw = self.of_w, self.of_v, self.n_w
        M = np.zeros((len(x), self.n, self.n))
        axial = place + f.w - f.short
        M[:, 0, 0] = M[:, 1, 1] = m.sum()
        M[:, PLACE, TURN] = rotate(theta, np.stack([-(f.v @ m), axial @ m], axis=-1))
        along = np.concatenate([np.broadcast_to(m @ N_w, (len(x), nw)), -(m @ f.Hv)], axis=1)
        across = np.broadcast_to(np.concatenate([np.zeros(nw), m @ N_v]), along.shape)
        M[:, PLACE, RIGID:] = rotate(theta[:, None], np.stack([along, across], axis=-1)).swapaxes(1, 2)
        M[:, TURN, TURN] = self._rotary(f) @ m
        M[:, TURN, W] = -(f.v * m) @ N_w
        M[:, TURN, V] = (axial * m) @ N_v + weighted(f.v * m, f.Hv)
        M[:, W, W] = (N_w.T * m) @ N_w
        M[:, W, V] = -((N_w.T * m) @ f.Hv)
        M[:, V, V] = (N_v.T * m) @ N_v + (f.Hv.swapaxes(1, 2) * m) @ f.Hv
        return np.where(self._below, M.swapaxes(1, 2), M)

    def _rotary(self, f: _Fields) -> Array:
        """Return s'.s' at the quadrature points; the w v^2 and v^4 parts only when whole."""
        place = self.points[0]
        square = place**2 + 2.0 * place * (f.w - f.short) + f.w**2 + f.v**2
        if self.whole:
            square = square - 2.0 * f.w * f.short + f.short**2
        return np.asarray(square)

    def third_order_inertia(self, x: Array) -> float:
        """Return the largest part of the moment of inertia that eq. (46) leaves out, over the part kept."""
        m = self.points[1]
        f = self._fields(x, np.zeros_like(x))
        kept = (self.points[0] ** 2) @ m
        return float(np.abs((f.short**2 - 2.0 * f.w * f.short) @ m).max(initial=0.0) / kept)

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add inertia force (13)-(14), elastic, damping and gravity forces."""
        out[:, self.columns] += self._inertia_force(x, u)
        K, damping = self._resisting
        elastic = self._elastic_coordinates(x) @ -K
        elastic -= self._elastic_coordinates(u) @ damping
        out[:, self._elastic] += elastic
        if any(self.gravity):
            out[:, self.columns] += self._gravity_force(x)

    def _elastic_coordinates(self, x: Array) -> Array:
        return x[:, self._elastic]

    def _inertia_force(self, x: Array, u: Array) -> Array:
        place, m, N_w, N_v, _ = self.points
        f = self._fields(x, u)
        theta = self.split(x)[1]
        omega = self.split(u)[1][:, None]
        axial = place + f.w - f.short
        along = -(omega**2) * axial - 2.0 * omega * f.dv - f.ddshort
        across = -(omega**2) * f.v + 2.0 * omega * (f.dw - f.dshort)
        accel = np.stack([along, across], axis=-1)
        Q = np.zeros((len(x), self.n))
        Q[:, PLACE] = -rotate(theta, m @ accel)
        rotary = 2.0 * omega * (place * (f.dw - f.dshort) + f.w * f.dw + f.v * f.dv)
        # multiplies H v, itself of first order: kept through first order
        lever = omega**2 * (place + f.w) + 2.0 * omega * f.dv
        if self.whole:
            rotary = rotary + f.v * f.ddshort
            rotary -= 2.0 * omega * (f.short * f.dw + f.w * f.dshort - f.short * f.dshort)
            lever = lever - omega**2 * f.short + f.ddshort
        Q[:, TURN] = -rotary @ m
        Q[:, self.of_w] = -(accel[..., 0] * m) @ N_w
        Q[:, self.of_v] = -(accel[..., 1] * m) @ N_v - weighted(lever * m, f.Hv)
        return Q

    def _gravity_force(self, x: Array) -> Array:
        place, m, N_w, N_v, _ = self.points
        f = self._fields(x, np.zeros_like(x))
        theta = self.split(x)[1]
        g = rotate(-theta, np.broadcast_to(np.array(self.gravity), self.split(x)[0].shape))
        Q = np.zeros((len(x), self.n))
        Q[:, PLACE] = m.sum() * np.array(self.gravity)
        arm = np.stack([(place + f.w - f.short) @ m, f.v @ m], axis=-1)
        Q[:, TURN] = np.sum(normal(arm) * g, axis=-1)
        Q[:, self.of_w] = g[:, :1] * (m @ N_w)
        Q[:, self.of_v] = g[:, 1:] * (m @ N_v) - g[:, :1] * (m @ f.Hv)
        return Q

    def kinetic_energy(self, x: Array, u: Array) -> Array:
        """Return 1/2 u^T M u with the mass matrix of the model [J]."""
        w = u[:, self.columns]
        return np.asarray(0.5 * np.einsum("bi,bij,bj->b", w, self.mass(x), w))

    def strain_energy(self, x: Array) -> Array:
        """Return the elastic energy [J]."""
        e = self._elastic_coordinates(x)
        return np.asarray(0.5 * np.sum((e @ self._resisting[0]) * e, axis=-1))

    def potential_energy(self, t: Array, x: Array) -> Array:
        """Return the energy of the weight [J]."""
        place, m, _, _, _ = self.points
        f = self._fields(x, np.zeros_like(x))
        r0, theta, _, _ = self.split(x)
        arm = np.stack([(place + f.w - f.short) @ m, f.v @ m], axis=-1)
        return np.asarray(-(m.sum() * r0 + rotate(theta, arm)) @ np.array(self.gravity))

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return the power that damping takes out [W], never positive."""
        e = self._elastic_coordinates(u)
        return np.asarray(-np.sum((e @ self._resisting[1]) * e, axis=-1))


class _Fields(NamedTuple):
    """Values at the quadrature points, shape (n_batch, n_points); rates have a d in front."""

    w: Array
    v: Array
    dw: Array
    dv: Array
    Hv: Array
    """H v, shape (n_batch, n_points, n_v)."""
    short: Array
    """Foreshortening 1/2 v^T H v [m], and v^T H v', v'^T H v' below."""
    dshort: Array
    ddshort: Array
