"""Energy of centre lines by Gauss quadrature, for any strain and curvature."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace
from functools import cached_property
from typing import Self

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.parts.elements._base import GramLaw
from hfsim.parts.elements.polynomial import exact_points, gauss_rows, in_products

LAST_GRAM_HESSIAN = 6
"""Highest degree at which the Hessian, asked for in one state, is taken from products of vectors where the
energy is polynomial: a third to a tenth of the time by quadrature."""


@frozen
class QuadratureLaw:
    """Energy of any strain and curvature measure by Gauss quadrature.

    Attributes
    ----------
    axial, bending : ndarray, shape (n_points, n_elements) each, or (1, n_elements)
        EA le and EI / le at the Gauss points [J]; one row where they are the same at all points.
    engineering, exact_curvature : bool
        Strain |r'| - 1 instead of Green's; curvature |r' x r''|/|r'|^2 instead of |r''|.
    axial_points, bending_points : int
        Gauss points per element.
    degree, n_dim : int
        Of the element and of space.
    """

    axial: Array
    bending: Array
    engineering: bool
    exact_curvature: bool
    axial_points: int
    bending_points: int
    degree: int = 3
    n_dim: int = 2

    @property
    def integrals(self) -> str:
        """How the integrals are done, in the words of plans."""
        bending = f"{self.bending_points} for bending"
        return f"{self.axial_points} Gauss points an element for the axial energy, {bending}"

    @property
    def quartic(self) -> bool:
        """Whether the strain is Green's and the curvature linear."""
        return not self.engineering and not self.exact_curvature

    @property
    def shared(self) -> Hashable:
        """Measures, points and degree; elements differ in their stiffness only."""
        points = self.axial_points, self.bending_points, len(self.axial), len(self.bending)
        return self.engineering, self.exact_curvature, points, self.degree, self.n_dim

    def joined(self, other: QuadratureLaw) -> Self:
        """Return the law of this one's elements followed by the other's."""
        return replace(
            self,
            axial=np.concatenate([self.axial, other.axial], axis=1),
            bending=np.concatenate([self.bending, other.bending], axis=1),
        )

    def energy(self, V: Array) -> Array:
        """Return the stored energy [J], shape (..., n_elements)."""
        w, slope, _ = gauss_rows(self.axial_points, self.degree)
        strain = self._strain(slope @ V)[0]
        wb, slope, bend = gauss_rows(self.bending_points, self.degree)
        c = bend @ V
        kappa2 = np.sum(c * c, axis=-1)
        if self.exact_curvature:
            normal, square, _ = _across(slope @ V, c)
            kappa2 = np.sum(normal * normal, axis=-1) / square
        if self._alike:
            return np.asarray(0.5 * self.axial[0] * (strain**2 @ w) + 0.5 * self.bending[0] * (kappa2 @ wb))
        axial, bending = self.axial.T * w, self.bending.T * wb
        return np.asarray(0.5 * np.sum(axial * strain**2, axis=-1) + 0.5 * np.sum(bending * kappa2, axis=-1))

    @property
    def _alike(self) -> bool:
        """Whether the points of an element have the same stiffness."""
        return len(self.axial) == len(self.bending) == 1

    @property
    def _count(self) -> int:
        """Number of elements."""
        return int(self.axial.shape[1])

    def pull(self, v: Array) -> Array:
        """Return dU/dV [J] in rows."""
        return self._with_exact_curvature(v) if self.exact_curvature else self._with_linear_curvature(v)

    def hessian(self, V: Array) -> Array:
        """Return d2U/dV2 [J], shape (..., n_elements, n_vectors n_dim, n_vectors n_dim)."""
        if self._products is not None:
            return self._products.hessian(V)
        return self._axial_hessian(V) + self._bending_hessian(V)

    @cached_property
    def _products(self) -> GramLaw | None:
        """The same energy by products of vectors, where that is the cheaper way to the Hessian."""
        exact = self.axial_points >= exact_points(self.degree) and self.bending_points >= self.degree - 1
        if self.quartic and exact and self._alike and self.degree <= LAST_GRAM_HESSIAN:
            return in_products(self.axial[0], self.bending[0], self.degree, self.n_dim)
        return None

    @cached_property
    def _rows(self) -> tuple[Array, Array, Array, tuple[Array, Array] | None]:
        """Rows of r' and r'', their transpose, |r'|^2 without strain, and factors of points of elements.

        The fourth root of the axial weight is in the rows of r' if the strain is Green's, whose force is
        cubic, and the root of the bending weight in those of r''; so are EA le and EI / le if all elements
        have the same, so that nothing else is multiplied by them.
        """
        w, slope, _ = gauss_rows(self.axial_points, self.degree)
        wb, _, bend = gauss_rows(self.bending_points, self.degree)
        first = self.axial[0, 0], self.bending[0, 0]
        alike = self._alike and np.all(self.axial == first[0]) and np.all(self.bending == first[1])
        axial, bending = first if alike else (1.0, 1.0)
        root = np.sqrt(0.5 * w * axial)[:, None]
        rows = np.concatenate([np.sqrt(root) * slope, np.sqrt(wb * bending)[:, None] * bend])
        factor = None if alike else (self.axial[..., None], self.bending[:, None, :, None])
        return rows, np.ascontiguousarray(rows.T), root, factor

    def _with_linear_curvature(self, v: Array) -> Array:
        """Return dU/dV [J] in rows, with the curvature r''.

        The Green strain's share is the sum of w/2 (|s|^2 - 1) s over the Gauss points, s = r'.
        """
        rows, scatter, one, factor = self._rows
        z = np.dot(rows, v.reshape(len(v), -1))
        s = z.reshape(len(z), *v.shape[1:])[: self.axial_points]
        tension = _dots(s, s)
        if self.engineering:
            # w (|s| - 1) s / |s| of what was multiplied by root^(1/2)
            tension = one * (2.0 - 2.0 * np.sqrt(one) / np.sqrt(tension))
        else:
            tension -= one
        if factor is not None:
            tension = tension.reshape(len(tension), self._count, -1) * factor[0]
            bent = z[self.axial_points :].reshape(-1, self.n_dim, self._count, v.shape[-1] // self._count)
            bent *= factor[1]
        s *= tension.reshape(len(tension), 1, -1)
        return np.asarray(np.dot(scatter, z)).reshape(v.shape)

    def _strain(self, s: Array) -> tuple[Array, Array, Array]:
        """Strain, and the factors of s and of the unit tensor in its first and second derivative."""
        square = np.sum(s * s, axis=-1)
        if not self.engineering:
            return 0.5 * (square - 1.0), np.ones_like(square), np.zeros_like(square)
        stretch = np.sqrt(square)
        return stretch - 1.0, 1.0 / stretch, -1.0 / stretch**3

    def _axial_hessian(self, V: Array, given: Array | None = None) -> Array:
        """Return the share of the stretch, of given strains (..., n_elements, n_points) if there are some."""
        w, rows, _ = gauss_rows(self.axial_points, self.degree)
        s = rows @ V
        strain, first, second = self._strain(s)
        strain = strain if given is None else given
        dyad = (first**2 + strain * second)[..., None, None] * s[..., :, None] * s[..., None, :]
        point = dyad + (strain * first)[..., None, None] * np.eye(V.shape[-1])
        point *= (self.axial.T * w)[..., None, None]
        return _congruence(rows, rows, point)

    @cached_property
    def _all_rows(self) -> tuple[Array, Array]:
        """Rows of r' at the axial points, of r' and of r'' at the bending points; and as columns."""
        _, axial, _ = gauss_rows(self.axial_points, self.degree)
        _, slope, bend = gauss_rows(self.bending_points, self.degree)
        rows = np.concatenate([axial, slope, bend])
        return rows, np.ascontiguousarray(rows.T)

    @cached_property
    def _weights(self) -> tuple[Array, Array]:
        """EA le / 2 and EI / le times the Gauss weights, shape (n_points, n_elements, 1)."""
        w, _, _ = gauss_rows(self.axial_points, self.degree)
        wb, _, _ = gauss_rows(self.bending_points, self.degree)
        axial, bending = 0.5 * w[:, None] * self.axial, wb[:, None] * self.bending
        return axial[..., None], bending[..., None]

    def _with_exact_curvature(self, v: Array) -> Array:
        """Return dU/dV with both strain measures at once.

        With s = r', c = r'' and n = c - (s.c / |s|^2) s, its part across the axis, the curvature's square is
        |n|^2 / |s|^2; half its derivatives by c and s are n / |s|^2 and -((s.c) n + |n|^2 s) / |s|^4.
        """
        rows, columns = self._all_rows
        axial, bending = self._weights
        z = np.dot(rows, v.reshape(len(v), -1)).reshape(len(rows), self.n_dim, self._count, -1)
        out = np.empty_like(z)
        first, second = self.axial_points, self.axial_points + self.bending_points
        a, s, c = z[:first], z[first:second], z[second:]
        square = _dots(s, s)
        share = (_dots(s, c) / square)[:, None]
        normal = c - share * s
        moment = np.multiply((bending / square)[:, None], normal, out[second:])
        inward = -_dots(moment, normal) / square
        np.multiply(inward[:, None], s, out[first:second])
        out[first:second] -= share * moment
        stretch2 = _dots(a, a)
        strain = 2.0 - 2.0 / np.sqrt(stretch2) if self.engineering else stretch2 - 1.0
        np.multiply((axial * strain)[:, None], a, out[:first])
        return np.asarray(np.dot(columns, out.reshape(len(rows), -1))).reshape(v.shape)

    def _bending_hessian(self, V: Array) -> Array:
        w, slope, bend = gauss_rows(self.bending_points, self.degree)
        weight, unit = (self.bending.T * w)[..., None, None], np.eye(V.shape[-1])
        if not self.exact_curvature:
            at_points = (*V.shape[:-2], len(w), *unit.shape)
            return _congruence(bend, bend, weight * np.broadcast_to(unit, at_points))
        s, c = slope @ V, bend @ V
        normal, square, share = _across(s, c)
        S, p, N = square[..., None, None], share[..., None, None], np.sum(normal**2, axis=-1)[..., None, None]
        nn, ns, ss = (a[..., :, None] * b[..., None, :] for a, b in ((normal, normal), (normal, s), (s, s)))
        across = unit - ss / S
        sn = ns.swapaxes(-1, -2)
        by_ss = (p * p - N / S) * unit - nn / S + 3.0 * p / S * (ns + sn) + (4.0 * N / S - p * p) / S * ss
        by_sc = -(ns + 2.0 * sn) / S - p * across
        mixed = _congruence(slope, bend, weight / S * by_sc)
        return (
            _congruence(slope, slope, weight / S * by_ss)
            + _congruence(bend, bend, weight / S * across)
            + mixed
            + mixed.swapaxes(-1, -2)
        )


def _dots(a: Array, b: Array) -> Array:
    """Return the products of vectors whose components are the second axis: few, for which a sum is slow."""
    products = a * b
    total = products[:, 0]
    for k in range(1, products.shape[1]):
        total += products[:, k]
    return total


def _across(s: Array, c: Array) -> tuple[Array, Array, Array]:
    """Return the part of c across s, |s|^2 and s.c / |s|^2."""
    square = np.sum(s * s, axis=-1)
    share = np.sum(s * c, axis=-1) / square
    return c - share[..., None] * s, square, share


def _congruence(left: Array, right: Array, point: Array) -> Array:
    """Sum of left_qa point_q right_qb over Gauss points, as a matrix over (vector, component)."""
    points, n = left.shape
    d = point.shape[-1]
    products = (left[:, :, None] * right[:, None, :]).reshape(points, n * n)
    flat = point.reshape(*point.shape[:-2], d * d).swapaxes(-1, -2)
    full = (flat @ products).reshape(*point.shape[:-3], d, d, n, n)
    axes = full.ndim
    order = (*range(axes - 4), axes - 2, axes - 4, axes - 1, axes - 3)
    return np.asarray(full.transpose(order).reshape(*point.shape[:-3], n * d, n * d))
