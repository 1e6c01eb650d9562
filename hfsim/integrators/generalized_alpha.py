"""Generalised-alpha method (Chung and Hulbert 1993; Arnold and Bruels, Multibody Syst Dyn 18 (2007) 185).

Second order, with numerical damping of high frequencies set by the spectral radius at infinity.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hfsim.integrators._base import Attempt, Problem, two_point_series, unsolved
from hfsim.integrators.derivative import Derivative, derivative
from hfsim.maths.arrays import Array

MAX_ITERATIONS = 10


@dataclass
class GeneralizedAlpha:
    """Generalised-alpha with the error estimate of Zienkiewicz and Xie.

    Attributes
    ----------
    tolerance : float
        Local error per step: metre, radian or slope, relative above 1.
    rho_inf : float
        Spectral radius at infinite frequency, 0 to 1.
    """

    tolerance: float
    rho_inf: float = 0.8
    name: str = "generalized_alpha"

    def start(self, problem: Problem, t: float, q: Array, v: Array) -> float:
        """Take the initial state; return a first step."""
        rho = self.rho_inf
        self._am, self._af = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
        self._gamma = 0.5 + self._af - self._am
        self._beta = 0.25 * (self._gamma + 0.5) ** 2
        self._problem = problem
        self._a = problem.single(t, q, v)
        self._smooth = self._a
        self._derivative: Derivative | None = None
        self._solver: tuple[float, Callable[[Array], Array]] | None = None
        size = float((np.abs(self._a) / (self.tolerance * (1.0 + np.abs(q)))).max())
        return 0.5 / float(np.sqrt(max(size, 1e-6)))

    def attempt(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        """Solve a = a(t + h, q, v) at the end of the step."""
        for fresh in (self._derivative is None, True):
            if fresh:
                self._derivative = derivative(self._problem, t, q, v)
                self._solver = None
            end = self._iterate(t + h, q, v, h)
            if end is not None:
                return self._attempt_of(q, v, h, *end)
            if fresh:
                break
        return unsolved(0.5)

    def accept(self, t: float, q: Array, v: Array) -> None:
        """Take over the accelerations of the step."""
        self._a, self._smooth = self._a_end, self._smooth_end

    def _attempt_of(self, q: Array, v: Array, h: float, q1: Array, v1: Array, a1: Array) -> Attempt:
        change = h * h * abs(self._beta - 1.0 / 6.0) * np.abs(self._smooth_end - self._smooth)
        error = float((change / (self.tolerance * (1.0 + np.abs(q)))).max())
        growth = 0.9 * max(error, 1e-10) ** (-1.0 / 3.0)
        return Attempt(
            error=error,
            growth=1.0 if 1.0 < growth < 1.3 else growth,
            q=q1,
            v=v1,
            series=two_point_series(h, (q1, v1, a1), (q, v, self._a)),
        )

    def _newton_solver(self, h: float) -> Callable[[Array], Array]:
        if self._solver is None or self._solver[0] != h:
            assert self._derivative is not None
            factor = (1.0 - self._af) / (1.0 - self._am)
            solve = self._derivative.solver(self._beta * factor * h * h, self._gamma * factor * h)
            self._solver = (h, solve)
            self._problem.counts.factorisations += 1
        return self._solver[1]

    def _iterate(self, t: float, q: Array, v: Array, h: float) -> tuple[Array, Array, Array] | None:
        solve, time = self._newton_solver(h), np.array([t])
        goal = 1e-3 * self.tolerance * (1.0 + float(np.abs(q).max()))
        a, last = self._a, np.inf
        for k in range(MAX_ITERATIONS):
            smooth = ((1.0 - self._af) * a + self._af * self._a - self._am * self._smooth) / (1.0 - self._am)
            q1 = q + h * v + h * h * ((0.5 - self._beta) * self._smooth + self._beta * smooth)
            v1 = v + h * ((1.0 - self._gamma) * self._smooth + self._gamma * smooth)
            delta = solve(self._problem.evaluate(time, q1[None], v1[None])[0] - a)
            a = a + delta
            self._problem.counts.iterations += 1
            change = self._beta * h * h * float(np.abs(delta).max())
            rate = change / last
            if not np.isfinite(change) or (k > 1 and rate > 0.9):
                return None
            if change < 1e-2 * goal or (k > 0 and change * rate / (1.0 - rate) < goal):
                return self._end_state(q, v, h, a)
            last = change
        return None

    def _end_state(self, q: Array, v: Array, h: float, a: Array) -> tuple[Array, Array, Array]:
        smooth = ((1.0 - self._af) * a + self._af * self._a - self._am * self._smooth) / (1.0 - self._am)
        self._a_end, self._smooth_end = a, smooth
        q1 = q + h * v + h * h * ((0.5 - self._beta) * self._smooth + self._beta * smooth)
        v1 = v + h * ((1.0 - self._gamma) * self._smooth + self._gamma * smooth)
        return q1, v1, a
