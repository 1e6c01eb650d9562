"""Beam element on its centre line: position and slope vector at both nodes, and interior vectors.

Cubic Hermite functions and, from degree 4 on, interior functions (`hfsim.shapes.interior`) that vanish
with their slopes at both ends.  Energy per length EA/2 strain^2 + EI/2 curvature^2 (design, decision 3).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from hfsim.arrays import Array, ComplexArray
from hfsim.elements._base import USUAL, ElasticLaw, GramLaw, Inertia, Measures, Stiffness
from hfsim.rotations import as_complex, as_vectors
from hfsim.shapes import gauss_legendre, hierarchic, interior

LAST_GRAM_DEGREE = 6
"""Highest degree at which the products of vectors are the cheaper form of the polynomial energy: their
degree^4 operations an element against (2 degree - 1) degree by quadrature.  Measured for 1 to 16 elements
and 8 to 40 states: the force takes 0.65 to 0.95 of the time at degree 3, about the same at 6 and 7, and
twice as long at 12."""


def exact_points(degree: int) -> int:
    """Return the Gauss points that integrate the square of the Green strain, degree 4 (degree - 1)."""
    return 2 * degree - 1


def difference_rows(points: Array, derivative: int, degree: int = 3) -> Array:
    """Derivatives of the centre line by xi, as rows over (chord, first slope, interior, last slope)."""
    rows = hierarchic(points, degree, derivative)
    return rows[:, [degree - 1, *range(1, degree - 1), degree]]


@lru_cache(maxsize=32)
def gauss_rows(points: int, degree: int = 3) -> tuple[Array, Array, Array]:
    """Return Gauss weights and the rows of r' and r'' (times le) at the Gauss points of an element."""
    x, w = gauss_legendre(points)
    return w, difference_rows(x, 1, degree), difference_rows(x, 2, degree)


@lru_cache(maxsize=16)
def _gram_tables(degree: int) -> tuple[Array, Array, Array]:
    """Integrals over the unit element: strain products, strain, curvature products; all exact."""
    w, slope, bend = gauss_rows(exact_points(degree), degree)
    beta = np.einsum("qa,qb->qab", slope, slope).reshape(len(w), degree**2)
    gamma = np.einsum("qa,qb->qab", bend, bend).reshape(len(w), degree**2)
    return np.asarray((beta.T * w) @ beta), np.asarray(w @ beta), np.asarray(w @ gamma)


def mean_square_slope() -> Array:
    """Return the matrix g, shape (3, 3), with mean of r'.r' over a cubic element = sum g_ab V_a . V_b."""
    return _gram_tables(3)[1].reshape(3, 3)


@lru_cache(maxsize=16)
def strain_moments(degree: int) -> Array:
    """Integrals T, shape (degree - 2, degree, degree), of products of r' with 1 and the interior slopes.

    The mean of r'.r' over an element is the sum of T_0ab V_a . V_b, its moment with the slope of the
    k-th interior function that of T_kab V_a . V_b.
    """
    points = (3 * degree - 1) // 2
    x, _ = gauss_legendre(points)
    w, slope, _ = gauss_rows(points, degree)
    tests = np.concatenate([np.ones((points, 1)), interior(x, degree, 1)], axis=1)
    return np.asarray(np.einsum("q,qk,qa,qb->kab", w, tests, slope, slope))


def green_linear_law(stiffness: Stiffness, length: float, count: int, degree: int = 3) -> GramLaw:
    """Energy with Green strain (eq. 47 on the centre line) and curvature r''; polynomial, so exact."""
    quadratic, _, curvature = _gram_tables(degree)
    ratio = stiffness.bending / (stiffness.axial * length**2)
    reference = np.zeros((degree, degree))
    reference[np.ix_([0, 1, -1], [0, 1, -1])] = 1.0
    return GramLaw(
        quadratic=0.25 * quadratic,
        linear=np.tile(0.5 * ratio * curvature, (count, 1)),
        reference=reference.ravel(),
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
    degree : int
        Of the element.
    """

    axial: Array
    bending: Array
    engineering: bool
    exact_curvature: bool
    axial_points: int
    bending_points: int
    degree: int = 3

    @property
    def quartic(self) -> bool:
        """Whether the strain is Green's and the curvature linear."""
        return not self.engineering and not self.exact_curvature

    def joined(self, other: QuadratureLaw) -> QuadratureLaw:
        """Return the law of this one's elements followed by the other's."""
        return replace(
            self,
            axial=np.concatenate([self.axial, other.axial]),
            bending=np.concatenate([self.bending, other.bending]),
        )

    def energy(self, V: Array) -> Array:
        """Return the stored energy [J], shape (..., n_elements)."""
        w, slope, _ = gauss_rows(self.axial_points, self.degree)
        strain = self._strain(slope @ V)[0]
        wb, slope, bend = gauss_rows(self.bending_points, self.degree)
        c = bend @ V
        kappa2 = self._curvature(slope @ V, c)[0] ** 2 if self.exact_curvature else np.sum(c * c, axis=-1)
        return np.asarray(0.5 * self.axial * (strain**2 @ w) + 0.5 * self.bending * (kappa2 @ wb))

    def gradient(self, V: Array) -> Array:
        """Return dU/dV [J], same shape as V."""
        if self.exact_curvature:
            return self._planar_gradient(V)
        return self._axial_gradient(V) + np.asarray(self._bending_stiffness @ V)

    def hessian(self, V: Array) -> Array:
        """Return d2U/dV2 [J], shape (..., n_elements, n_vectors n_dim, n_vectors n_dim)."""
        return self._axial_hessian(V) + self._bending_hessian(V)

    @cached_property
    def _half_axial(self) -> Array:
        """EA le / 2 times the Gauss weights, shape (n_elements, n_points)."""
        w, _, _ = gauss_rows(self.axial_points, self.degree)
        return np.asarray(0.5 * self.axial[:, None] * w)

    @cached_property
    def _bending_stiffness(self) -> Array:
        """Constant matrix of the curvature r'', shape (n_elements, n_vectors, n_vectors)."""
        w, _, bend = gauss_rows(self.bending_points, self.degree)
        return np.asarray(self.bending[:, None, None] * ((bend.T * w) @ bend))

    def _strain(self, s: Array) -> tuple[Array, Array, Array]:
        """Strain, and the factors of s and of the unit tensor in its first and second derivative."""
        square = np.sum(s * s, axis=-1)
        if not self.engineering:
            return 0.5 * (square - 1.0), np.ones_like(square), np.zeros_like(square)
        stretch = np.sqrt(square)
        return stretch - 1.0, 1.0 / stretch, -1.0 / stretch**3

    def _axial_gradient(self, V: Array) -> Array:
        w, slope, _ = gauss_rows(self.axial_points, self.degree)
        s = slope @ V
        if not self.engineering:
            tension = (np.einsum("...i,...i", s, s) - 1.0) * self._half_axial
            return np.asarray(slope.T @ (tension[..., None] * s))
        strain, first, _ = self._strain(s)
        weight = self.axial[:, None] * w * strain * first
        return np.asarray(slope.T @ (weight[..., None] * s))

    def _axial_hessian(self, V: Array) -> Array:
        w, rows, _ = gauss_rows(self.axial_points, self.degree)
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

    @cached_property
    def _planar_rows(self) -> tuple[ComplexArray, ComplexArray]:
        """Rows of r' at the axial points, of r' and of r'' at the bending points, as columns; transposed."""
        _, axial, _ = gauss_rows(self.axial_points, self.degree)
        _, slope, bend = gauss_rows(self.bending_points, self.degree)
        rows = np.concatenate([axial, slope, bend]).astype(complex)
        return np.ascontiguousarray(rows.T), rows

    @cached_property
    def _bending_weights(self) -> Array:
        w, _, _ = gauss_rows(self.bending_points, self.degree)
        return np.asarray(self.bending[:, None] * w)

    def _planar_gradient(self, V: Array) -> Array:
        """Return dU/dV with both strain measures at once, vectors being complex numbers.

        With s = r' and c = r'', the curvature is kappa = Im(s* c) / |s|^2; its derivatives by c and s are
        i s / |s|^2 and (-i c - 2 kappa s) / |s|^2.
        """
        gather, scatter = self._planar_rows
        z = as_complex(V) @ gather
        n, m = self.axial_points, self.axial_points + self.bending_points
        a, s, c = z[..., :n], z[..., n:m], z[..., m:]
        square = (s * s.conj()).real
        kappa = (s.conj() * c).imag / square
        moment = self._bending_weights * kappa / square
        turned = 1j * c
        np.multiply(1j * moment, s, out=c)
        s *= 2.0 * kappa
        s += turned
        s *= -moment
        size = np.abs(a)
        strain = 2.0 - 2.0 / size if self.engineering else size * size - 1.0
        a *= self._half_axial * strain
        return as_vectors(z @ scatter)

    def _bending_hessian(self, V: Array) -> Array:
        w, slope, bend = gauss_rows(self.bending_points, self.degree)
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
    points, n = left.shape
    d = point.shape[-1]
    products = (left[:, :, None] * right[:, None, :]).reshape(points, n * n)
    flat = point.reshape(*point.shape[:-2], d * d).swapaxes(-1, -2)
    full = (flat @ products).reshape(*point.shape[:-3], d, d, n, n)
    axes = full.ndim
    order = (*range(axes - 4), axes - 2, axes - 4, axes - 1, axes - 3)
    return np.asarray(full.transpose(order).reshape(*point.shape[:-3], n * d, n * d))


@dataclass(frozen=True)
class Cable:
    """The element ``cable`` of a deck: centre-line energy, no shear, no section deformation.

    Its vectors are (r1, r1', interior ones, r2, r2'); the interior functions are multiplied by the
    length, so that interior vectors are changes of slope as r1' and r2' are.

    Attributes
    ----------
    length : float
        Undeformed length [m].
    degree : int
        Degree of its functions: degree - 3 interior vectors.
    """

    length: float
    degree: int = 3
    per_node: int = 2

    @property
    def stride(self) -> int:
        """Position, slope and the interior vectors."""
        return self.degree - 1

    def differences(self) -> Array:
        """Return the matrix from (r1, r1', interior, r2, r2') to (chord / le, r1', interior, r2')."""
        D = np.zeros((self.degree, self.degree + 1))
        D[0, 0], D[0, -2] = -1.0 / self.length, 1.0 / self.length
        for a in range(1, self.degree - 1):
            D[a, a] = 1.0
        D[-1, -1] = 1.0
        return D

    @property
    def _scale(self) -> Array:
        scale = np.full(self.degree + 1, self.length)
        scale[[0, -2]] = 1.0
        return scale

    def shape(self, xi: float, eta: float = 0.0, derivative: tuple[int, int] = (0, 0)) -> Array:
        """Return the shape row of the centre line, shape (degree + 1,); derivatives are by x [m]."""
        row = hierarchic(xi, self.degree, derivative[0])[0]
        return np.asarray(row * self._scale / self.length ** derivative[0])

    def mass(self, inertia: Inertia) -> Array:
        """Return the consistent mass matrix [kg]; section rotary inertia acts on the slopes if given."""
        x, w = gauss_legendre(self.degree + 1)
        N = hierarchic(x, self.degree) * self._scale
        Nx = hierarchic(x, self.degree, 1) * self._scale / self.length
        line = inertia.per_length * (N.T * w) @ N + inertia.rotary * (Nx.T * w) @ Nx
        return np.asarray(self.length * line)

    def law(self, stiffness: Stiffness, count: int, measures: Measures = USUAL) -> ElasticLaw:
        """Return the elastic law of ``count`` equal elements."""
        polynomial = measures.strain == "green" and measures.curvature == "linear"
        if polynomial and self.degree <= LAST_GRAM_DEGREE:
            return green_linear_law(stiffness, self.length, count, self.degree)
        enough = exact_points(self.degree)
        return QuadratureLaw(
            axial=np.full(count, stiffness.axial * self.length),
            bending=np.full(count, stiffness.bending / self.length),
            engineering=measures.strain == "engineering",
            exact_curvature=measures.curvature == "exact",
            axial_points=measures.axial_points or enough,
            bending_points=measures.bending_points or enough,
            degree=self.degree,
        )
