"""Generalised-alpha method (Chung and Hulbert 1993; Arnold and Bruels, Multibody Syst Dyn 18 (2007) 185).

Second order, with numerical damping of high frequencies set by the spectral radius at infinity.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hfsim.integrators._base import Attempt, Integrator, Stability, aimed, cautious_step, relative, unsolved
from hfsim.integrators._newton import Implicit, Newton, NewtonStepper
from hfsim.integrators._problem import Problem
from hfsim.integrators._trajectory import two_point_series
from hfsim.maths.arrays import Array

MAX_ITERATIONS = 10


@dataclass(frozen=True)
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
    stages: int | None = None

    def start(self, problem: Problem, t: float, q: Array, v: Array) -> GeneralizedAlphaStepper:
        """Return what makes the steps from an initial state."""
        return GeneralizedAlphaStepper(self, problem, t, q, v)


class _End(NamedTuple):
    """State at the end of a step."""

    q: Array
    v: Array
    a: Array
    smooth: Array


class GeneralizedAlphaStepper(NewtonStepper):
    """Generalised-alpha at work.

    Attributes
    ----------
    first : float
    a, smooth : ndarray, shape (n,)
        Accelerations at the start of a step, and the method's own, which it averages.
    """

    looks_back = True
    remembers = ("a", "smooth", "_slope")

    def __init__(self, method: GeneralizedAlpha, problem: Problem, t: float, q: Array, v: Array) -> None:
        rho = method.rho_inf
        self.name, self._tolerance = method.name, method.tolerance
        self._am, self._af = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
        self._gamma = 0.5 + self._af - self._am
        self._beta = 0.25 * (self._gamma + 0.5) ** 2
        self._newton = Newton(problem, MAX_ITERATIONS, patience=1)
        self.a = self.smooth = problem.single(t, q, v)
        self._slope: Array = np.zeros(len(q))
        self.first = cautious_step(self.a, q, self._tolerance)

    def attempt(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        """Solve a = a(t + h, q, v) at the end of the step."""
        equations, share, rest = self._equations(t + h, q, v, h)
        goal = 1e-3 * self._tolerance * (1.0 + float(np.abs(q).max()))
        weights = np.full(len(q), self._beta * h * max(h, self.reach) / goal)
        a = self._newton.solution((t, q, v), equations, self.a, weights)
        if a is None:
            return unsolved()
        end = _End(*equations.state(a), a, share * a + rest)
        self._end = end
        error = self._error(end.smooth - self.smooth, q, h)
        growth = min(aimed(error, 3.0), self._newton.room(equations.by_v))
        series = two_point_series(h, (end.q, end.v, end.a), (q, v, self.a))
        return Attempt(error, 1.0 if 1.0 < growth < 1.3 else growth, end.q, end.v, series)

    def _error(self, change: Array, q: Array, h: float) -> float:
        """Return the error of the positions that a change of the accelerations makes, over the tolerance.

        Velocities follow the trapezoidal rule; their error counts where it reaches farther than the step.
        """
        self._now = change / h
        error = relative(h * h * abs(self._beta - 1.0 / 6.0) * change, q, self._tolerance)
        if not self.reach:
            return error
        bend = self._now - self._slope
        return max(error, relative(h * h * self.reach / 12.0 * bend, q, self._tolerance))

    def accept(self, t: float, q: Array, v: Array) -> None:
        """Take over the accelerations of the step."""
        self.a, self.smooth, self._slope = self._end.a, self._end.smooth, self._now

    def _equations(self, t: float, q: Array, v: Array, h: float) -> tuple[Implicit, float, Array]:
        """Return the equations of the accelerations at an end, and how the method's own depend on them."""
        share = (1.0 - self._af) / (1.0 - self._am)
        rest = (self._af * self.a - self._am * self.smooth) / (1.0 - self._am)
        q = q + h * v + h * h * ((0.5 - self._beta) * self.smooth + self._beta * rest)
        v = v + h * ((1.0 - self._gamma) * self.smooth + self._gamma * rest)
        return Implicit(t, q, v, self._beta * share * h * h, self._gamma * share * h), share, rest


GENERALIZED_ALPHA = Integrator(
    lambda solve: GeneralizedAlpha(solve.tolerance, solve.rho_inf),
    Stability("unconditionally stable for linear scenes"),
    ("rho_inf",),
    rank=2,
)
