"""Gauss and Radau IIA collocation with all stages in one call.

The unknowns are the accelerations a at the stages; stage states follow as

    v_i = v + h sum_j A_ij a_j,   q_i = q + c_i h v + h^2 sum_j (A A)_ij a_j .

They are found by simplified Newton iteration with one derivative J of the accelerations for all
stages.  J is taken apart into modes once and kept for some steps; with A turned into complex pairs
(Butcher's transformation), a correction is then a few products and one division per mode and stage,
for any step length.  The first guess lets every mode swing from the initial state as it would alone,
which is what makes large steps converge in stiff scenes: extrapolated stages would put the fast
modes anywhere.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hfsim.arrays import Array, ComplexArray
from hfsim.integrators._base import Attempt, Problem, unsolved
from hfsim.integrators._tableau import Collocation

MAX_ITERATIONS = 20


@dataclass
class CollocationMethod:
    """A collocation method whose steps follow the decay of the Legendre series of the positions.

    Attributes
    ----------
    name : str
    table : Collocation
    tolerance : float
        Local error per step: metre, radian or slope, relative above 1.
    refresh : int
        Steps after which the derivative is renewed even if it still serves.
    """

    name: str
    table: Collocation
    tolerance: float
    refresh: int = 2

    def start(self, problem: Problem, t: float, q: Array, v: Array) -> float:
        """Take the initial state; return the time in which the fastest mode turns by one radian a stage."""
        self._problem = problem
        self._derivative = derivative(problem, t, q, v)
        self._age = 0
        self._cap = np.inf
        return min(self.table.stages / max(self._derivative.fastest, 1e-3), 1e3)

    def attempt(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        """Solve the stage equations for one step and estimate its error."""
        if self._age >= self.refresh:
            self._derivative = derivative(self._problem, t, q, v)
            self._age = 0
        a = self._solve(t, q, v, h)
        if a is None:
            self._cap = 0.7 * h
            self._age = self.refresh
            return unsolved(0.7)
        table = self.table
        displacement = h * h * (table.A2 @ a)
        tail = np.abs(table.to_legendre[-2:] @ displacement).max(axis=0)
        error = float((tail / (self.tolerance * (1.0 + np.abs(q)))).max())
        return Attempt(
            error=error,
            growth=self._growth(error, h),
            q=q + h * v + h * h * (table.b2 @ a),
            v=v + h * (table.b @ a),
            series=table.to_legendre @ a,
        )

    def accept(self, t: float, q: Array, v: Array) -> None:
        """Count the steps the derivative has served; let a step length that once failed come back slowly."""
        self._age += 1
        self._cap *= 1.05

    def _growth(self, error: float, h: float) -> float:
        growth = 0.9 * max(error, 1e-30) ** (-1.0 / (self.table.stages + 1))
        if error > 1.0:
            return float(growth)
        most = 1.25 if self._iterations <= 6 else 1.0 if self._iterations <= 9 else 0.85
        return float(min(growth, most, self._cap / h))

    def _solve(self, t: float, q: Array, v: Array, h: float) -> Array | None:
        table, problem, J = self.table, self._problem, self._derivative
        times = t + h * table.nodes
        base = q + (h * table.nodes)[:, None] * v
        A, A2, b = h * table.A, h * h * table.A2, h * table.b
        a = J.guess(table, problem, t, q, v, h)
        correct = J.correction(table, h)
        goal = 1e-3 * self.tolerance * (1.0 + float(np.abs(q).max()))
        last = rate = np.inf
        for k in range(MAX_ITERATIONS):
            delta = correct(problem.evaluate(times, base + A2 @ a, v + A @ a) - a)
            a = a + delta
            problem.counts.iterations += 1
            self._iterations = k + 1
            change = J.consequence(b @ delta)
            ratio = change / last
            rate = ratio if k <= 1 else max(ratio, 0.5 * rate)
            settled = k > 0 and rate < 1.0 and change * max(rate, 0.05) < goal * (1.0 - rate)
            if change < 0.05 * goal or settled:
                if k > 0 and rate > 0.35:
                    self._age = self.refresh
                return a
            if not np.isfinite(change) or (k > 3 and ratio > 0.9):
                return None
            last = change
        return None


class Derivative(Protocol):
    """Derivative of the accelerations, in the form in which stage equations are corrected."""

    fastest: float
    """Largest circular frequency in it [rad/s]."""

    def guess(self, table: Collocation, problem: Problem, t: float, q: Array, v: Array, h: float) -> Array:
        """Return first stage accelerations, shape (s, n)."""

    def correction(self, table: Collocation, h: float) -> Callable[[Array], Array]:
        """Return the map from residuals of the stage accelerations to their corrections."""

    def consequence(self, dv: Array) -> float:
        """Return the displacement that an error of the end velocity leads to."""


def derivative(problem: Problem, t: float, q: Array, v: Array) -> Derivative:
    """Compute the derivative of the accelerations and prepare it for corrections."""
    by_q, by_v = problem.jacobians(t, q, v)
    problem.counts.factorisations += 1
    if by_v is None:
        w2, R = np.linalg.eig(-by_q)
        L = np.linalg.inv(R)
        if np.isfinite(L).all() and np.linalg.norm(L) * np.linalg.norm(R) < 1e12:
            return ModalDerivative(w2, R, L)
    return DenseDerivative(by_q, np.zeros_like(by_q) if by_v is None else by_v)


@dataclass
class ModalDerivative:
    """J = -R diag(w2) L, where nothing dissipates: every mode is corrected by itself."""

    w2: Array | ComplexArray
    R: Array | ComplexArray
    L: Array | ComplexArray

    def __post_init__(self) -> None:
        self.fastest = float(np.sqrt(np.abs(self.w2).max(initial=0.0)))
        # a velocity error of a mode swings out to itself over the frequency; slow ones over half a second
        self._per_rate = 1.0 / np.sqrt(np.abs(self.w2) + 4.0)
        self._divisor: tuple[float, ComplexArray] | None = None

    def _back(self, z: ComplexArray) -> Array:
        if np.isrealobj(self.R):
            return np.asarray(z.real @ self.R.T)
        return np.asarray((z @ self.R.T).real)

    def guess(self, table: Collocation, problem: Problem, t: float, q: Array, v: Array, h: float) -> Array:
        """Let each mode swing freely from its velocity and acceleration at the start of the step."""
        a0 = problem.single(t, q, v)
        omega = np.sqrt(self.w2.astype(complex))
        omega = np.where(np.abs(omega) * h < 1e-6, 1e-6 / h, omega)
        phase = (h * table.nodes)[:, None] * omega
        swing = (self.L @ a0) * np.cos(phase) - (self.L @ v) * (self.w2 / omega) * np.sin(phase)
        return self._back(swing.astype(complex))

    def correction(self, table: Collocation, h: float) -> Callable[[Array], Array]:
        """Divide each mode and pole by 1 + (h pole)^2 w2."""
        if self._divisor is None or self._divisor[0] != h:
            self._divisor = (h, np.asarray(1.0 / (1.0 + (h * table.poles[:, None]) ** 2 * self.w2), complex))
        divisor, left, right, L = self._divisor[1], 2.0 * table.left, table.right, self.L.T

        def correct(r: Array) -> Array:
            return self._back(left @ (divisor * (right @ (r @ L))))

        return correct

    def consequence(self, dv: Array) -> float:
        """Return the largest modal velocity over its frequency."""
        return float(np.abs((self.L @ dv) * self._per_rate).max())


@dataclass
class DenseDerivative:
    """J by q and by v as matrices: one complex inverse for each pole of the method and step length."""

    by_q: Array
    by_v: Array

    def __post_init__(self) -> None:
        self.fastest = float(np.sqrt(np.linalg.norm(self.by_q, 2))) if self.by_q.size else 0.0
        self._inverse: tuple[float, ComplexArray] | None = None

    def guess(self, table: Collocation, problem: Problem, t: float, q: Array, v: Array, h: float) -> Array:
        """Keep the accelerations at the start of the step, less what dies out at once."""
        a0 = problem.single(t, q, v)
        damped = np.linalg.solve(np.eye(len(q)) - h * self.by_v - h * h * self.by_q, a0 + h * (self.by_q @ v))
        return np.repeat(damped[None], table.stages, axis=0)

    def correction(self, table: Collocation, h: float) -> Callable[[Array], Array]:
        """Solve with I - (h pole)^2 J_q - h pole J_v."""
        if self._inverse is None or self._inverse[0] != h:
            mu = h * table.poles[:, None, None]
            self._inverse = (h, np.linalg.inv(np.eye(len(self.by_q)) - mu**2 * self.by_q - mu * self.by_v))
        inverse, left, right = self._inverse[1], 2.0 * table.left, table.right

        def correct(r: Array) -> Array:
            return np.asarray((left @ (inverse @ (right @ r)[:, :, None])[:, :, 0]).real)

        return correct

    def consequence(self, dv: Array) -> float:
        """Return the largest velocity over the frequency 2 rad/s, which is on the safe side."""
        return 0.5 * float(np.abs(dv).max())
