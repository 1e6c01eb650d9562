"""Fully parameterised planar beam element: position and both gradient vectors at each node.

The paper's general formulation: Green-Lagrange strain (15)-(18), the matrix of elastic coefficients
(22)-(23), the stiffness (25); cubic in x, linear in y.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hfsim.deck.materials import BeamProperties
from hfsim.maths.arrays import Array
from hfsim.maths.shapes import gauss_legendre, hermite
from hfsim.parts.elements._base import USUAL, ElasticLaw, GramLaw, Measures


@dataclass(frozen=True)
class Continuum:
    """The element ``continuum`` of a deck, planar: nodal vectors (r, r_x, r_y), 12 coordinates.

    Attributes
    ----------
    length : float
        Undeformed length [m].
    """

    length: float
    per_node: int = 3
    degree: int = 3

    @classmethod
    def of(cls, length: float, degree: int) -> Continuum:
        """Return the element of a length [m] and degree, which is always 3."""
        return cls(length)

    @property
    def stride(self) -> int:
        """As many as at each node: there are no interior vectors."""
        return self.per_node

    def differences(self) -> Array:
        """Return the matrix from the six nodal vectors to (chord / le, r1_x, r2_x, r1_y, r2_y)."""
        D = np.zeros((5, 6))
        D[0, 0], D[0, 3] = -1.0 / self.length, 1.0 / self.length
        D[1, 1] = D[2, 4] = D[3, 2] = D[4, 5] = 1.0
        return D

    def shape(self, xi: float, eta: float = 0.0, derivative: tuple[int, int] = (0, 0)) -> Array:
        """Return the shape row, shape (6,), at x = xi le, y = eta [m], or its derivative by (x, y)."""
        along, across = derivative
        le = self.length
        row = np.zeros(6)
        linear = np.array([[1.0 - xi, xi], [-1.0 / le, 1.0 / le], [0.0, 0.0]])[min(along, 2)]
        if across == 0:
            h = hermite(xi, along)[0] * np.array([1.0, le, 1.0, le]) / le**along
            row[[0, 1, 3, 4]] = h
            row[[2, 5]] = eta * linear
        elif across == 1:
            row[[2, 5]] = linear
        return row

    def mass(self, properties: BeamProperties) -> Array:
        """Return the consistent mass matrix of the rectangular section [kg]."""
        x, wx = gauss_legendre(4)
        y, wy = gauss_legendre(2)
        M = np.zeros((6, 6))
        for xi, a in zip(x, wx, strict=True):
            for eta, b in zip(y, wy, strict=True):
                N = self.shape(float(xi), float(properties.height * (eta - 0.5)))
                M += a * b * np.outer(N, N)
        return np.asarray(properties.mass_per_length * self.length * M)

    def strain_table(self, properties: BeamProperties) -> tuple[Array, Array, Array]:
        """Shape derivatives at the Gauss points of the section, exact for the energy's polynomial.

        Returns
        -------
        weights : ndarray, shape (n_points,)
            Volume of each point [m^3].
        by_x, by_y : ndarray, shape (n_points, 6)
            Rows of dN/dx and dN/dy.
        """
        x, wx = gauss_legendre(5)
        y, wy = gauss_legendre(3)
        volume = self.length * properties.height * properties.width
        places = [(xi, properties.height * (eta - 0.5)) for xi in x for eta in y]
        by_x = np.array([self.shape(float(a), float(b), (1, 0)) for a, b in places])
        by_y = np.array([self.shape(float(a), float(b), (0, 1)) for a, b in places])
        return volume * np.outer(wx, wy).ravel(), by_x, by_y

    def law(self, properties: BeamProperties, count: int, measures: Measures = USUAL) -> ElasticLaw:
        """Return the energy of ``count`` equal elements."""
        return self.gram_law(properties, count)

    def gram_law(self, properties: BeamProperties, count: int, n_dim: int = 2) -> GramLaw:
        """Return the energy (21)-(23) of ``count`` equal elements as a form in products of vectors."""
        weights, by_x, by_y = self.strain_table(properties)
        to_nodes = np.linalg.pinv(self.differences())
        a, b = by_x @ to_nodes, by_y @ to_nodes
        products = [_symmetric_product(a, a), _symmetric_product(b, b), _symmetric_product(a, b)]
        normal, lame = properties.lame_lambda + 2.0 * properties.lame_mu, properties.lame_lambda
        E = np.array([[normal, lame, 0.0], [lame, normal, 0.0], [0.0, 0.0, properties.lame_mu]])
        # a normal strain is half the change of its product, the shear strain 2 e12 the whole
        half = np.array([0.5, 0.5, 1.0])
        E = E * np.outer(half, half)
        size = a.shape[1] ** 2
        quadratic = np.zeros((size, size))
        for i in range(3):
            for j in range(3):
                quadratic += E[i, j] * (products[i].T * weights) @ products[j]
        undeformed = np.array([[1.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
        scale = properties.axial_stiffness * self.length
        return GramLaw(
            quadratic=quadratic / scale,
            linear=np.zeros((count, size)),
            reference=(undeformed @ undeformed.T).ravel(),
            scale=np.full(count, scale),
        )


def _symmetric_product(a: Array, b: Array) -> Array:
    """Rows that turn the entries of G into a.b at each point, even under exchange of the two vectors."""
    full = np.einsum("qi,qj->qij", a, b)
    return np.asarray(0.5 * (full + full.swapaxes(1, 2)).reshape(len(a), -1))
