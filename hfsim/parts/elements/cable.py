"""Beam element on its centre line: position and slope vector at both nodes, and interior vectors.

Cubic Hermite functions and, from degree 4 on, interior functions (`hfsim.maths.shapes.interior`) that vanish
with their slopes at both ends.  Energy per length EA/2 strain^2 + EI/2 curvature^2 (design, decision 3).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hfsim.deck.materials import BeamProperties
from hfsim.maths.arrays import Array
from hfsim.maths.shapes import gauss_legendre, hierarchic, piecewise
from hfsim.parts.elements._base import USUAL, ElasticLaw, GramLaw, Measures
from hfsim.parts.elements.polynomial import gauss_points, green_linear_law

if TYPE_CHECKING:
    from hfsim.deck.stations import BeamAlong

LAST_GRAM_DEGREE = 4
"""Highest degree at which the products of vectors are the cheaper form of the polynomial energy: their
degree^4 operations an element against (2 degree - 1) degree by quadrature.  The force of 1 to 320 elements
and states takes about 0.85 to 1.35 of the time at degree 3, 0.85 to 1.4 at 4, 0.9 to 1.9 at 5."""


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

    @classmethod
    def of(cls, length: float, degree: int, section_degree: int = 1, n_dim: int = 2) -> Cable:
        """Return the element of a length [m] and degree: it has no sections, and is the same in space."""
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

    def shape(
        self, xi: Array | float, eta: float = 0.0, derivative: tuple[int, ...] = (0, 0), zeta: float = 0.0
    ) -> Array:
        """Return shape rows of the centre line, shape (*xi.shape, degree + 1); derivatives are by x [m]."""
        rows = hierarchic(xi, self.degree, derivative[0]) * self._scale / self.length ** derivative[0]
        return np.asarray(rows if np.ndim(xi) else rows[0])

    def mass(self, properties: BeamAlong, count: int = 1, start: float = 0.0) -> Array:
        """Return the consistent mass matrix [kg]; section rotary inertia acts on the slopes if given."""
        x, w = piecewise(gauss_legendre(self.degree + 1), properties.cuts(count), start)
        N = hierarchic(x, self.degree) * self._scale
        Nx = hierarchic(x, self.degree, 1) * self._scale / self.length
        own = properties.in_elements(x, count)
        line = _each(own.mass_per_length) * (N.T * w) @ N + _each(own.rotary_inertia) * (Nx.T * w) @ Nx
        return np.asarray(self.length * line)

    def law(self, properties: BeamAlong, count: int, measures: Measures = USUAL) -> ElasticLaw:
        """Return the elastic law of ``count`` elements in a row."""
        if measures[:2] == ("green", "linear") and isinstance(properties, BeamProperties):
            if self.degree <= LAST_GRAM_DEGREE:
                return self.gram_law(properties, count, measures.n_dim)
            measures = measures._replace(bending_points=self.degree - 1)
        from hfsim.parts.elements.quadrature import QuadratureLaw

        points = gauss_points(measures, self.degree)
        stretched, bent = (properties.in_elements(gauss_legendre(n)[0], count) for n in points)
        return QuadratureLaw(
            axial=_at_points(stretched.axial_stiffness * self.length, count),
            bending=_at_points(bent.bending_stiffness / self.length, count),
            engineering=measures.strain == "engineering",
            exact_curvature=measures.curvature == "exact",
            axial_points=points[0],
            bending_points=points[1],
            degree=self.degree,
            n_dim=measures.n_dim,
        )

    def gram_law(self, properties: BeamProperties, count: int, n_dim: int = 2) -> GramLaw:
        """Return the law of Green strain and curvature r'' as a form in products of vectors."""
        return green_linear_law(properties, self.length, count, self.degree, n_dim)


def _each(numbers: float | Array) -> float | Array:
    """Return numbers (n_elements, n_points) of each element's points over rows of shapes; one as it is."""
    return numbers[:, None] if isinstance(numbers, np.ndarray) else numbers


def _at_points(numbers: float | Array, count: int) -> Array:
    """Return numbers (n_elements, n_points), or one, as (n_points or 1, n_elements)."""
    if isinstance(numbers, np.ndarray):
        return np.ascontiguousarray(numbers.T)
    return np.full((1, count), numbers)
