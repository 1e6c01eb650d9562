"""Explicit Runge-Kutta pair of order 8 (Dormand and Prince; Hairer, Norsett and Wanner II.10).

The coefficients are those of SciPy's DOP853; the step is made here, where projection onto the
constraints and the shared loop can take hold of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from hfsim.integrators._base import Attempt, Integrator, Options, Stability, Stepper, aimed
from hfsim.integrators._problem import Problem
from hfsim.integrators._tableau import legendre
from hfsim.maths.arrays import Array


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
        self._f = self._rates(t, np.stack([q, v]))
        size = float((np.abs(self._f[1]) / (1.0 + np.abs(q))).max())
        self.first = float(self._tolerance ** (1.0 / 8.0)) / float(np.sqrt(max(size, 1.0)))

    def attempt(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        """Make one step of length h and estimate its error."""
        table, y = _table(), np.stack([q, v])
        K = np.empty((16, 2, len(q)))
        K[0] = self._f
        for s in range(1, 12):
            K[s] = self._rates(t + table.C[s] * h, y + h * np.tensordot(table.A[s, :s], K[:s], 1))
        y1 = y + h * np.tensordot(table.B, K[:12], 1)
        K[12] = self._rates(t + h, y1)
        error = self._error(K[:13], y, y1, h)
        return Attempt(
            error=error,
            growth=aimed(error, 8.0),
            q=y1[0],
            v=y1[1],
            series=self._series(t, y, y1, K, h),
        )

    def accept(self, t: float, q: Array, v: Array) -> None:
        """Evaluate the projected state, from which the next step starts."""
        self._f = self._rates(t, np.stack([q, v]))

    def _rates(self, t: float, y: Array) -> Array:
        return np.stack([y[1], self._problem.single(t, y[0], y[1])])

    def _error(self, K: Array, y: Array, y1: Array, h: float) -> float:
        """Combine the errors of orders 5 and 3; velocities count over a step."""
        table = _table()
        scale = self._tolerance * (1.0 + np.maximum(np.abs(y[0]), np.abs(y1[0])))
        scales = np.stack([scale, scale / max(min(h, 1.0), self.reach)])
        fifth = np.linalg.norm(np.tensordot(table.E5, K, 1) / scales) ** 2
        third = np.linalg.norm(np.tensordot(table.E3, K, 1) / scales) ** 2
        if fifth == 0.0 and third == 0.0:
            return 0.0
        return float(h * fifth / np.sqrt((fifth + 0.01 * third) * y.size))

    def _series(self, t: float, y: Array, y1: Array, K: Array, h: float) -> Array:
        """Return the accelerations of the pair's own interpolant of order 7."""
        table = _table()
        for s, (row, c) in enumerate(zip(table.A_EXTRA, table.C_EXTRA, strict=True), start=13):
            K[s] = self._rates(t + c * h, y + h * np.tensordot(row[:s], K[:s], 1))
        F = np.empty((7, len(y1[0])))
        dv = y1[1] - y[1]
        F[0] = dv
        F[1] = h * K[0, 1] - dv
        F[2] = 2.0 * dv - h * (K[12, 1] + K[0, 1])
        F[3:] = h * np.tensordot(table.D, K[:, 1], 1)
        theta, to_series = _inner_points()
        increments = np.zeros((len(theta), F.shape[1]))
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
