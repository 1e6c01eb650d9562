"""Shape functions of beam elements on the unit interval and the quadrature that integrates them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from hfsim.arrays import Array

HERMITE = np.array(
    [
        [1.0, 0.0, -3.0, 2.0],
        [0.0, 1.0, -2.0, 1.0],
        [0.0, 0.0, 3.0, -2.0],
        [0.0, 0.0, -1.0, 1.0],
    ]
)
"""Cubic Hermite functions as coefficients of 1, xi, xi^2, xi^3: first value, first slope, second
value, second slope; slopes are derivatives with respect to xi."""


def hermite(xi: Array | float, derivative: int = 0) -> Array:
    """Evaluate the four cubic Hermite functions, or a derivative of them with respect to xi.

    Parameters
    ----------
    xi : array_like, shape (n,)
        Places within the element, 0 to 1.
    derivative : int
        How often to differentiate.

    Returns
    -------
    ndarray, shape (n, 4)

    Examples
    --------
    >>> hermite(0.5)
    array([[ 0.5  ,  0.125,  0.5  , -0.125]])
    """
    coefficients = HERMITE
    for _ in range(derivative):
        coefficients = coefficients[:, 1:] * np.arange(1, coefficients.shape[1])
    powers = np.atleast_1d(np.asarray(xi, dtype=float))[:, None] ** np.arange(coefficients.shape[1])
    return np.asarray(powers @ coefficients.T)


@lru_cache(maxsize=64)
def gauss_legendre(points: int) -> tuple[Array, Array]:
    """Return places and weights of Gauss-Legendre quadrature on the unit interval.

    Examples
    --------
    >>> x, w = gauss_legendre(2)
    >>> float((w * x**3).sum().round(12))
    0.25
    """
    x, w = np.polynomial.legendre.leggauss(points)
    return 0.5 * (x + 1.0), 0.5 * w
