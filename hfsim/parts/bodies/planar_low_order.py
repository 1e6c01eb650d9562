"""Low-order approximate model: axial variable w with the foreshortening term (paper, eq. 44-46).

Relative position of the centre line: s' = [x + w - 1/2 v^T H(x) v, v(x)] with
H(x) = int_0^x N'^T N' (design, decision 8).  Mass matrix and inertia force are kept through second
order in the elastic coordinates and their rates jointly, or whole with ``truncation: none``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array, BoolArray
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import rotate
from hfsim.maths.shapes import gauss_legendre
from hfsim.parts.bodies.blueprint import Blueprint
from hfsim.parts.bodies.foreshortened import Fields, ForeshortenedBeam

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

    @cached_property
    def n(self) -> int:
        """Number of coordinates."""
        return RIGID + self.n_w + self.n_v

    @cached_property
    def lengths(self) -> BoolArray:
        """The place of its frame, and values of w and v at nodes."""
        own = self.mesh.positions > 0.0
        return np.concatenate([[True, True, False], own[1:], own[2:]])

    @cached_property
    def of_w(self) -> slice:
        """Where the axial coordinates stand among its own."""
        return slice(RIGID, RIGID + self.n_w)

    @cached_property
    def of_v(self) -> slice:
        """Where the transverse coordinates stand among its own."""
        return slice(RIGID + self.n_w, self.n)

    @property
    def _elastic(self) -> slice:
        """Where the coordinates of the deformation stand in x."""
        return slice(self.columns.start + RIGID, self.columns.stop)

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

    def _fields(self, x: Array) -> Fields:
        own = self.shortening
        _, _, w, v = self.split(x)
        each = own.of_elements(v)
        bent = own.bent(each)
        values = own.values(own.of_elements(w)), own.values(each)
        return Fields(*values, bent, 0.5 * self._short(bent, each))

    def _weighted(self, force: Array, bent: Array) -> Array:
        return self.shortening.weighted(force[:, None], bent, self.n_v)[:, 0]

    def _short(self, bent: Array, v: Array) -> Array:
        """Return u^T H v at the points, (n_batch, n_points), of coordinates u of elements."""
        return self.shortening.short(bent, v[:, None])[:, 0]

    def momenta(self, x: Array, rates: Array) -> Array:
        """Return the mass matrix times rates, (n_batch, m, n)."""
        own, f = self.shortening, self._fields(x)
        theta, omega = self.split(x)[1][:, None], rates[..., TURN, None]
        dr = rotate(-theta, rates[..., PLACE])[..., None]
        dw, dv = own.of_elements(rates[..., self.of_w]), own.of_elements(rates[..., self.of_v])
        along = dr[..., 0, :] - omega * f.v[:, None] + own.values(dw) - own.short(f.bent, dv)
        across = dr[..., 1, :] + omega * self._axial(f)[:, None] + own.values(dv)
        return self._momenta(theta, f, omega, along, across)

    def _momenta(self, theta: Array, f: Fields, omega: Array, along: Array, across: Array) -> Array:
        """Return the momenta of velocities of the points, in the frame, (n_batch, m, n_points)."""
        own, m = self.shortening, self.points[1]
        left_out = omega * self._left_out(f)[:, None] @ m[:, None]
        along, across = along * m, across * m
        P = np.empty((*along.shape[:2], self.n))
        P[..., PLACE] = rotate(theta, np.stack([along.sum(axis=-1), across.sum(axis=-1)], axis=-1))
        turning = self._axial(f)[:, None] * across - f.v[:, None] * along
        P[..., TURN] = turning.sum(axis=-1) + left_out[..., 0]
        P[..., self.of_w] = own.pulled(along, self.n_w)
        P[..., self.of_v] = own.pulled(across, self.n_v) - own.weighted(along, f.bent, self.n_v)
        return P

    @property
    def inner(self) -> int:
        """Where the coordinates that the root holds begin: place, angle and stretch at the root go before."""
        return RIGID + 1

    def condensed(self, x: Array) -> tuple[Array, Callable[[Array], Array]]:
        """Return rows of the mass matrix, of the coordinates before, and what solves with the rest of it."""
        f, n, theta = self._fields(x), self.n_v, self.split(x)[1]
        rows = self._momenta(theta[:, None], f, *self._outer_motions(theta, f))
        solve = self.shortening.solver([f.bent])

        def solved(force: Array) -> Array:
            found = solve(np.stack([force[..., :n], force[..., n:]], axis=-1))
            return np.concatenate([found[..., 0], found[..., 1]], axis=-1)

        return rows, solved

    def _outer_motions(self, theta: Array, f: Fields) -> tuple[Array, Array, Array]:
        """Return unit motions of place, angle and stretch at the root as `_momenta` takes them."""
        b, points = f.w.shape
        along, across = np.zeros((2, b, self.inner, points))
        along[:, 0], along[:, 1] = np.cos(theta)[:, None], np.sin(theta)[:, None]
        across[:, 0], across[:, 1] = -along[:, 1], along[:, 0]
        along[:, TURN], across[:, TURN] = -f.v, self._axial(f)
        along[:, RIGID] = self.shortening.values(self.shortening.of_elements(np.eye(1, self.n_w)))
        return (np.arange(self.inner) == TURN).astype(float)[:, None], along, across

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add inertia force (13)-(14), elastic, damping and gravity forces."""
        f = self._fields(x)
        out[:, self.columns] += self._inertia_force(f, x, u)
        K, damping = self._resisting
        elastic = self._elastic_coordinates(x) @ -K
        elastic -= self._elastic_coordinates(u) @ damping
        out[:, self._elastic] += elastic
        if any(self.gravity):
            out[:, self.columns] += self._gravity_force(f, x)

    def _elastic_coordinates(self, x: Array) -> Array:
        return x[:, self._elastic]

    def _inertia_force(self, f: Fields, x: Array, u: Array) -> Array:
        own, place, m = self.shortening, *self.points
        theta, (_, omega, dw, dv) = self.split(x)[1], self.split(u)
        omega, rates = omega[:, None], own.of_elements(dv)
        w1, v1, short1 = own.values(own.of_elements(dw)), own.values(rates), self._short(f.bent, rates)
        short2 = self._short(own.bent(rates), rates)
        along = -(omega**2) * self._axial(f) - 2.0 * omega * v1 - short2
        across = -(omega**2) * f.v + 2.0 * omega * (w1 - short1)
        Q = np.zeros((len(x), self.n))
        Q[:, PLACE] = -rotate(theta, m @ np.stack([along, across], axis=-1))
        rotary = 2.0 * omega * (place * (w1 - short1) + f.w * w1 + f.v * v1)
        # multiplies H v, itself of first order: kept through first order
        lever = omega**2 * (place + f.w) + 2.0 * omega * v1
        if self.whole:
            rotary = rotary + f.v * short2
            rotary -= 2.0 * omega * (f.short * w1 + f.w * short1 - f.short * short1)
            lever = lever - omega**2 * f.short + short2
        Q[:, TURN] = -rotary @ m
        Q[:, self.of_w] = -own.pulled(along * m, self.n_w)
        Q[:, self.of_v] = -own.pulled(across * m, self.n_v) - self._weighted(lever * m, f.bent)
        return Q

    def _gravity_force(self, f: Fields, x: Array) -> Array:
        theta = self.split(x)[1][:, None]
        g = rotate(-theta, np.broadcast_to(np.array(self.gravity), (len(x), 1, 2)))
        falling = (np.broadcast_to(g[..., k, None], (len(x), 1, self.n_points)) for k in range(2))
        return self._momenta(theta, f, np.zeros((1, 1)), *falling)[:, 0]

    def strain_energy(self, x: Array) -> Array:
        """Return the elastic energy [J]."""
        e = self._elastic_coordinates(x)
        return np.asarray(0.5 * np.sum((e @ self._resisting[0]) * e, axis=-1))

    def potential_energy(self, t: Array, x: Array) -> Array:
        """Return the energy of the weight [J]."""
        m, f = self.points[1], self._fields(x)
        r0, theta, _, _ = self.split(x)
        arm = np.stack([self._axial(f) @ m, f.v @ m], axis=-1)
        return np.asarray(-(m.sum() * r0 + rotate(theta, arm)) @ np.array(self.gravity))

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return the power that damping takes out [W], never positive."""
        e = self._elastic_coordinates(u)
        return np.asarray(-np.sum((e @ self._resisting[1]) * e, axis=-1))
