"""Gear's backward differentiation formulas, orders 1 to 5, with variable order and step.

Backward differences of (q, v) are kept for the current step length and rescaled when it changes
(quasi-constant steps; Shampine and Reichelt, SIAM J. Sci. Comput. 18 (1997) 1, with kappa = 0).  The
unknown of a step is v; q follows from it.  With a fixed step the first values come from Gauss
collocation, so that the order asked for holds from the start.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hfsim.integrators._base import Attempt, Integrator, Stability, Stepper, aimed, cautious_step, unsolved
from hfsim.integrators._newton import Implicit, Newton, NewtonStepper
from hfsim.integrators._problem import Problem
from hfsim.integrators._tableau import gauss
from hfsim.integrators._trajectory import two_point_series
from hfsim.integrators.collocation import CollocationMethod
from hfsim.maths.arrays import Array

MAX_ORDER = 5
MAX_ITERATIONS = 8
GROWING = {3: (0.25, 2.0), 4: (0.35, 5.0), 5: (0.7, 10.0)}
"""Angles between which an undamped mode grows that turns by one of them in a step; other orders let none."""
RESOLVING = 1.4
"""Angle by which the fastest mode turns in a step of low order below which order 5 is worth up to twice as
many: it is more accurate by far."""
AGAIN = 50
"""Steps of one length after which it is looked again at what rings: a contact may be over."""
PATIENCE = 2
"""Steps that are not kept, none longer in between, after which an order is left that lets a mode grow."""
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


@dataclass(frozen=True)
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
    stages: int | None = None

    def start(self, problem: Problem, t: float, q: Array, v: Array) -> Stepper:
        """Return what makes the steps from an initial state."""
        if self.step is not None:
            return _StartedByGauss(self, self.step, problem, t, q, v)
        a = problem.single(t, q, v)
        h = cautious_step(a, q, self.tolerance)
        differences = np.array([[q, v], [h * v, h * a]])
        return GearStepper(self, problem, h, 1, differences, a)


class GearStepper(NewtonStepper):
    """Backward differentiation at work.

    Parameters
    ----------
    h : float
        Step length.
    differences : ndarray, shape (order + 1 or more, 2, n)
        Backward differences of (q, v) for steps of this length.
    a : ndarray, shape (n,)
        Accelerations.
    """

    looks_back = True
    remembers = ("_h", "_k", "_a", "_D", "_same", "_stuck")

    def __init__(
        self, method: Gear, problem: Problem, h: float, order: int, differences: Array, a: Array
    ) -> None:
        self.name, self.first = method.name, h
        self._method, self._newton = method, Newton(problem, MAX_ITERATIONS, patience=0, listens=True)
        self._h, self._k, self._a = h, order, a
        self._D = np.zeros((MAX_ORDER + 3, *differences.shape[1:]))
        self._D[: len(differences)] = differences
        self._same = 0
        """Steps made with this order and length."""
        self._stuck = 0
        """Attempts that were not kept since a step was made longer."""

    @property
    def label(self) -> str:
        """Name and order of its steps now."""
        return f"{self.name}:{self._k}"

    def attempt(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        """Make one step of the current order."""
        if abs(h - self._h) > 1e-12 * h:
            self._stuck *= h < self._h
            self._rescale(h)
        if self._same and self._same % AGAIN == 0:
            self._newton.renew()
        found = self._solve(t + h)
        if found is None:
            return unsolved()
        k, (d, a1) = self._k, found
        self._end = found
        error = self._size(d, 1.0 / (k + 1))
        q1, v1 = self._D[: k + 1].sum(axis=0) + d
        growth, self._next_order = aimed(error, k + 1), k
        if self._same < k + 1:
            growth = min(growth, 1.0)
        elif self._method.order is None or self._method.step is None:
            growth = self._choose_order(error)
        growth = min(growth, self._newton.room(self._h / GAMMA[k]))
        self._stuck += error > 1.0
        if self._stuck > PATIENCE and self._is_free and self._steady(k) < 1.0:
            self._k, self._same, self._stuck = k - 1, 0, 0
        return Attempt(
            error=error,
            growth=1.0 if error <= 1.0 and growth < 1.2 else min(growth, 5.0),
            q=q1,
            v=v1,
            series=two_point_series(h, (q1, v1, a1), (q, v, self._a)),
        )

    def accept(self, t: float, q: Array, v: Array) -> None:
        """Update the differences, and the order when it pays."""
        self._D, k = self._D.copy(), self._k
        d, self._a = self._end
        D = self._D
        D[k + 2] = d - D[k + 1]
        D[k + 1] = d
        for i in range(k, -1, -1):
            D[i] += D[i + 1]
        D[: k + 2] += np.stack([q, v]) - D[0]
        self._same += 1
        if self._next_order != k:
            self._k, self._same = self._next_order, 0

    def _rescale(self, h: float) -> None:
        self._D = self._D.copy()
        mine = self._D[: self._k + 1]
        mine[:] = (rescaling(self._k, h / self._h) @ mine.reshape(len(mine), -1)).reshape(mine.shape)
        self._h, self._same = h, 0

    def _size(self, d: Array, constant: float) -> float:
        """Return the larger of the errors of q and v, relative to the tolerance; that of v over a step."""
        of_q, of_v = np.abs(d / (self._method.tolerance * (1.0 + np.abs(self._D[0, 0])))).max(axis=1)
        return constant * float(max(of_q, max(self._h, self.reach) * of_v))

    def _choose_order(self, error: float) -> float:
        """Return the growth of the best of the orders k - 1, k, k + 1 and note which it is."""
        k, D, d = self._k, self._D, self._end[0]
        errors = {k: error}
        if k > 1:
            errors[k - 1] = self._size(d + D[k], 1.0 / k)
        if k < MAX_ORDER:
            errors[k + 1] = self._size(d - D[k + 1], 1.0 / (k + 2))
        growth = {i: aimed(e, i + 1) for i, e in errors.items()}
        if self._is_free:
            steady = {i: min(longer, self._steady(i)) for i, longer in growth.items()}
            growth = {i: steady[i] for i in growth if i in GROWING} if self._resolves(growth) else steady
        best = max(growth, key=lambda i: growth[i])
        self._next_order = min(best, self._method.order or MAX_ORDER)
        return growth[self._next_order if self._next_order in growth else k]

    def _resolves(self, growth: dict[int, float]) -> bool:
        """Tell whether orders that let modes grow are to be taken, in steps that resolve all modes."""
        angle = self._h * float(self._newton.ringing.max(initial=0.0))
        others = (longer for i, longer in growth.items() if i not in GROWING)
        return max(growth) in GROWING and angle * max(others, default=0.0) < RESOLVING

    @property
    def _is_free(self) -> bool:
        """Whether order and step are."""
        return self._method.order is None and self._method.step is None

    def _steady(self, order: int) -> float:
        """Return the factor on the step with which no mode grows."""
        least, most = GROWING.get(order, (np.inf, 0.0))
        angles = self._h * self._newton.ringing
        return least / float(angles.max(initial=0.0, where=(angles > least) & (angles < most)) or 1e-6)

    def _solve(self, t: float) -> tuple[Array, Array] | None:
        """Return d = y - predicted, shape (2, n), and the accelerations at the end."""
        k, D = self._k, self._D
        c = self._h / GAMMA[k]
        predicted = D[: k + 1].sum(axis=0)
        psi = np.tensordot(GAMMA[1 : k + 1], D[1 : k + 1], 1) / GAMMA[k]
        v = predicted[1] - psi[1]
        equations = Implicit(t, predicted[0] - psi[0] + c * v, v, c * c, c)
        scale = self._method.tolerance * (1.0 + np.abs(D[0, 0]))
        goal = 1e-3 if self._method.step is None else 0.1
        weights = c * max(c, self._h, self.reach) / (goal * scale)
        a = self._newton.solution((t, *predicted), equations, psi[1] / c, weights)
        if a is None:
            return None
        dv = c * a - psi[1]
        return np.stack([c * (predicted[1] + dv) - psi[0], dv]), a


class _StartedByGauss(Stepper):
    """Fixed steps, of Gauss collocation until there are differences enough."""

    looks_back = True

    def __init__(self, method: Gear, h: float, problem: Problem, t: float, q: Array, v: Array) -> None:
        self.name, self.first = method.name, h
        self._method, self._problem = method, problem
        self._order = method.order or MAX_ORDER
        self._states = np.stack([q, v])[None]
        starter = CollocationMethod("gauss", gauss(6), min(method.tolerance, 1e-10))
        self._now: Stepper = starter.start(problem, t, q, v)

    def attempt(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        """Make one step."""
        self._now.reach = self.reach
        return self._now.attempt(t, q, v, h)

    def accept(self, t: float, q: Array, v: Array) -> None:
        """Go over to backward differentiation as soon as it has all it needs."""
        self._now.accept(t, q, v)
        if self._started:
            return
        self._states = np.concatenate([self._states, [[q, v]]])
        if self._started:
            self._now = self._differentiating(self._problem.single(t, q, v))

    @property
    def label(self) -> str:
        """Name and order."""
        return f"{self.name}:{self._order}"

    @property
    def _started(self) -> bool:
        return len(self._states) > self._order + 1

    def _differentiating(self, a: Array) -> GearStepper:
        differences = backward_differences(self._states[::-1])
        return GearStepper(self._method, self._problem, self.first, self._order, differences, a)

    def memory(self) -> dict[str, Any]:
        """Return the first states and what the stepper of now remembers."""
        return {"states": self._states} | self._now.memory()

    def recall(self, memory: Mapping[str, Any]) -> None:
        """Go on with the stepper of that time."""
        self._states = memory["states"]
        if self._started:
            self._now = self._differentiating(memory["_a"])
        self._now.recall(memory)


def backward_differences(values: Array) -> Array:
    """Return the differences, of order 0 and up, of values at even distances, the last one first.

    Examples
    --------
    >>> backward_differences(np.array([9.0, 4.0, 1.0]))
    array([9., 5., 2.])
    """
    out = np.empty_like(values)
    for i in range(len(out)):
        out[i] = values[0]
        values = values[:-1] - values[1:]
    return out


def amplification(y: Array, order: int | None) -> Array:
    """Return the largest root of backward differentiation at z = iy: sum_j (1 - 1/x)^j / j = z."""
    order = order or MAX_ORDER
    # (1 - 1/x)^j x^order: coefficients of x^order, x^(order-1), ...
    base = sum(
        (np.pad(np.poly(np.ones(j)), (0, order - j)) / j for j in range(1, order + 1)), np.zeros(order + 1)
    )
    unit = np.eye(order + 1)[0]
    return np.array([np.abs(np.roots(base - 1j * value * unit)).max() for value in y])


GEAR = Integrator(
    lambda solve: Gear(solve.tolerance, solve.step, solve.order),
    Stability("A-stable", amplification),
    ("order",),
    orders=(1, 2, 3, 4, 5),
    rank=1,
    rescue=3,
)
