"""Gear's backward differentiation formulas, orders 1 to 5, with variable order and step.

Backward differences of (q, v) are kept for the current step length and rescaled when it changes
(quasi-constant steps; Shampine and Reichelt, SIAM J. Sci. Comput. 18 (1997) 1, with kappa = 0).  The
unknown of a step is v; q follows from it.  With a fixed step the first values come from Gauss
collocation, so that the order asked for holds from the start.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hfsim.integrators._base import Attempt, Problem, two_point_series, unsolved
from hfsim.integrators._tableau import gauss
from hfsim.integrators.collocation import CollocationMethod
from hfsim.integrators.derivative import Derivative, derivative
from hfsim.maths.arrays import Array

MAX_ORDER = 5
MAX_ITERATIONS = 8
GAMMA = np.concatenate([[0.0], np.cumsum(1.0 / np.arange(1, MAX_ORDER + 1))])


def rescaling(order: int, factor: float) -> Array:
    """Return the matrix that turns backward differences for step h into those for step factor h."""

    def differences(ratio: float) -> Array:
        i = np.arange(1, order + 1)[:, None]
        j = np.arange(1, order + 1)
        M = np.zeros((order + 1, order + 1))
        M[0] = 1.0
        M[1:, 1:] = (i - 1 - ratio * j) / i
        return np.cumprod(M, axis=0)

    return np.asarray((differences(factor) @ differences(1.0)).T)


@dataclass
class Gear:
    """Backward differentiation formulas.

    Attributes
    ----------
    tolerance : float
        Local error per step: metre, radian or slope, relative above 1; velocities count times h.
    step : float or None
        Fixed step length.
    order : int or None
        Fixed order; without it the order with the smallest error is taken.
    """

    tolerance: float
    step: float | None = None
    order: int | None = None
    name: str = "gear"

    def start(self, problem: Problem, t: float, q: Array, v: Array) -> float:
        """Take the initial state; return a first step for order 1."""
        self._problem = problem
        a = problem.single(t, q, v)
        self._a = a
        self._derivative: Derivative | None = None
        self._solver: tuple[float, Callable[[Array], Array]] | None = None
        if self.step is not None:
            self._h = self.step
            self._k = self.order or MAX_ORDER
            self._history = [np.stack([q, v])]
            self._starter = CollocationMethod("gauss", gauss(6), min(self.tolerance, 1e-10))
            self._starter.start(problem, t, q, v)
            return self.step
        self._history = []
        self._k = 1
        size = float((np.abs(a) / (self.tolerance * (1.0 + np.abs(q)))).max())
        self._h = 0.5 / np.sqrt(max(size, 1e-6))
        self._D = np.zeros((MAX_ORDER + 3, 2, len(q)))
        self._D[0] = q, v
        self._D[1] = self._h * v, self._h * a
        self._same = 0
        return float(self._h)

    def attempt(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        """Make one step of the current order."""
        if self._history:
            return self._starting_attempt(t, q, v, h)
        if abs(h - self._h) > 1e-12 * h:
            self._rescale(h)
        d = self._solve(t + h)
        if d is None:
            self._derivative = None
            return unsolved(0.5)
        self._d = d
        k = self._k
        error = self._size(d, 1.0 / (k + 1))
        predicted = self._D[: k + 1].sum(axis=0)
        q1, v1 = predicted + d
        a1 = self._a_end
        growth = 0.9 * max(error, 1e-10) ** (-1.0 / (k + 1))
        self._next_order = k
        if self._same >= k + 1 and (self.order is None or self.step is None):
            growth = self._choose_order(error)
        return Attempt(
            error=error,
            growth=1.0 if error <= 1.0 and growth < 1.2 else min(growth, 5.0),
            q=q1,
            v=v1,
            series=two_point_series(h, (q1, v1, a1), (q, v, self._a)),
        )

    def accept(self, t: float, q: Array, v: Array) -> None:
        """Update the differences, and the order when it pays."""
        if self._history:
            self._starting_accept(t, q, v)
            return
        D, d, k = self._D, self._d, self._k
        D[k + 2] = d - D[k + 1]
        D[k + 1] = d
        for i in range(k, -1, -1):
            D[i] += D[i + 1]
        D[: k + 2] += np.stack([q, v]) - D[0]
        self._a = self._a_end
        self._same += 1
        if self._next_order != k:
            self._k = self._next_order
            self._same = 0

    def _starting_attempt(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        attempt = self._starter.attempt(t, q, v, h)
        self._step_made = h
        return attempt

    def _starting_accept(self, t: float, q: Array, v: Array) -> None:
        self._starter.accept(t, q, v)
        self._history.append(np.stack([q, v]))
        if len(self._history) <= self._k + 1:
            return
        values = np.array(self._history[::-1])
        D = np.zeros((MAX_ORDER + 3, 2, values.shape[2]))
        for i in range(len(values)):
            D[i] = values[0]
            values = values[:-1] - values[1:]
        self._D = D
        self._a = self._problem.single(t, q, v)
        self._same = 0
        self._history = []

    def _rescale(self, h: float) -> None:
        k = self._k
        shape = self._D[: k + 1].shape
        flat = self._D[: k + 1].reshape(k + 1, -1)
        self._D[: k + 1] = (rescaling(k, h / self._h) @ flat).reshape(shape)
        self._h = h
        self._same = 0

    def _size(self, d: Array, constant: float) -> float:
        """Return the larger of the errors of q and h v, relative to the tolerance."""
        scale = self.tolerance * (1.0 + np.abs(self._D[0, 0]))
        return constant * float(max(np.abs(d[0] / scale).max(), self._h * np.abs(d[1] / scale).max()))

    def _choose_order(self, error: float) -> float:
        """Return the growth of the best of the orders k - 1, k, k + 1 and note which it is."""
        k, D, d = self._k, self._D, self._d
        errors = {k: error}
        if k > 1:
            errors[k - 1] = self._size(d + D[k], 1.0 / k)
        if k < MAX_ORDER:
            errors[k + 1] = self._size(d - D[k + 1], 1.0 / (k + 2))
        growth = {i: 0.9 * max(e, 1e-10) ** (-1.0 / (i + 1)) for i, e in errors.items()}
        best = max(growth, key=lambda i: growth[i])
        if self.order is not None:
            best = min(best, self.order)
        self._next_order = best
        return float(growth.get(best, growth[k]))

    def _solve(self, t: float) -> Array | None:
        """Return d = y - predicted, shape (2, n), by simplified Newton iteration on v."""
        k, D, problem = self._k, self._D, self._problem
        c = self._h / GAMMA[k]
        predicted = D[: k + 1].sum(axis=0)
        psi = np.tensordot(GAMMA[1 : k + 1], D[1 : k + 1], 1) / GAMMA[k]
        goal = 1e-3 if self.step is None else 0.1
        for fresh in (self._derivative is None, True):
            if fresh:
                self._derivative = derivative(problem, t, predicted[0], predicted[1])
                self._solver = None
            d = self._iterate(t, c, predicted, psi, goal, self._newton_solver(c))
            if d is not None or fresh:
                return d
        return None

    def _newton_solver(self, c: float) -> Callable[[Array], Array]:
        if self._solver is None or self._solver[0] != c:
            assert self._derivative is not None
            self._solver = (c, self._derivative.solver(c * c, c))
            self._problem.counts.factorisations += 1
        return self._solver[1]

    def _iterate(
        self,
        t: float,
        c: float,
        predicted: Array,
        psi: Array,
        goal: float,
        solve: Callable[[Array], Array],
    ) -> Array | None:
        time = np.array([t])
        dv = np.zeros(predicted.shape[1])
        last = np.inf
        for _ in range(MAX_ITERATIONS):
            v = predicted[1] + dv
            dq = c * v - psi[0]
            a = self._problem.evaluate(time, (predicted[0] + dq)[None], v[None])[0]
            step = solve(c * a - psi[1] - dv)
            dv = dv + step
            self._problem.counts.iterations += 1
            change = self._size(np.stack([c * step, step]), 1.0)
            rate = change / last
            if not np.isfinite(change) or rate > 0.9:
                return None
            if change < goal * 1e-2 or (np.isfinite(last) and change * rate / (1.0 - rate) < goal):
                self._a_end = (psi[1] + dv) / c
                return np.stack([c * (predicted[1] + dv) - psi[0], dv])
            last = change
        return None
