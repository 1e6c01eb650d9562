"""Beam element on its centre line: position and slope vector at both nodes, cubic Hermite.

Energy per length EA/2 strain^2 + EI/2 curvature^2 (design, decision 3).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from hfsim.arrays import Array
from hfsim.elements._base import USUAL, ElasticLaw, GramLaw, Inertia, Measures, Stiffness
from hfsim.shapes import gauss_legendre, hermite


def difference_rows(points: Array, derivative: int) -> Array:
    """Derivatives of the centre line with respect to xi, as rows over (chord, first slope, last slope)."""
    return hermite(points, derivative)[:, [2, 1, 3]]


@lru_cache(maxsize=32)
def gauss_rows(points: int) -> tuple[Array, Array, Array]:
    """Return Gauss weights and the rows of r' and r'' (times le) at the Gauss points of an element."""
    x, w = gauss_legendre(points)
    return w, difference_rows(x, 1), difference_rows(x, 2)


@lru_cache(maxsize=1)
def _gram_tables() -> tuple[Array, Array, Array]:
    """Integrals over the unit element: strain products, strain, curvature products; all exact."""
    w, slope, bend = gauss_rows(5)
    beta = np.einsum("qa,qb->qab", slope, slope).reshape(len(w), 9)
    gamma = np.einsum("qa,qb->qab", bend, bend).reshape(len(w), 9)
    return np.asarray((beta.T * w) @ beta), np.asarray(w @ beta), np.asarray(w @ gamma)


def mean_square_slope() -> Array:
    """Return the matrix g, shape (3, 3), with mean of r'.r' over an element = sum g_ab V_a . V_b."""
    return _gram_tables()[1].reshape(3, 3)


def green_linear_law(stiffness: Stiffness, length: float, count: int) -> GramLaw:
    """Energy with Green strain (eq. 47 on the centre line) and curvature r''; polynomial, so exact."""
    quadratic, _, curvature = _gram_tables()
    ratio = stiffness.bending / (stiffness.axial * length**2)
    return GramLaw(
        quadratic=0.25 * quadratic,
        linear=np.tile(0.5 * ratio * curvature, (count, 1)),
        reference=np.ones(9),
        scale=np.full(count, stiffness.axial * length),
    )


@dataclass(frozen=True)
class QuadratureLaw:
    """Energy of any strain and curvature measure by Gauss quadrature.

    Attributes
    ----------
    axial, bending : ndarray, shape (n_elements,)
        EA le and EI / le [J].
    engineering, exact_curvature : bool
        Strain |r'| - 1 instead of Green's; curvature (r' x r'')/|r'|^2 instead of r''.
    axial_points, bending_points : int
        Gauss points per element.
    """

    axial: Array
    bending: Array
    engineering: bool
    exact_curvature: bool
    axial_points: int
    bending_points: int

    def joined(self, other: QuadratureLaw) -> QuadratureLaw:
        """Return the law of this one's elements followed by the other's."""
        return replace(
            self,
            axial=np.concatenate([self.axial, other.axial]),
            bending=np.concatenate([self.bending, other.bending]),
        )

    def energy(self, V: Array) -> Array:
        """Return the stored energy [J], shape (..., n_elements)."""
        w, slope, _ = gauss_rows(self.axial_points)
        strain = self._strain(slope @ V)[0]
        wb, slope, bend = gauss_rows(self.bending_points)
        c = bend @ V
        kappa2 = self._curvature(slope @ V, c)[0] ** 2 if self.exact_curvature else np.sum(c * c, axis=-1)
        return np.asarray(0.5 * self.axial * (strain**2 @ w) + 0.5 * self.bending * (kappa2 @ wb))

    def gradient(self, V: Array) -> Array:
        """Return dU/dV [J], same shape as V."""
        return self._axial_gradient(V) + self._bending_gradient(V)

    def hessian(self, V: Array) -> Array:
        """Return d2U/dV2 [J], shape (..., n_elements, n_vectors n_dim, n_vectors n_dim)."""
        return self._axial_hessian(V) + self._bending_hessian(V)

    def _strain(self, s: Array) -> tuple[Array, Array, Array]:
        """Strain, and the factors of s and of the unit tensor in its first and second derivative."""
        square = np.sum(s * s, axis=-1)
        if not self.engineering:
            return 0.5 * (square - 1.0), np.ones_like(square), np.zeros_like(square)
        stretch = np.sqrt(square)
        return stretch - 1.0, 1.0 / stretch, -1.0 / stretch**3

    def _axial_gradient(self, V: Array) -> Array:
        w, slope, _ = gauss_rows(self.axial_points)
        s = slope @ V
        strain, first, _ = self._strain(s)
        weight = self.axial[:, None] * w * strain * first
        return np.asarray(slope.T @ (weight[..., None] * s))

    def _axial_hessian(self, V: Array) -> Array:
        w, rows, _ = gauss_rows(self.axial_points)
        s = rows @ V
        strain, first, second = self._strain(s)
        dyad = (first**2 + strain * second)[..., None, None] * s[..., :, None] * s[..., None, :]
        point = dyad + (strain * first)[..., None, None] * np.eye(V.shape[-1])
        point *= (self.axial[:, None] * w)[..., None, None]
        return _congruence(rows, rows, point)

    def _curvature(self, s: Array, c: Array) -> tuple[Array, Array, Array]:
        """Curvature (r' x r'')/|r'|^2 and its derivatives with respect to r' and r''."""
        square = np.sum(s * s, axis=-1)
        kappa = (s[..., 0] * c[..., 1] - s[..., 1] * c[..., 0]) / square
        by_c = np.stack([-s[..., 1], s[..., 0]], axis=-1) / square[..., None]
        by_s = np.stack([c[..., 1], -c[..., 0]], axis=-1) / square[..., None]
        return kappa, by_s - (2.0 * kappa / square)[..., None] * s, by_c

    def _bending_gradient(self, V: Array) -> Array:
        w, slope, bend = gauss_rows(self.bending_points)
        weight = self.bending[:, None] * w
        if not self.exact_curvature:
            return np.asarray(bend.T @ (weight[..., None] * (bend @ V)))
        kappa, by_s, by_c = self._curvature(slope @ V, bend @ V)
        moment = (weight * kappa)[..., None]
        return np.asarray(slope.T @ (moment * by_s) + bend.T @ (moment * by_c))

    def _bending_hessian(self, V: Array) -> Array:
        w, slope, bend = gauss_rows(self.bending_points)
        weight = (self.bending[:, None] * w)[..., None, None]
        if not self.exact_curvature:
            unit = np.broadcast_to(np.eye(V.shape[-1]), (*V.shape[:-2], len(w), 2, 2))
            return _congruence(bend, bend, weight * unit)
        s, c = slope @ V, bend @ V
        square = np.sum(s * s, axis=-1)[..., None, None]
        kappa, by_s, by_c = self._curvature(s, c)
        k = kappa[..., None, None]
        turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
        sc = turn / square - 2.0 * s[..., :, None] * by_c[..., None, :] / square
        ss = -2.0 / square * (s[..., :, None] * by_s[..., None, :] + by_s[..., :, None] * s[..., None, :])
        ss -= 2.0 * k / square * (np.eye(2) + 2.0 * s[..., :, None] * s[..., None, :] / square)
        ss += 4.0 * k / square**2 * s[..., :, None] * s[..., None, :]
        ss = by_s[..., :, None] * by_s[..., None, :] + k * ss
        sc = by_s[..., :, None] * by_c[..., None, :] + k * sc
        cc = by_c[..., :, None] * by_c[..., None, :]
        mixed = _congruence(slope, bend, weight * sc)
        return (
            _congruence(slope, slope, weight * ss)
            + _congruence(bend, bend, weight * cc)
            + mixed
            + mixed.swapaxes(-1, -2)
        )


def _congruence(left: Array, right: Array, point: Array) -> Array:
    """Sum of left_qa point_q right_qb over Gauss points, as a matrix over (vector, component)."""
    full = np.einsum("qa,...qij,qb->...aibj", left, point, right, optimize=True)
    n, d = left.shape[1], point.shape[-1]
    return np.asarray(full.reshape(*full.shape[:-4], n * d, n * d))


@dataclass(frozen=True)
class Cable:
    """The element ``cable`` of a deck: centre-line energy, no shear, no section deformation.

    Attributes
    ----------
    length : float
        Undeformed length [m].
    """

    length: float
    per_node: int = 2

    def differences(self) -> Array:
        """Return the matrix from (r1, r1', r2, r2') to (chord / le, r1', r2')."""
        h = self.length
        return np.array([[-1.0 / h, 0.0, 1.0 / h, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])

    def shape(self, xi: float, eta: float = 0.0, derivative: tuple[int, int] = (0, 0)) -> Array:
        """Return the shape row of the centre line, shape (4,); derivatives are with respect to x [m]."""
        scale = np.array([1.0, self.length, 1.0, self.length])
        return np.asarray(hermite(xi, derivative[0])[0] * scale / self.length ** derivative[0])

    def mass(self, inertia: Inertia) -> Array:
        """Return the consistent mass matrix [kg]; section rotary inertia acts on the slopes if given."""
        x, w = gauss_legendre(4)
        scale = np.array([1.0, self.length, 1.0, self.length])
        N, Nx = hermite(x) * scale, hermite(x, 1) * scale / self.length
        line = inertia.per_length * (N.T * w) @ N + inertia.rotary * (Nx.T * w) @ Nx
        return np.asarray(self.length * line)

    def law(self, stiffness: Stiffness, count: int, measures: Measures = USUAL) -> ElasticLaw:
        """Return the elastic law of ``count`` equal elements."""
        if measures.strain == "green" and measures.curvature == "linear":
            return green_linear_law(stiffness, self.length, count)
        return QuadratureLaw(
            axial=np.full(count, stiffness.axial * self.length),
            bending=np.full(count, stiffness.bending / self.length),
            engineering=measures.strain == "engineering",
            exact_curvature=measures.curvature == "exact",
            axial_points=measures.axial_points,
            bending_points=measures.bending_points,
        )
