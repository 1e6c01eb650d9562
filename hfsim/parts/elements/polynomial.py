"""Energy of centre lines where it is a polynomial, and rows of slope and curvature at Gauss points."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from hfsim.deck.materials import BeamProperties
from hfsim.maths.arrays import Array
from hfsim.maths.shapes import gauss_legendre, hierarchic, interior
from hfsim.parts.elements._base import GramLaw, Measures


def exact_points(degree: int) -> int:
    """Return the Gauss points that integrate the square of the Green strain, degree 4 (degree - 1)."""
    return 2 * degree - 1


def gauss_points(measures: Measures, degree: int) -> tuple[int, int]:
    """Return the Gauss points an element for stretch and for bending: those stated, or `exact_points`."""
    enough = exact_points(degree)
    return measures.axial_points or enough, measures.bending_points or enough


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
    return in_products(axial, np.full(count, properties.bending_stiffness / length), degree, n_dim)


def in_products(axial: Array, bending: Array, degree: int, n_dim: int) -> GramLaw:
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
