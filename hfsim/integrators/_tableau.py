"""Collocation tables and the Legendre basis in which accelerations within a step are kept."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy as np

from hfsim.integrators._poles import legendre_modes
from hfsim.maths.arrays import Array, ComplexArray
from hfsim.maths.frozen import frozen

SLOW, SLOW_RUNS = 0.5, 5.0
"""For how long an error of a velocity that a step leaves is taken to last where motions are slow [s], and the
runs that it makes up at most: in microseconds half a second is for ever..."""
SLOW_PART, SLOW_STEPS = 1.0 / 80.0, 100.0
"""...the part of runs that makes more of it, those longer than 40 s, whose motions may be slower, and the
steps that it makes up at most: beyond, rounding would count."""


def legendre(theta: Array, count: int) -> tuple[Array, Array, Array]:
    """Evaluate shifted Legendre polynomials and their first and second integrals from zero.

    Parameters
    ----------
    theta : ndarray, shape (n,)
        Places within the step, 0 to 1 (beyond 1: extrapolation).
    count : int
        Number of polynomials, degrees 0 to count - 1.

    Returns
    -------
    values, integrals, double_integrals : ndarray, shape (n, count)
    """
    theta = np.asarray(theta, dtype=float)
    P = _legendre_values(2.0 * theta - 1.0, count + 2)
    k = 2.0 * (2.0 * np.arange(1, count + 1)[:, None] + 1.0)
    # the integral of P_k is a difference of P_(k+1) and P_(k-1), which are integrated in turn
    once = np.concatenate([theta[None], (P[2:] - P[:-2]) / k])
    twice = np.concatenate([0.5 * theta[None] ** 2, (once[2:] - once[:-2]) / k[:-1]])
    rows = np.ascontiguousarray
    return rows(P[:count].T), rows(once[:count].T), rows(twice.T)


def _legendre_values(x: Array, count: int) -> Array:
    """Return the polynomials at -1 <= x <= 1, shape (count, n)."""
    P = np.ones((count, len(x)))
    P[1] = x
    odd = (2.0 * np.arange(count)[:, None] + 1.0) * x
    for k in range(1, count - 1):
        P[k + 1] = (odd[k] * P[k] - k * P[k - 1]) / (k + 1)
    return P


@frozen
class Collocation:
    """A collocation method for q'' = a(t, q, q').

    Attributes
    ----------
    nodes : ndarray, shape (s,)
        Places of the stages within the step.
    order : int
        Classical order at the end of the step.
    A, A2 : ndarray, shape (s, s)
        Integrals of the stage accelerations up to each stage; A2 = A A, as the method for the first
        order system (q, q')' = (q', a) has it: the double integral of the accelerations'
        polynomial would be neither symplectic nor A-stable.
    b, b2 : ndarray, shape (s,)
        The same up to the end of the step.
    to_legendre : ndarray, shape (s, s)
        From stage values to coefficients of the Legendre basis.
    A2_inverse : ndarray, shape (s, s)
    end_rate : ndarray, shape (s,)
        From displacements at the stages, beyond uniform motion, to the velocity at the end of the step
        (times h): b A2^-1.
    poles, left, right
        ``A = left @ diag(poles) @ right``; of each complex pair only one is kept, so that
        ``A z = 2 Re(left @ (poles * (right @ z)))`` with a real pole counted half.
    parting, joining : ndarray, shapes (2 n_poles, s) and (s, 2 n_poles)
        ``right`` and ``2 Re(left @ ...)`` in real numbers: real parts, then imaginary ones.
    longest : float
        For how long an error of the velocity at the end of a step counts at most [s].
    """

    nodes: Array
    order: int
    A: Array
    A2: Array
    b: Array
    b2: Array
    to_legendre: Array
    A2_inverse: Array
    end_rate: Array
    poles: ComplexArray
    left: ComplexArray
    right: ComplexArray
    parting: Array
    joining: Array
    longest: float = SLOW

    @property
    def stages(self) -> int:
        """Number of stages."""
        return len(self.nodes)

    def slow(self, h: float) -> Any:
        """Return for how long slow motions go astray by an error of the velocity at the end of a step [s]."""
        if self.longest <= SLOW:
            return self.longest
        return np.maximum(SLOW, np.minimum(self.longest, SLOW_STEPS * h))


@lru_cache(maxsize=64)
def lasting(table: Collocation, duration: float) -> Collocation:
    """Return a method for a run of some duration [s]: itself unless that is long, or very short."""
    longest = max(min(SLOW, SLOW_RUNS * duration), SLOW_PART * duration)
    return table if longest == table.longest else replace(table, longest=longest)


def _collocation(nodes: Array, order: int, last: Fraction) -> Collocation:
    """Return a method from its nodes and the last entry of its integration matrix in the Legendre basis."""
    s = len(nodes)
    values, once, _ = legendre(nodes, s)
    _, once_end, _ = legendre(np.array([1.0]), s)
    to_legendre = np.linalg.inv(values)
    A = once @ to_legendre
    poles, vectors, readings = legendre_modes(s, last)
    left, right = values @ vectors, readings @ to_legendre
    size = np.sqrt(np.abs(left).max(axis=0) / np.abs(right).max(axis=1))
    half = np.where(np.abs(poles.imag) < 1e-12, 0.5, 1.0)
    left, right = left * (half / size), right * size[:, None]
    A2 = A @ A
    b = (once_end @ to_legendre)[0]
    return Collocation(
        nodes=nodes,
        order=order,
        A=A,
        A2=A2,
        b=b,
        b2=b @ A,
        to_legendre=to_legendre,
        A2_inverse=np.linalg.inv(A2),
        end_rate=np.linalg.solve(A2.T, b),
        poles=poles,
        left=left,
        right=right,
        parting=np.concatenate([right.real, right.imag]),
        joining=2.0 * np.concatenate([left.real, -left.imag], axis=1),
    )


@lru_cache(maxsize=64)
def gauss(stages: int) -> Collocation:
    """Return Gauss collocation, order 2s: symplectic, A-stable.

    Examples
    --------
    >>> gauss(1).A, gauss(2).order
    (array([[0.5]]), 4)
    """
    x, _ = np.polynomial.legendre.leggauss(stages)
    return _collocation(0.5 * (x + 1.0), 2 * stages, Fraction(0))


@lru_cache(maxsize=64)
def radau(stages: int) -> Collocation:
    """Return Radau IIA collocation, order 2s - 1: the last stage is the end of the step, L-stable.

    Examples
    --------
    >>> radau(2).nodes.round(12), radau(2).order
    (array([0.33333333, 1.        ]), 3)
    """
    if stages == 1:
        return _collocation(np.array([1.0]), 1, Fraction(1, 2))
    # the nodes inside are the zeros of the Jacobi polynomial P^(1,0) (Golub and Welsch)
    k = np.arange(stages - 1, dtype=float)
    diagonal = -1.0 / ((2 * k + 1) * (2 * k + 3))
    j = np.arange(1, stages - 1, dtype=float)
    off = np.sqrt(j * (j + 1) / (2 * j + 1) ** 2)
    x = np.linalg.eigvalsh(np.diag(diagonal) + np.diag(off, 1) + np.diag(off, -1))
    last = Fraction(1, 2 * (2 * stages - 1))
    return _collocation(np.append(0.5 * (x + 1.0), 1.0), 2 * stages - 1, last)
