"""Poles and modes of collocation methods, accurate for any number of stages.

In the Legendre basis the integration matrix of Gauss and Radau IIA collocation is tridiagonal: the
integral of P_k is (P_(k+1) - P_(k-1)) / (2 (2k + 1)).  Its eigenvectors obey a recurrence, but are so
nearly parallel that double precision loses them from some 16 stages on.  They are computed with
integers that stand for multiples of 2^-BITS.
"""

from __future__ import annotations

from fractions import Fraction
from math import ldexp

import numpy as np

from hfsim.maths.arrays import Array, ComplexArray

BITS = 160
SWEEPS = 60

Fixed = tuple[int, int]
"""A complex number, real and imaginary part as multiples of 2^-BITS."""


def legendre_modes(stages: int, last: Fraction) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Return the poles of a collocation method and the modes that belong to them.

    Parameters
    ----------
    stages : int
    last : Fraction
        Last diagonal entry of the integration matrix: 0 for Gauss, 1 / (2 (2 stages - 1)) for Radau IIA.

    Returns
    -------
    poles : ndarray of complex, shape (k,)
        Eigenvalues, of each complex pair the one with a positive imaginary part.
    right, left : ndarray of complex, shape (stages, k) and (k, stages)
        Legendre coefficients of the eigenvectors, and the vectors with ``left @ right = 1``.
    """
    corner = _fixed(last if stages > 1 else Fraction(1, 2) + last)
    guesses = _guesses(stages, float(last))
    poles, right, left = [], [], []
    for guess in guesses:
        pole = _refined(guess, stages, corner)
        x = _vector(pole, stages)
        y = [(-a if k % 2 else a, -b if k % 2 else b) for k, (a, b) in enumerate(x)]
        y = [(a // (2 * k + 1), b // (2 * k + 1)) for k, (a, b) in enumerate(y)]
        size = (0, 0)
        for a, b in zip(x, y, strict=True):
            size = _sum(size, _product(a, b))
        poles.append(_float(pole))
        right.append([_float(a) for a in x])
        left.append([_float(_quotient(b, size)) for b in y])
    return np.array(poles), np.array(right).T, np.array(left)


def _guesses(stages: int, last: float) -> list[complex]:
    """Return rough eigenvalues, one of each pair, from double precision."""
    k = np.arange(1, stages)
    off = 0.5 / np.sqrt(4.0 * k**2 - 1.0)
    X: Array = np.diag(off, -1) - np.diag(off, 1)
    X[0, 0] += 0.5
    X[-1, -1] += last
    found = np.linalg.eigvals(X)
    size = np.abs(found).max()
    return [complex(p) for p in sorted(found, key=lambda p: p.imag) if p.imag > -1e-9 * size]


def _refined(guess: complex, stages: int, corner: int) -> Fixed:
    """Return the eigenvalue near a guess, by Newton's method on the last row of the recurrence."""
    pole = (_fixed(Fraction(guess.real)), _fixed(Fraction(guess.imag)))
    if stages == 1:
        return corner, 0
    for _ in range(SWEEPS):
        x = _vector(pole, stages)
        dx = _vector_rate(pole, x)
        tail = (corner - pole[0], -pole[1])
        value = _sum(_scaled(x[-2], 1, 2 * (2 * stages - 3)), _product(tail, x[-1]))
        slope = _sum(_scaled(dx[-2], 1, 2 * (2 * stages - 3)), _product(tail, dx[-1]))
        slope = (slope[0] - x[-1][0], slope[1] - x[-1][1])
        step = _quotient(value, slope)
        pole = (pole[0] - step[0], pole[1] - step[1])
        # steps square from one to the next
        if abs(step[0]) + abs(step[1]) < 1 << (BITS // 2):
            break
    return pole


def _vector(pole: Fixed, stages: int) -> list[Fixed]:
    """Return the eigenvector's coefficients by the rows of the tridiagonal matrix, first one 1."""
    x = [(1 << BITS, 0)]
    if stages > 1:
        x.append(_scaled(_product((_fixed(Fraction(1, 2)) - pole[0], -pole[1]), x[0]), 6, 1))
    for k in range(1, stages - 1):
        below = _scaled(x[k - 1], 2 * k + 3, 2 * k - 1)
        own = _scaled(_product(pole, x[k]), 2 * (2 * k + 3), 1)
        x.append((below[0] - own[0], below[1] - own[1]))
    return x


def _vector_rate(pole: Fixed, x: list[Fixed]) -> list[Fixed]:
    """Return the derivative of `_vector` by the pole."""
    dx = [(0, 0), (-6 << BITS, 0)]
    for k in range(1, len(x) - 1):
        below = _scaled(dx[k - 1], 2 * k + 3, 2 * k - 1)
        own = _scaled(_sum(_product(pole, dx[k]), x[k]), 2 * (2 * k + 3), 1)
        dx.append((below[0] - own[0], below[1] - own[1]))
    return dx


def _fixed(value: Fraction) -> int:
    return (value.numerator << BITS) // value.denominator


def _float(z: Fixed) -> complex:
    return complex(ldexp(float(z[0]), -BITS), ldexp(float(z[1]), -BITS))


def _sum(a: Fixed, b: Fixed) -> Fixed:
    return a[0] + b[0], a[1] + b[1]


def _scaled(a: Fixed, numerator: int, denominator: int) -> Fixed:
    if denominator == 1:
        return a[0] * numerator, a[1] * numerator
    return a[0] * numerator // denominator, a[1] * numerator // denominator


def _product(a: Fixed, b: Fixed) -> Fixed:
    return (a[0] * b[0] - a[1] * b[1]) >> BITS, (a[0] * b[1] + a[1] * b[0]) >> BITS


def _quotient(a: Fixed, b: Fixed) -> Fixed:
    size = b[0] * b[0] + b[1] * b[1]
    real = a[0] * b[0] + a[1] * b[1]
    imag = a[1] * b[0] - a[0] * b[1]
    return (real << BITS) // size, (imag << BITS) // size
