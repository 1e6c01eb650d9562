"""Shape functions of beam elements on the unit interval and the quadrature that integrates them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from hfsim.maths.arrays import Array

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


def interior(xi: Array | float, degree: int, derivative: int = 0) -> Array:
    r"""Evaluate the interior functions that complete the cubic Hermite functions, or a derivative by xi.

    Integrated Legendre polynomials :math:`\phi_k` with :math:`\phi_k'' = (2 k + 1) P_k`, k = 2 to
    degree - 2, P_k the Legendre polynomial on the unit interval.  As P_k is orthogonal to 1 and xi,
    they vanish at both ends with their slopes (to the last bit, as :math:`P_k(\pm 1)` is exact in the
    recurrence), and their second derivatives are orthogonal to those of the cubics and to one another.
    The factor keeps their slopes within about -1 to 1 for every k.

    Parameters
    ----------
    xi : array_like, shape (n,)
        Places within the element, 0 to 1.
    degree : int
        Degree of the whole set, 3 or more.
    derivative : int
        0, 1 or 2.

    Returns
    -------
    ndarray, shape (n, degree - 3)

    Examples
    --------
    >>> interior([0.0, 0.5, 1.0], 4)  # x^2 (1 - x)^2 times 5/2
    array([[0.     ],
           [0.15625],
           [0.     ]])
    """
    t = 2.0 * np.atleast_1d(np.asarray(xi, dtype=float)) - 1.0
    P = np.polynomial.legendre.legvander(t, degree)
    k = np.arange(2, degree - 1)
    if derivative == 2:
        return np.asarray((2 * k + 1) * P[:, k])
    if derivative == 1:
        return np.asarray(0.5 * (P[:, k + 1] - P[:, k - 1]))
    if derivative != 0:
        raise ValueError(f"no derivative of order {derivative}")
    above, below = P[:, k + 2] - P[:, k], P[:, k] - P[:, k - 2]
    return np.asarray(0.25 * (above / (2 * k + 3) - below / (2 * k - 1)))


def hierarchic(xi: Array | float, degree: int, derivative: int = 0) -> Array:
    """Evaluate all functions of an element: first value and slope, interior ones, last value and slope.

    Returns
    -------
    ndarray, shape (n, degree + 1)
    """
    ends = hermite(xi, derivative)
    if degree == 3:
        return ends
    return np.concatenate([ends[:, :2], interior(xi, degree, derivative), ends[:, 2:]], axis=1)


def bubbles(xi: Array | float, degree: int, derivative: int = 0) -> Array:
    """Evaluate the functions that complete linear ones, or a derivative by xi; they vanish at both ends.

    Integrated Legendre polynomials: the derivative of the k-th is (2 k + 1) P_k, k = 1 to degree - 1.

    Returns
    -------
    ndarray, shape (n, degree - 1)

    Examples
    --------
    >>> bubbles([0.0, 0.5, 1.0], 2)
    array([[ 0.  ],
           [-0.75],
           [ 0.  ]])
    """
    t = 2.0 * np.atleast_1d(np.asarray(xi, dtype=float)) - 1.0
    k = np.arange(1, degree)
    c = np.zeros((degree + 1, degree - 1))
    c[k + 1, k - 1], c[k - 1, k - 1] = 0.5, -0.5
    slopes = np.polynomial.legendre.legder(c, derivative)
    return np.asarray(np.polynomial.legendre.legvander(t, len(slopes) - 1) @ slopes * 2.0**derivative)


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


@lru_cache(maxsize=64)
def gauss_lobatto(points: int) -> tuple[Array, Array]:
    """Return places and weights of Gauss-Lobatto quadrature on the unit interval: both ends are among them.

    Examples
    --------
    >>> x, w = gauss_lobatto(3)
    >>> x.tolist(), w.round(12).tolist()
    ([0.0, 0.5, 1.0], [0.166666666667, 0.666666666667, 0.166666666667])
    """
    legendre = np.polynomial.legendre.Legendre.basis(points - 1)
    inner = np.sort(legendre.deriv().roots().real)
    t = np.concatenate([[-1.0], 0.5 * (inner - inner[::-1]), [1.0]])
    return 0.5 * (t + 1.0), 1.0 / (points * (points - 1) * legendre(t) ** 2)


def lagrange(xi: Array | float, nodes: Array, derivative: int = 0) -> Array:
    """Evaluate the polynomials that are one at one node and zero at all others, or their derivative.

    Parameters
    ----------
    xi : array_like, shape (n,)
    nodes : ndarray, shape (n_nodes,)
    derivative : int
        0 or 1.

    Returns
    -------
    ndarray, shape (n, n_nodes)

    Examples
    --------
    >>> lagrange(0.25, np.array([0.0, 1.0])), lagrange(0.25, np.array([0.0, 1.0]), 1)
    (array([[0.75, 0.25]]), array([[-1.,  1.]]))
    """
    gaps = np.atleast_1d(np.asarray(xi, dtype=float))[:, None] - nodes
    out = np.zeros(gaps.shape)
    for k, node in enumerate(nodes):
        others = np.delete(np.arange(len(nodes)), k)
        scale = np.prod(node - nodes[others])
        left_out = [others] if derivative == 0 else [np.delete(others, j) for j in range(len(others))]
        out[:, k] = sum(np.prod(gaps[:, one], axis=1) for one in left_out) / scale
    return out


def piecewise(
    rule: tuple[Array, Array], cuts: Sequence[float], start: float = 0.0
) -> tuple[Array, Array]:
    """Return points and weights of a rule for the unit interval as one that is used piece by piece.

    Parameters
    ----------
    rule : tuple of ndarray
        Points and weights.
    cuts : sequence of float
        Places inside the unit interval at which a function may have a kink, rising.
    start : float
        Place of the unit interval from which it is integrated.
    """
    edges = np.array([start, *(cut for cut in cuts if cut > start), 1.0])
    (points, weights), lengths = rule, np.diff(edges)[:, None]
    return (edges[:-1, None] + lengths * points).ravel(), (lengths * weights).ravel()


def shares_beyond(edges: Array, points: Array, weights: Array, places: Array) -> Array:
    """Return which share of each point of a quadrature, cell by cell, is in the integral from a place on.

    In the cell of the place it is that of the polynomial through the points there.

    Parameters
    ----------
    edges : ndarray, shape (n_cells + 1,)
        Ends of the cells, rising.
    points, weights : ndarray, shape (n_points,)
        Of the unit interval, the same in all cells.
    places : ndarray, shape (n_places,)

    Returns
    -------
    ndarray, shape (n_places, n_cells * n_points)

    Examples
    --------
    >>> shares_beyond(np.array([0.0, 1.0, 2.0]), np.array([0.5]), np.array([1.0]), np.array([0.25]))
    array([[0.75, 1.  ]])
    """
    last = len(edges) - 2
    cell = np.clip(np.searchsorted(edges, places, side="right") - 1, 0, last)
    start = np.clip((places - edges[cell]) / np.diff(edges)[cell], 0.0, 1.0)
    shares = np.repeat((np.arange(last + 1) > cell[:, None]).astype(float)[..., None], len(points), axis=2)
    shares[np.arange(len(places)), cell] = weights_beyond(points, start) / weights
    return shares.reshape(len(places), -1)


def weights_beyond(points: Array, start: Array) -> Array:
    """Return integrals from places of the unit interval to its end of the polynomials of `lagrange`.

    Shape (n_starts, n_points).
    """
    x, w = gauss_legendre((len(points) + 1) // 2)
    rest = 1.0 - start
    rows = lagrange((start[:, None] + rest[:, None] * x).ravel(), points).reshape(len(start), len(x), -1)
    return np.asarray(rest[:, None] * np.einsum("g,sgk->sk", w, rows))
