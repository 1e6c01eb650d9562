"""Gauss and Radau IIA collocation with all stages in one call.

The unknowns are the accelerations a at the stages; stage states follow as

    v_i = v + h sum_j A_ij a_j,   q_i = q + c_i h v + h^2 sum_j (A A)_ij a_j .

Two iterations solve a_i = a(t_i, q_i, v_i).  *Fixed point*: insert and evaluate, cheap, converges
while the step resolves the fastest motion.  *Simplified Newton*: one derivative of the accelerations
for all stages, A turned into complex pairs, so that a correction costs one batched product with
matrices inverted once per derivative and step length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hfsim.integrators._base import Attempt, Problem
from hfsim.integrators._tableau import Collocation, legendre

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

MAX_ITERATIONS = 25


@dataclass
class CollocationMethod:
    """A collocation method with step-size control by the decay of the Legendre series.

    Attributes
    ----------
    table : Collocation
    tolerance : float
        Local error per step: metre, radian or slope, relative above 1.
    adaptive : bool
    """

    table: Collocation
    tolerance: float
    adaptive: bool = True
    newton: bool = False

    def start(self, problem: Problem, t: float, q: Array, v: Array) -> float:
        """Take the initial state; guess a first step from the accelerations."""
        self._problem = problem
        self._previous: tuple[float, Array] | None = None
        self._jacobian: tuple[Array, Array | None] | None = None
        self._inverse: tuple[float, ComplexArray] | None = None
        self._fresh = False
        a = problem.single(t, q, v)
        self._guess = a
        scale = np.abs(a).max()
        return float(np.sqrt(self.tolerance ** 0.2 / max(scale, 1e-3)))

    def attempt(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        """Solve the stage equations for one step and estimate its error."""
        scale = self.tolerance * (1.0 + np.abs(q))
        a = self._predict(h)
        solved = self._solve(t, q, v, h, a, scale)
        if solved is None:
            return Attempt(converged=False, growth=0.5)
        a = solved
        table = self.table
        series = table.to_legendre @ a
        error = self._error(series, h, scale)
        self._candidate = (h, series)
        return Attempt(
            converged=True,
            error=error,
            q=q + h * v + h * h * (table.b2 @ a),
            v=v + h * (table.b @ a),
            series=series,
            growth=0.9 * max(error, 1e-10) ** (-1.0 / (table.stages + 1)),
        )

    def accept(self, t: float, q: Array, v: Array) -> None:
        """Remember the accelerations of the step for the next guess."""
        self._previous = self._candidate
        self._fresh = False

    def _predict(self, h: float) -> Array:
        if self._previous is None:
            return np.repeat(self._guess[None], self.table.stages, axis=0)
        h_old, series = self._previous
        values, _, _ = legendre(1.0 + self.table.nodes * (h / h_old), len(series))
        return np.asarray(values @ series)

    def _error(self, series: Array, h: float, scale: Array) -> float:
        s = len(series)
        tail = np.abs(series[-2:]).max(axis=0) if s > 2 else np.abs(series[-1])
        return float((tail / scale).max() * h * h / (4.0 * s * s))

    def _solve(self, t: float, q: Array, v: Array, h: float, a: Array, scale: Array) -> Array | None:
        table, problem = self.table, self._problem
        times = t + h * table.nodes
        base = q + h * table.nodes[:, None] * v
        A, A2 = h * table.A, h * h * table.A2
        last = np.inf
        for k in range(MAX_ITERATIONS):
            r = problem.evaluate(times, base + A2 @ a, v + A @ a) - a
            delta = self._correction(t, q, v, h, r) if self.newton else r
            a = a + delta
            problem.counts.iterations += 1
            change = float((np.abs(A2 @ delta) / scale).max())
            if not np.isfinite(change):
                return None
            rate = change / last
            if change < 0.01 or (rate < 0.9 and change * rate / (1 - rate) < 0.01 and k > 0):
                return a
            if k > 2 and rate > 2.0:
                return None
            last = change
        return None

    def _correction(self, t: float, q: Array, v: Array, h: float, r: Array) -> Array:
        if self._jacobian is None or not self._fresh:
            self._jacobian = self._problem.jacobians(t, q, v)
            self._fresh = True
            self._inverse = None
        if self._inverse is None or self._inverse[0] != h:
            self._inverse = (h, self._factor(h))
        table = self.table
        z = self._inverse[1] @ (table.right @ r)[:, :, None]
        return 2.0 * np.real(table.left @ z[:, :, 0])

    def _factor(self, h: float) -> ComplexArray:
        assert self._jacobian is not None
        by_q, by_v = self._jacobian
        mu = h * self.table.poles[:, None, None]
        matrix = np.eye(len(by_q)) - mu**2 * by_q
        if by_v is not None:
            matrix = matrix - mu * by_v
        self._problem.counts.factorisations += 1
        return np.asarray(np.linalg.inv(matrix))
