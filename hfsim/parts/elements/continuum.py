"""Fully parameterised beam element: position and all gradient vectors at each node.

The paper's general formulation: Green-Lagrange strain (15)-(18), the matrix of elastic coefficients
(22)-(23), the stiffness (25), in the plane with i, j = 1, 2 and in space with i, j = 1, 2, 3.  The paper's
element is cubic along its axis and linear across; its section vectors r_y, r_z are linear along the axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from hfsim.deck.materials import BeamProperties
from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.shapes import bubbles, gauss_legendre, gauss_lobatto, hierarchic, piecewise
from hfsim.parts.elements._base import USUAL, ElasticLaw, GramLaw, Measures

if TYPE_CHECKING:
    from hfsim.deck.stations import BeamAlong
    from hfsim.parts.elements.points import PointLaw

ACROSS = 3
"""Gauss points over the height, and over the width, of a section: the energy is of degree four in y and z."""


@dataclass(frozen=True)
class Continuum:
    """The element ``continuum`` of a deck: nodal vectors (r, r_x, r_y[, r_z]), 24 coordinates in space.

    Its vectors are those of the first node, interior ones of the line, of r_y and of r_z, if degrees are
    higher than the paper's, and those of the last node.

    Attributes
    ----------
    length : float
        Undeformed length [m].
    degree, section_degree : int
        Of the centre line and of the section vectors along the axis.
    n_dim : int
        Of space.
    """

    length: float
    degree: int = 3
    section_degree: int = 1
    n_dim: int = 2

    @classmethod
    def of(cls, length: float, degree: int, section_degree: int = 1, n_dim: int = 2) -> Continuum:
        """Return the element of a length [m] and degrees, of the line and of sections, in plane or space."""
        return cls(length, degree, section_degree, n_dim)

    @property
    def per_node(self) -> int:
        """Position and as many gradients as there are directions."""
        return 1 + self.n_dim

    @property
    def stride(self) -> int:
        """Those of a node, interior ones of the line and of each section vector."""
        return self.per_node + (self.degree - 3) + (self.n_dim - 1) * (self.section_degree - 1)

    @cached_property
    def _line(self) -> IntArray:
        """Which vectors make the line: position, slope, interior ones, position, slope."""
        inner, last = np.arange(self.degree - 3), self.stride
        return np.array([0, 1, *(self.per_node + inner), last, last + 1])

    @cached_property
    def _sections(self) -> tuple[IntArray, ...]:
        """Which vectors make r_y, and r_z: at the first node, interior ones, at the last node."""
        count = self.section_degree - 1
        first = self.per_node + self.degree - 3
        inner = [first + k * count + np.arange(count) for k in range(self.n_dim - 1)]
        return tuple(np.array([2 + k, *own, self.stride + 2 + k]) for k, own in enumerate(inner))

    @property
    def _n_vectors(self) -> int:
        return self.stride + self.per_node

    def differences(self) -> Array:
        """Return the matrix from nodal vectors to (chord / le, slopes of the line, r_y ones[, r_z ones])."""
        line = self._line
        D = np.zeros((self._n_vectors - 1, self._n_vectors))
        D[0, line[0]], D[0, line[-2]] = -1.0 / self.length, 1.0 / self.length
        others = np.concatenate([line[1:-2], line[-1:], *self._sections])
        D[np.arange(1, len(D)), others] = 1.0
        return D

    def shape(
        self, xi: Array | float, eta: float = 0.0, derivative: tuple[int, ...] = (0, 0), zeta: float = 0.0
    ) -> Array:
        """Return shape rows at x = xi le, y = eta, z = zeta [m], or their derivatives by (x, y[, z]).

        Shape (*xi.shape, n).
        """
        along, *across = derivative
        places = np.atleast_1d(xi)
        rows = np.zeros((len(places), self._n_vectors))
        if not any(across):
            rows[:, self._line] = self._line_rows(places, along)
            sides = [eta, zeta]
        else:
            sides = [float(across == [k == j for j in range(len(across))]) for k in range(2)]
        for side, vectors in zip(sides, self._sections, strict=False):
            rows[:, vectors] = side * self._section_rows(places, along)
        return rows if np.ndim(xi) else rows[0]

    def _line_rows(self, xi: Array, derivative: int) -> Array:
        """Return the functions of the line at places (n,), of vectors in the order of `_line`."""
        scale = np.full(self.degree + 1, self.length)
        scale[[0, -2]] = 1.0
        return np.asarray(hierarchic(xi, self.degree, derivative) * scale / self.length**derivative)

    def _section_rows(self, xi: Array, derivative: int) -> Array:
        """Return the functions of a section vector at places (n,)."""
        one = np.ones_like(xi)
        first, last = ((1.0 - xi, xi), (-one, one), (0.0 * one, 0.0 * one))[min(derivative, 2)]
        inner = bubbles(xi, self.section_degree, derivative)
        return np.column_stack([first, inner, last]) / self.length**derivative

    def mass(self, properties: BeamAlong, count: int = 1, start: float = 0.0) -> Array:
        """Return the consistent mass matrix of the (equivalent) rectangle [kg], of each element if it varies.

        It is that of the line, and of sections the one of their vectors with their second moments.
        """
        alike = isinstance(properties, BeamProperties)
        points = max(self.degree, self.section_degree) + (1 if alike else 2)
        x, w = piecewise(gauss_legendre(points), properties.cuts(count), start)
        own = properties.in_elements(x, count)
        moments = (1.0, np.square(own.height) / 12.0, np.square(own.breadth) / 12.0)
        M = np.zeros((1 if alike else count, self._n_vectors, self._n_vectors))
        for by, moment in zip([(0,) * self.n_dim, *self._units[1:]], moments, strict=False):
            rows = self.shape(x, 0.0, by)
            each = np.broadcast_to(w * own.mass_per_length * moment, (len(M), len(x)))
            M += self.length * (rows.T * each[:, None]) @ rows
        return M[0] if alike else M

    @property
    def _units(self) -> list[tuple[int, ...]]:
        """Derivatives by x, by y[, by z]."""
        return [tuple(map(int, one)) for one in np.eye(self.n_dim)]

    @property
    def axial_rule(self) -> tuple[Array, Array]:
        """Places and weights along the axis: Gauss points that integrate the paper's energy exactly.

        With richer sections they are the Gauss-Lobatto points, as many as the degree: r' and the section
        vectors, of one degree less and continuous, have one value for each of them.  A bent beam of any
        slenderness can then be without stretch and shear where these are asked for, and nothing locks.
        """
        if self.section_degree == 1:
            return gauss_legendre(2 * self.degree - 1)
        return gauss_lobatto(max(self.degree, self.section_degree + 1))

    def strain_table(self, properties: BeamProperties) -> tuple[Array, Array]:
        """Shape derivatives at the Gauss points of the element, exact for the energy's polynomial.

        Returns
        -------
        weights : ndarray, shape (n_points,)
            Volume of each point [m^3].
        rows : ndarray, shape (n_dim, n_points, n_vectors)
            Rows of dN/dx, dN/dy[, dN/dz].
        """
        x, wx = self.axial_rule
        y, z, across = section_points(properties, self.n_dim, ACROSS)
        volume = self.length * properties.height * properties.width
        places = [(float(xi), float(a), float(b)) for xi in x for a, b in zip(y, z, strict=True)]
        rows = np.array([[self.shape(xi, a, by, b) for xi, a, b in places] for by in self._units])
        return volume * np.outer(wx, across).ravel(), rows

    def law(self, properties: BeamAlong, count: int, measures: Measures = USUAL) -> ElasticLaw:
        """Return the energy of ``count`` equal elements, the cheaper of two ways to the same numbers.

        That of others is one of `hfsim.parts.elements.continuum_points`.
        """
        assert isinstance(properties, BeamProperties)
        if (self.degree, self.section_degree) == (3, 1):
            return self.gram_law(properties, count)
        return self.point_law(properties, count)

    @property
    def _straight(self) -> Array:
        """Difference vectors of the undeformed element, shape (n_differences, n_dim)."""
        undeformed = np.zeros((self._n_vectors - 1, self.n_dim))
        undeformed[[0, 1, self.degree - 1], 0] = 1.0
        for k in range(self.n_dim - 1):
            first = self.degree + k * (self.section_degree + 1)
            undeformed[[first, first + self.section_degree], k + 1] = 1.0
        return undeformed

    def gram_law(self, properties: BeamProperties, count: int, n_dim: int = 2) -> GramLaw:
        """Return the energy (21)-(23) of ``count`` equal elements as a form in products of vectors."""
        weights, rows = self.strain_table(properties)
        scale = properties.axial_stiffness * self.length
        to_nodes = np.linalg.pinv(self.differences())
        scales = np.full(count, scale)
        return green_lagrange(rows @ to_nodes, weights / scale, self._straight, properties, scales)

    def point_law(self, properties: BeamProperties, count: int) -> PointLaw:
        """Return the same energy summed over Gauss points of the axis.

        There it is a form in products of r' on the line, r_y[, r_z] and their derivatives by x / le: with
        high degrees these are far fewer than all vectors of the element.
        """
        from hfsim.parts.elements.points import PointLaw

        rows, volumes = self.point_rows(properties)
        undeformed = np.eye(rows.shape[2], self.n_dim)
        scale = properties.axial_stiffness * self.length
        scales = np.repeat(scale * self.axial_rule[1], count)
        at_points = green_lagrange(rows, volumes / scale, undeformed, properties, scales)
        return PointLaw(at_points, self.to_points())

    def point_rows(self, properties: BeamProperties) -> tuple[Array, Array]:
        """Return, for the Gauss points of a section, rows from the vectors of a point of the axis.

        Returns
        -------
        rows : ndarray, shape (..., n_dim, n_across, 2 n_dim - 1)
            From r', r_y[, r_z] and their derivatives by x / le to the gradients r_x, r_y[, r_z].
        volumes : ndarray, shape (..., n_across)
            Of each point, for all of the length [m^3]; of each of several sections, if these are several.
        """
        y, z, across = section_points(properties, self.n_dim, ACROSS)
        sides, n = (y, z)[: self.n_dim - 1], 2 * self.n_dim - 1
        rows = np.zeros((*y.shape[:-1], self.n_dim, len(across), n))
        rows[..., 0, :, 0] = 1.0
        for k, side in enumerate(sides):
            rows[..., k + 1, :, k + 1] = 1.0
            rows[..., 0, :, self.n_dim + k] = side / self.length
        return rows, np.multiply.outer(self.length * properties.height * properties.width, across)

    def to_points(self) -> Array:
        """Return the rows from difference vectors to those of `point_rows` at each point of the axis.

        Shape (2 n_dim - 1, n_points, n_differences).
        """
        x, _ = self.axial_rule
        to_points = np.zeros((2 * self.n_dim - 1, len(x), self._n_vectors))
        to_points[0][:, self._line] = self._line_rows(x, 1)
        for k, vectors in enumerate(self._sections):
            to_points[k + 1][:, vectors] = self._section_rows(x, 0)
            to_points[self.n_dim + k][:, vectors] = self._section_rows(x, 1) * self.length
        return np.asarray(to_points @ np.linalg.pinv(self.differences()))


def section_points(properties: BeamProperties, n_dim: int, points: int) -> tuple[Array, Array, Array]:
    """Return y, z [m], (..., n), and weights, of sum one, of Gauss points in (equivalent) rectangles."""
    t, w = gauss_legendre(points)
    y, z = (np.multiply.outer(side, t - 0.5) for side in (properties.height, properties.breadth))
    if n_dim == 2:
        return y, np.zeros(points), w
    return np.repeat(y, points, axis=-1), np.tile(z, points), np.outer(w, w).ravel()


def strain_pairs(n_dim: int) -> tuple[tuple[int, int], ...]:
    """Return the directions of each strain of eq. (20), counted from zero: normal ones, then shear.

    Examples
    --------
    >>> strain_pairs(3)
    ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
    """
    shear = ((0, 1),) if n_dim == 2 else ((0, 1), (1, 2), (2, 0))
    return (*((i, i) for i in range(n_dim)), *shear)


def elasticity(properties: BeamProperties, n_dim: int) -> Array:
    """Return the matrix of elastic coefficients E of eq. (22)-(23), of `strain_pairs` [Pa]; or matrices."""
    pairs = strain_pairs(n_dim)
    E = np.multiply.outer(properties.lame_mu, np.diag([2.0 if i == j else 1.0 for i, j in pairs]))
    E[..., :n_dim, :n_dim] += np.multiply.outer(properties.lame_lambda, np.ones((n_dim, n_dim)))
    return np.asarray(E)


def green_lagrange(
    rows: Array, weights: Array, undeformed: Array, properties: BeamProperties, scale: Array
) -> GramLaw:
    """Return the energy (21)-(23) as a form in products of some vectors.

    Parameters
    ----------
    rows : ndarray, shape (n_dim, n_points, n_vectors)
        From the vectors to the gradients r_x, r_y[, r_z] at points.
    weights : ndarray, shape (n_points,)
        Volumes, over the scale [m^3/J].
    undeformed : ndarray, shape (n_vectors, n_dim)
    scale : ndarray, shape (n_elements,)
        [J].
    """
    n_dim, _, n = rows.shape
    pairs = strain_pairs(n_dim)
    products = np.stack([_symmetric_product(rows[i], rows[j]) for i, j in pairs])
    # a normal strain is half the change of its product, the shear strain 2 e12 the whole
    half = np.array([0.5 if i == j else 1.0 for i, j in pairs])
    E = elasticity(properties, n_dim) * np.outer(half, half)
    stressed = np.einsum("rs,q,sqa->rqa", E, weights, products)
    return GramLaw(
        quadratic=np.tensordot(products, stressed, axes=([0, 1], [0, 1])),
        linear=np.zeros((len(scale), n * n)),
        reference=(undeformed @ undeformed.T).ravel(),
        scale=scale,
        dimension=n_dim,
    )


def _symmetric_product(a: Array, b: Array) -> Array:
    """Rows that turn the entries of G into a.b at each point, even under exchange of the two vectors."""
    full = np.einsum("qi,qj->qij", a, b)
    return np.asarray(0.5 * (full + full.swapaxes(1, 2)).reshape(len(a), -1))
