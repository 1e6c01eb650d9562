"""Gauss and Radau IIA collocation with all stages in one call.

The unknowns are the accelerations a at the stages; stage states follow as

    v_i = v + h sum_j A_ij a_j,   q_i = q + c_i h v + h^2 sum_j (A A)_ij a_j .

They are found by simplified Newton iteration with one derivative J of the accelerations for all
stages, in coordinates where it changes little (`Increments`).  J is taken apart into modes once and
kept for some steps; with A turned into complex pairs (Butcher's transformation), a correction is then
a few products and one division per mode and stage, for any step length.  The first guess lets every
mode swing from the initial state as it would alone: extrapolated stages would put the fast modes
anywhere, and the iteration would not converge at large steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hfsim.arrays import Array, ComplexArray
from hfsim.integrators._base import Attempt, Increments, PlainIncrements, Problem, unsolved
from hfsim.integrators._tableau import Collocation

MAX_ITERATIONS = 20
SERVES_WELL = 5
"""Iterations in a step up to which its derivative is kept for one more."""
LINEAR = 1e-3
"""Natural increments below which their linear map to the state is good enough."""
STIFF = 2.0
"""Angle by which the fastest mode turns from stage to stage from which natural coordinates pay."""


@dataclass
class CollocationMethod:
    """A collocation method whose steps follow the decay of the Legendre series of the positions.

    Attributes
    ----------
    name : str
    table : Collocation
    tolerance : float
        Local error per step: metre, radian or slope, relative above 1.
    """

    name: str
    table: Collocation
    tolerance: float

    def start(self, problem: Problem, t: float, q: Array, v: Array) -> float:
        """Take the initial state; return the time in which the fastest mode turns by one radian a stage."""
        self._problem = problem
        self._derivative = derivative(problem, t, q, v, PlainIncrements())
        self._old = self._served = False
        self._cap = np.inf
        return min(self.table.stages / max(self._derivative.fastest, 1e-3), 1e3)

    def attempt(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        """Solve the stage equations for one step and estimate its error."""
        a = self._guess(q, v, self._problem.single(t, q, v), h)
        table = self.table
        if self._old:
            middle = table.stages // 2
            tau = h * table.nodes[middle]
            self._renew(
                t + tau, q + tau * v + h * h * (table.A2[middle] @ a), v + h * (table.A[middle] @ a), h
            )
        solved = self._solve(t, q, v, h, a)
        if solved is None:
            self._cap = 0.7 * h
            self._renew(t, q, v, 0.7 * h)
            return unsolved(0.7)
        a = solved
        tail = np.abs(table.to_legendre[-2:] @ (table.A2 @ a)).max(axis=0) * h * h
        error = float((tail / (self.tolerance * (1.0 + np.abs(q)))).max())
        return Attempt(
            error=error,
            growth=self._growth(error, h),
            q=q + h * v + h * h * (table.b2 @ a),
            v=v + h * (table.b @ a),
            series=table.to_legendre @ a,
        )

    def accept(self, t: float, q: Array, v: Array) -> None:
        """Ask for a new derivative every other step, or at once if it served badly.

        A step length that once failed comes back slowly.
        """
        self._old = self._served or self._iterations > SERVES_WELL
        self._served = True
        self._cap *= 1.05

    def _growth(self, error: float, h: float) -> float:
        growth = 0.9 * max(error, 1e-30) ** (-1.0 / (self.table.stages + 1))
        if error > 1.0:
            return float(growth)
        # long steps with many iterations cost less than short ones with few, up to a point
        most = 1.25 if self._iterations <= 8 else 1.0 if self._iterations <= 11 else 0.85
        return float(min(growth, most, self._cap / h))

    def _guess(self, q: Array, v: Array, a0: Array, h: float) -> Array:
        """Return stage accelerations of modes that swing freely from the start of the step."""
        natural, table = self._derivative.increments, self.table
        y1, y2 = natural.rates(q[None], v[None], a0[None])
        y = self._derivative.free_motion(table, y1[0], y2[0], h)
        moved = natural.advance(natural.geometry(q[None]), y)
        return np.asarray(table.A2_inverse @ (moved - (h * table.nodes)[:, None] * v) / h**2)

    def _renew(self, t: float, q: Array, v: Array, h: float) -> None:
        """Compute the derivative anew, in natural coordinates if the step is long for its fastest mode."""
        stiff = h * self._derivative.fastest > STIFF * self.table.stages
        increments = self._problem.increments if stiff else PlainIncrements()
        self._derivative = derivative(self._problem, t, q, v, increments)
        self._old = self._served = False

    def _solve(self, t: float, q: Array, v: Array, h: float, a: Array) -> Array | None:
        """Return the stage accelerations, or None if the iteration does not converge."""
        table, problem, natural = self.table, self._problem, self._derivative.increments
        times, uniform = t + h * table.nodes, q + (h * table.nodes)[:, None] * v
        scaled = np.concatenate([h * h * table.A2, h * table.A])
        back, s = table.A2_inverse / h**2, table.stages
        A2 = scaled[:s]
        plain = isinstance(natural, PlainIncrements)
        correct = self._derivative.correction(table, h)
        goal = 1e-3 * self.tolerance * (1.0 + float(np.abs(q).max()))
        last = rate = np.inf
        for k in range(MAX_ITERATIONS):
            moved = scaled @ a
            Q = uniform + moved[:s]
            at = natural.geometry(Q)
            r = A2 @ (problem.evaluate(times, Q, v + moved[s:]) - a)
            y, change = correct(natural.to_natural(at, r))
            if plain:
                a = a + back @ y
            else:
                small = np.abs(y).max() < LINEAR
                a = a + back @ (natural.from_natural(at, y) if small else natural.advance(at, y))
            problem.counts.iterations += 1
            self._iterations = k + 1
            ratio = change / last
            rate = ratio if k <= 1 else max(ratio, 0.5 * rate)
            settled = k > 0 and rate < 1.0 and change * max(rate, 0.05) < goal * (1.0 - rate)
            if change < 0.05 * goal or settled:
                return a if np.isfinite(a).all() else None
            if not change < 1e3 or (k > 3 and ratio > 0.9):
                return None
            last = change
        return None


class Derivative(Protocol):
    """Derivative of the accelerations in natural coordinates, in the form that corrections need."""

    increments: Increments
    """The coordinates it is written in."""
    fastest: float
    """Largest circular frequency in it [rad/s]."""

    def free_motion(self, table: Collocation, y1: Array, y2: Array, h: float) -> Array:
        """Return natural displacements at the stages, (s, n), from rates at the start of the step."""

    def correction(self, table: Collocation, h: float) -> Callable[[Array], tuple[Array, float]]:
        """Return the map from residuals at the stages to corrections and the size of their consequence.

        The consequence is the displacement to which the change of the velocity at the end of the step
        leads: it is what an unfinished iteration does to the steps that follow.
        """


def derivative(problem: Problem, t: float, q: Array, v: Array, natural: Increments) -> Derivative:
    """Compute the derivative of the accelerations at a state, in natural coordinates, for corrections."""
    by_q, by_v = problem.jacobians(t, q, v)
    problem.counts.factorisations += 1
    if not isinstance(natural, PlainIncrements):
        by_q, by_v = _in_natural(natural, q, by_q, by_v)
    if by_v is not None:
        return DenseDerivative(natural, by_q, by_v)
    w2, R = np.linalg.eig(-by_q)
    L = np.linalg.inv(R)
    if np.abs(L).max() * len(q) < 1e10:
        return ModalDerivative(natural, w2, R, L)
    return DenseDerivative(natural, by_q, np.zeros_like(by_q))


def _in_natural(natural: Increments, q: Array, by_q: Array, by_v: Array | None) -> tuple[Array, Array | None]:
    """Return derivatives by state coordinates as derivatives by natural coordinates."""
    n = len(q)
    at = natural.geometry(q[None])
    unit = natural.from_natural(at, np.eye(n)).T

    def turned(J: Array) -> Array:
        return natural.to_natural(at, np.ascontiguousarray((J @ unit).T)).T

    return turned(by_q), None if by_v is None else turned(by_v)


@dataclass
class ModalDerivative:
    """J = -R diag(w2) L, where nothing dissipates: every mode is corrected by itself."""

    increments: Increments
    w2: Array | ComplexArray
    R: Array | ComplexArray
    L: Array | ComplexArray

    def __post_init__(self) -> None:
        self.fastest = float(np.sqrt(np.abs(self.w2).max(initial=0.0)))
        # a velocity error of a mode swings out to itself over the frequency; slow ones over half a second
        self._per_rate = 1.0 / np.sqrt(np.abs(self.w2) + 4.0)
        self._divisor: tuple[float, ComplexArray] | None = None

    def _real(self, z: ComplexArray) -> Array | ComplexArray:
        """Drop the imaginary part where the modes are real, so that what follows is real too."""
        return z.real if np.isrealobj(self.R) else z

    def free_motion(self, table: Collocation, y1: Array, y2: Array, h: float) -> Array:
        """Let each mode swing freely from its velocity and acceleration at the start of the step."""
        omega = np.sqrt(self.w2.astype(complex))
        omega = np.where(np.abs(omega) * h < 1e-4, 1e-4 / h, omega)
        half = (0.5 * h * table.nodes)[:, None] * omega
        sine = np.sin(half) / omega
        swing = (self.L @ y1) * (2.0 * sine * np.cos(half)) + (self.L @ y2) * (2.0 * sine * sine)
        return np.asarray((self._real(swing) @ self.R.T).real)

    def correction(self, table: Collocation, h: float) -> Callable[[Array], tuple[Array, float]]:
        """Divide each mode and pole by 1 + (h pole)^2 w2."""
        if self._divisor is None or self._divisor[0] != h:
            self._divisor = (h, np.asarray(1.0 / (1.0 + (h * table.poles[:, None]) ** 2 * self.w2), complex))
        divisor, left, right = self._divisor[1], 2.0 * table.left, table.right
        L, R, end_rate, per_rate = self.L.T, self.R.T, table.end_rate / h, self._per_rate

        def correct(r: Array) -> tuple[Array, float]:
            z = right @ (r @ L)
            z *= divisor
            modes = self._real(left @ z)
            # back in coordinates: amplitudes of nearly parallel modes mean nothing one by one
            consequence = ((end_rate @ modes) * per_rate) @ R
            return (modes @ R).real, float(np.abs(consequence.real).max())

        return correct


@dataclass
class DenseDerivative:
    """J by q and by v as matrices: one complex inverse for each pole of the method and step length."""

    increments: Increments
    by_q: Array
    by_v: Array

    def __post_init__(self) -> None:
        self.fastest = float(np.sqrt(np.linalg.norm(self.by_q, 2))) if self.by_q.size else 0.0
        self._inverse: tuple[float, ComplexArray] | None = None

    def free_motion(self, table: Collocation, y1: Array, y2: Array, h: float) -> Array:
        """Keep the accelerations at the start of the step, less what dies out at once."""
        matrix = np.eye(len(y1)) - h * self.by_v - h * h * self.by_q
        damped = np.linalg.solve(matrix, y2 + h * (self.by_q @ y1))
        tau = (h * table.nodes)[:, None]
        return np.asarray(tau * y1 + 0.5 * tau**2 * damped)

    def correction(self, table: Collocation, h: float) -> Callable[[Array], tuple[Array, float]]:
        """Solve with I - (h pole)^2 J_q - h pole J_v."""
        if self._inverse is None or self._inverse[0] != h:
            mu = h * table.poles[:, None, None]
            matrix = np.eye(len(self.by_q)) - mu**2 * self.by_q - mu * self.by_v
            self._inverse = (h, np.linalg.inv(matrix))
        inverse, left, right, end_rate = self._inverse[1], 2.0 * table.left, table.right, table.end_rate / h

        def correct(r: Array) -> tuple[Array, float]:
            y = (left @ (inverse @ (right @ r)[:, :, None])[:, :, 0]).real
            # without modes every velocity error counts as if it were slow, which is on the safe side
            return y, 0.5 * float(np.abs(end_rate @ y).max())

        return correct
