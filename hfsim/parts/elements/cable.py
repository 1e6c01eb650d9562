"""Beam element on its centre line: position and slope vector at both nodes, and interior vectors.

Cubic Hermite functions and, from degree 4 on, interior functions (`hfsim.maths.shapes.interior`) that vanish
with their slopes at both ends.  Energy per length EA/2 strain^2 + EI/2 curvature^2 (design, decision 3).
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import ClassVar

import numpy as np

from hfsim.deck.materials import BeamProperties
from hfsim.maths.arrays import Array
from hfsim.maths.shapes import gauss_legendre, hierarchic, interior
from hfsim.parts.elements._base import USUAL, ElasticLaw, GramLaw, Measures, RowLaw

LAST_GRAM_DEGREE = 4
"""Highest degree at which the products of vectors are the cheaper form of the polynomial energy: their
degree^4 operations an element against (2 degree - 1) degree by quadrature.  The force of 1 to 320 elements
and states takes about 0.85 to 1.35 of the time at degree 3, 0.85 to 1.4 at 4, 0.9 to 1.9 at 5."""

LAST_GRAM_HESSIAN = 6
"""The same for the Hessian, asked for in one state: a third to a tenth of the time by quadrature."""


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


def green_linear_law(
    properties: BeamProperties, length: float, count: int, degree: int = 3, n_dim: int = 2
) -> GramLaw:
    """Energy with Green strain (eq. 47 on the centre line) and curvature r''; polynomial, so exact."""
    axial = np.full(count, properties.axial_stiffness * length)
    return _in_products(axial, np.full(count, properties.bending_stiffness / length), degree, n_dim)


def _in_products(axial: Array, bending: Array, degree: int, n_dim: int) -> GramLaw:
    """Return the polynomial energy of elements with EA le and EI / le [J]."""
    quadratic, _, curvature = _gram_tables(degree)
    reference = np.zeros((degree, degree))
    reference[np.ix_([0, 1, -1], [0, 1, -1])] = 1.0
    return GramLaw(
        quadratic=0.25 * quadratic,
        linear=0.5 * np.outer(bending / axial, curvature),
        reference=reference.ravel(),
        scale=axial,
        dimension=n_dim,
    )


@dataclass(frozen=True, eq=False)
class QuadratureLaw(RowLaw):
    """Energy of any strain and curvature measure by Gauss quadrature.

    Attributes
    ----------
    axial, bending : ndarray, shape (n_elements,)
        EA le and EI / le [J].
    engineering, exact_curvature : bool
        Strain |r'| - 1 instead of Green's; curvature (r' x r'')/|r'|^2 instead of r''.
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
        points = self.axial_points, self.bending_points
        return self.engineering, self.exact_curvature, points, self.degree, self.n_dim

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

    def pull(self, v: Array) -> Array:
        """Return dU/dV [J] in rows."""
        return self._planar(v) if self.exact_curvature else self._with_linear_curvature(v)

    def hessian(self, V: Array) -> Array:
        """Return d2U/dV2 [J], shape (..., n_elements, n_vectors n_dim, n_vectors n_dim)."""
        if self._products is not None:
            return self._products.hessian(V)
        return self._axial_hessian(V) + self._bending_hessian(V)

    @cached_property
    def _products(self) -> GramLaw | None:
        """The same energy by products of vectors, where that is the cheaper way to the Hessian."""
        exact = self.axial_points >= exact_points(self.degree) and self.bending_points >= self.degree - 1
        if self.quartic and exact and self.degree <= LAST_GRAM_HESSIAN:
            return _in_products(self.axial, self.bending, self.degree, self.n_dim)
        return None

    @cached_property
    def _rows(self) -> tuple[Array, Array, Array, Array | None]:
        """Rows of r' and r'', their transpose, |r'|^2 without strain, and a factor of each element.

        The fourth root of the axial weight is in the rows of r' if the strain is Green's, whose force is
        cubic, and the root of the bending weight in those of r''; so are EA le and EI / le if all elements
        have the same, so that nothing else is multiplied by them.
        """
        w, slope, _ = gauss_rows(self.axial_points, self.degree)
        wb, _, bend = gauss_rows(self.bending_points, self.degree)
        alike = np.all(self.axial == self.axial[0]) and np.all(self.bending == self.bending[0])
        axial, bending = (self.axial[0], self.bending[0]) if alike else (1.0, 1.0)
        root = np.sqrt(0.5 * w * axial)[:, None]
        rows = np.concatenate([np.sqrt(root) * slope, np.sqrt(wb * bending)[:, None] * bend])
        factor = None if alike else np.stack([self.axial, self.bending])[..., None]
        return rows, np.ascontiguousarray(rows.T), root, factor

    def _with_linear_curvature(self, v: Array) -> Array:
        """Return dU/dV [J] in rows, with the curvature r''.

        The Green strain's share is the sum of w/2 (|s|^2 - 1) s over the Gauss points, s = r'.
        """
        rows, scatter, one, factor = self._rows
        z = rows.dot(v.reshape(len(v), -1))
        s = z.reshape(len(z), *v.shape[1:])[: self.axial_points]
        square = s * s
        tension = square[:, 0]
        tension += square[:, 1]
        if self.n_dim == 3:
            tension += square[:, 2]
        if self.engineering:
            # w (|s| - 1) s / |s| of what was multiplied by root^(1/2)
            tension = one * (2.0 - 2.0 * np.sqrt(one) / np.sqrt(tension))
        else:
            tension -= one
        if factor is not None:
            tension = tension.reshape(len(tension), len(self.axial), -1) * factor[0]
            bent = z[self.axial_points :].reshape(-1, len(self.axial), v.shape[-1] // len(self.axial))
            bent *= factor[1]
        s *= tension.reshape(len(tension), 1, -1)
        return np.asarray(scatter.dot(z)).reshape(v.shape)

    def _strain(self, s: Array) -> tuple[Array, Array, Array]:
        """Strain, and the factors of s and of the unit tensor in its first and second derivative."""
        square = np.sum(s * s, axis=-1)
        if not self.engineering:
            return 0.5 * (square - 1.0), np.ones_like(square), np.zeros_like(square)
        stretch = np.sqrt(square)
        return stretch - 1.0, 1.0 / stretch, -1.0 / stretch**3

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
    def _planar_rows(self) -> tuple[Array, Array]:
        """Rows of r' at the axial points, of r' and of r'' at the bending points; and as columns."""
        _, axial, _ = gauss_rows(self.axial_points, self.degree)
        _, slope, bend = gauss_rows(self.bending_points, self.degree)
        rows = np.concatenate([axial, slope, bend])
        return rows, np.ascontiguousarray(rows.T)

    @cached_property
    def _planar_weights(self) -> tuple[Array, Array]:
        """EA le / 2 and EI / le times the Gauss weights, shape (n_points, n_elements, 1)."""
        w, _, _ = gauss_rows(self.axial_points, self.degree)
        wb, _, _ = gauss_rows(self.bending_points, self.degree)
        axial, bending = np.outer(0.5 * w, self.axial), np.outer(wb, self.bending)
        return axial[..., None], bending[..., None]

    def _planar(self, v: Array) -> Array:
        """Return dU/dV with both strain measures at once.

        With s = r', c = r'' and J a quarter turn, the curvature is kappa = J s . c / |s|^2; its derivatives
        by c and s are J s / |s|^2 and -(J c + 2 kappa s) / |s|^2.
        """
        rows, columns = self._planar_rows
        axial, bending = self._planar_weights
        z = rows.dot(v.reshape(len(v), -1)).reshape(len(rows), 2, len(self.axial), -1)
        a, s, c = np.split(z, (self.axial_points, self.axial_points + self.bending_points))
        turned, square = _quarter_turn(s), np.add.reduce(s * s, axis=1)
        kappa = np.add.reduce(turned * c, axis=1) / square
        moment = (bending * kappa / square)[:, None]
        stretch2 = np.add.reduce(a * a, axis=1)
        strain = 2.0 - 2.0 / np.sqrt(stretch2) if self.engineering else stretch2 - 1.0
        by_s = -moment * (_quarter_turn(c) + (2.0 * kappa)[:, None] * s)
        derivatives = np.concatenate([(axial * strain)[:, None] * a, by_s, moment * turned])
        return np.asarray(columns.dot(derivatives.reshape(len(rows), -1))).reshape(v.shape)

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


def _quarter_turn(vectors: Array) -> Array:
    """Return planar vectors (n, 2, ...) turned by a quarter."""
    return np.stack([-vectors[:, 1], vectors[:, 0]], axis=1)


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
    centre_line: ClassVar[bool] = True

    @classmethod
    def of(cls, length: float, degree: int) -> Cable:
        """Return the element of a length [m] and degree."""
        return cls(length, degree)

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

    def mass(self, properties: BeamProperties) -> Array:
        """Return the consistent mass matrix [kg]; section rotary inertia acts on the slopes if given."""
        x, w = gauss_legendre(self.degree + 1)
        N = hierarchic(x, self.degree) * self._scale
        Nx = hierarchic(x, self.degree, 1) * self._scale / self.length
        line = properties.mass_per_length * (N.T * w) @ N + properties.rotary_inertia * (Nx.T * w) @ Nx
        return np.asarray(self.length * line)

    def law(self, properties: BeamProperties, count: int, measures: Measures = USUAL) -> ElasticLaw:
        """Return the elastic law of ``count`` equal elements."""
        enough = exact_points(self.degree)
        if measures.strain == "green" and measures.curvature == "linear":
            if self.degree <= LAST_GRAM_DEGREE:
                return self.gram_law(properties, count, measures.n_dim)
            measures = measures._replace(axial_points=enough, bending_points=self.degree - 1)
        return QuadratureLaw(
            axial=np.full(count, properties.axial_stiffness * self.length),
            bending=np.full(count, properties.bending_stiffness / self.length),
            engineering=measures.strain == "engineering",
            exact_curvature=measures.curvature == "exact",
            axial_points=measures.axial_points or enough,
            bending_points=measures.bending_points or enough,
            degree=self.degree,
            n_dim=measures.n_dim,
        )

    def gram_law(self, properties: BeamProperties, count: int, n_dim: int = 2) -> GramLaw:
        """Return the law of Green strain and curvature r'' as a form in products of vectors."""
        return green_linear_law(properties, self.length, count, self.degree, n_dim)
