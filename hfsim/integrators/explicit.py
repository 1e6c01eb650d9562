"""Explicit Runge-Kutta pair of order 8 (Dormand and Prince; Hairer, Norsett and Wanner II.10).

The coefficients are those of SciPy's DOP853; the step is made here, where projection onto the
constraints and the shared loop can take hold of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import numpy as np

from hfsim.integrators._base import Attempt, Integrator, Options, Stability, Stepper, aimed
from hfsim.integrators._often import LARGE
from hfsim.integrators._problem import Problem
from hfsim.integrators._tableau import legendre
from hfsim.maths.arrays import Array

EVALUATIONS = 15
"""In a step: of its stages, of its end and of points inside."""


@lru_cache(maxsize=1)
def _table() -> Any:
    from scipy.integrate import DOP853  # a third of a second: only for those who ask for this method

    return DOP853


@lru_cache(maxsize=1)
def _inner_points() -> tuple[Array, Array]:
    """Places in the step, and the matrix from velocity increments there to a Legendre series."""
    theta = 0.5 * (1.0 - np.cos(np.pi * (np.arange(8) + 1.0) / 8.0))
    _, once, _ = legendre(theta, 7)
    return theta, np.linalg.pinv(once)


@dataclass(frozen=True)
class Explicit:
    """DOP853 with projection.

    Attributes
    ----------
    tolerance : float
        Local error per step, relative above 1.
    """

    tolerance: float
    name: str = "explicit"
    stages: int | None = None

    def start(self, problem: Problem, t: float, q: Array, v: Array) -> ExplicitStepper:
        """Return what makes the steps from an initial state."""
        return ExplicitStepper(self, problem, t, q, v)


class ExplicitStepper(Stepper):
    """DOP853 at work; its first step is cautious."""

    remembers = ("_f",)

    def __init__(self, method: Explicit, problem: Problem, t: float, q: Array, v: Array) -> None:
        self.name, self._tolerance, self._problem = method.name, method.tolerance, problem
        self._f = self._rates(t, q, v)
        size = float((np.abs(self._f[len(q) :]) / (1.0 + np.abs(q))).max())
        self.first = float(self._tolerance ** (1.0 / 8.0)) / float(np.sqrt(max(size, 1.0)))

    def attempt(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        """Make one step of length h and estimate its error."""
        problem, n = self._problem, len(q)
        # velocities count over a step
        given = (t, np.concatenate([q, v]), h, self._f, self._tolerance, max(min(h, 1.0), self.reach))
        if n > LARGE:
            y1, series, errors = _made(problem.single, *given)
        else:
            counts = problem.counts
            counts.calls, counts.evaluations = counts.calls + EVALUATIONS, counts.evaluations + EVALUATIONS
            y1, series, errors = problem.often.call("explicit step", partial(_made, problem.at), given)
        error = _joined(errors, h, 2 * n)
        return Attempt(error=error, growth=aimed(error, 8.0), q=y1[:n], v=y1[n:], series=series)

    def accept(self, t: float, q: Array, v: Array) -> None:
        """Evaluate the projected state, from which the next step starts."""
        self._f = self._rates(t, q, v)

    def _rates(self, t: float, q: Array, v: Array) -> Array:
        return np.concatenate([v, self._problem.single(t, q, v)])


def _made(
    at: Callable[[Any, Array, Array], Array], t: Any, y: Array, h: Any, f: Array, tolerance: Any, rates: Any
) -> tuple[Array, Array, Array]:
    """Return the end of a step, its series, and the squares of the errors of orders 5 and 3.

    Parameters
    ----------
    at : callable
        (t, q, v) -> accelerations (n,).
    y, f : ndarray, shape (2 n,)
        State at the start, (q, v), and its rate.
    tolerance : float
    rates : float
        Time over which errors of velocities count.
    """
    table, n = _table(), len(y) // 2
    K = np.empty((16, len(y)))
    K[0] = f

    def evaluate(s: int, c: float, there: Array) -> None:
        K[s, :n], K[s, n:] = there[n:], at(t + c * h, there[:n], there[n:])

    for s in range(1, 12):
        evaluate(s, table.C[s], y + h * (table.A[s, :s] @ K[:s]))
    y1 = y + h * (table.B @ K[:12])
    evaluate(12, 1.0, y1)
    for s, (row, c) in enumerate(zip(table.A_EXTRA, table.C_EXTRA, strict=True), start=13):
        evaluate(s, c, y + h * (row[:s] @ K[:s]))
    scale = tolerance * (1.0 + np.maximum(np.abs(y[:n]), np.abs(y1[:n])))
    errors = np.stack([table.E5, table.E3]) @ K[:13] / np.concatenate([scale, scale / rates])
    return y1, _series(y1[n:] - y[n:], K[:, n:], h), np.sum(errors * errors, axis=1)


def _joined(squares: Array, h: float, count: int) -> float:
    """Return the error that the squares of those of orders 5 and 3 of a number of entries come to."""
    fifth, third = squares.tolist()
    if fifth == 0.0 and third == 0.0:
        return 0.0
    return float(h * fifth / np.sqrt((fifth + 0.01 * third) * count))


def _series(dv: Array, a: Array, h: Any) -> Array:
    """Return the accelerations of the pair's own interpolant of order 7.

    Parameters
    ----------
    dv : ndarray, shape (n,)
        Change of the velocities.
    a : ndarray, shape (16, n)
        Accelerations at the stages.
    """
    F = np.empty((7, len(dv)))
    F[0] = dv
    F[1] = h * a[0] - dv
    F[2] = 2.0 * dv - h * (a[12] + a[0])
    F[3:] = h * (_table().D @ a)
    theta, to_series = _inner_points()
    increments = np.zeros((len(theta), len(dv)))
    for i in range(6, -1, -1):
        increments = (increments + F[i]) * (theta if i % 2 == 0 else 1.0 - theta)[:, None]
    return np.asarray(to_series @ increments / h)


def amplification(y: Array, order: int | None = None) -> Array:
    """Return |R(iy)|, R(z) = 1 + sum_k b A^k 1 z^(k+1), for y = w h."""
    A, b = _table().A[:12, :12], _table().B
    R, power, factor = np.ones(len(y), dtype=complex), np.ones(12), 1j * y
    for k in range(12):
        R = R + float(b @ power) * factor ** (k + 1)
        power = A @ power
    return np.abs(R)


def _make(solve: Options) -> Explicit:
    return Explicit(solve.tolerance)


EXPLICIT = Integrator(
    _make, Stability("stable up to wh = 6", amplification), rank=6, imports="scipy.integrate"
)
