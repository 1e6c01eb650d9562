"""What integrators see and give: functions of (t, q, v), and steps with a polynomial inside.

The loop around the steps is shared (`integrate`); a method makes one step at a time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hfsim.errors import LimitReached, SolverFailure
from hfsim.integrators._tableau import legendre

Array = NDArray[np.float64]


@dataclass
class Counts:
    """What a run cost, in calls."""

    steps: int = 0
    rejected: int = 0
    iterations: int = 0
    evaluations: int = 0
    """States at which accelerations were computed."""
    calls: int = 0
    """Batches in which they were."""
    factorisations: int = 0


@dataclass
class Problem:
    """Equations of motion q'' = a(t, q, v) with the manifold their solutions stay on.

    Attributes
    ----------
    acceleration : callable
        (t, q, v) -> q'' with a leading batch axis on all of them.
    project : callable
        (t, q, v) -> (q, v) moved onto the constraints; batch axis as above.
    dissipates : bool
        Whether stiff methods need the derivative of the accelerations by v.
    """

    acceleration: Callable[[Array, Array, Array], Array]
    project: Callable[[Array, Array, Array], tuple[Array, Array]]
    dissipates: bool
    counts: Counts = field(default_factory=Counts)

    def evaluate(self, t: Array, q: Array, v: Array) -> Array:
        """Return accelerations of a batch and count the call."""
        self.counts.calls += 1
        self.counts.evaluations += len(q)
        return self.acceleration(t, q, v)

    def single(self, t: float, q: Array, v: Array) -> Array:
        """Return the accelerations of one state, shape (n,)."""
        return self.evaluate(np.array([t]), q[None], v[None])[0]

    def jacobians(self, t: float, q: Array, v: Array) -> tuple[Array, Array | None]:
        """Return the derivatives of the accelerations by q and v, shape (n, n), from one batched call.

        Forward differences; all columns are one batch.  The derivative by v is None where nothing
        dissipates: gyroscopic terms alone never make a problem stiff.
        """
        n = len(q)
        dq = 1e-7 * np.maximum(1.0, np.abs(q))
        kinds = 2 if self.dissipates else 1
        Q = np.repeat(q[None], kinds * n + 1, axis=0)
        V = np.repeat(v[None], kinds * n + 1, axis=0)
        Q[np.arange(n), np.arange(n)] += dq
        if self.dissipates:
            dv = 1e-7 * np.maximum(1.0, np.abs(v))
            V[n + np.arange(n), np.arange(n)] += dv
        a = self.evaluate(np.full(len(Q), t), Q, V)
        by_q = ((a[:n] - a[-1]) / dq[:, None]).T
        by_v = ((a[n : 2 * n] - a[-1]) / dv[:, None]).T if self.dissipates else None
        return by_q, by_v


@dataclass(frozen=True)
class Segment:
    """One step: start state and the accelerations within it as a Legendre series.

    Attributes
    ----------
    t, h : float
    q, v : ndarray, shape (n,)
        State at the start.
    series : ndarray, shape (m, n)
        Coefficients of the shifted Legendre polynomials in (time - t) / h.
    """

    t: float
    h: float
    q: Array
    v: Array
    series: Array

    def at(self, times: Array) -> tuple[Array, Array]:
        """Return (q, v) at times within the step, shape (n_times, n) each."""
        theta = (times - self.t) / self.h
        _, once, twice = legendre(theta, len(self.series))
        v = self.v + self.h * (once @ self.series)
        q = self.q + self.h * theta[:, None] * self.v + self.h**2 * (twice @ self.series)
        return q, v


def two_point_series(h: float, ends: tuple[Array, Array, Array], start: tuple[Array, Array, Array]) -> Array:
    """Return the cubic accelerations that join (q, v, a) at both ends of a step, shape (4, n)."""
    q0, v0, a0 = start
    q1, v1, a1 = ends
    values, _, _ = legendre(np.array([0.0, 1.0]), 4)
    _, once, twice = legendre(np.array([1.0]), 4)
    matrix = np.concatenate([values, once, twice])
    rhs = np.stack([a0, a1, (v1 - v0) / h, (q1 - q0 - h * v0) / h**2])
    return np.asarray(np.linalg.solve(matrix, rhs))


@dataclass
class Attempt:
    """The outcome of trying one step.

    Attributes
    ----------
    converged : bool
        False: the nonlinear equations were not solved; the step counts for nothing.
    error : float
        Estimated error relative to the tolerance; the step is kept if it is at most 1.
    q, v : ndarray, shape (n,)
        State at the end of the step.
    series : ndarray
        For `Segment`.
    growth : float
        By how much the method would like to change the step.
    """

    converged: bool
    error: float = 0.0
    q: Array | None = None
    v: Array | None = None
    series: Array | None = None
    growth: float = 1.0


class Method(Protocol):
    """One-step view of an integrator; what it remembers between steps is its own."""

    adaptive: bool

    def start(self, problem: Problem, t: float, q: Array, v: Array) -> float:
        """Take the initial state; return a first step to try."""

    def attempt(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        """Try a step of length h."""

    def accept(self, t: float, q: Array, v: Array) -> None:
        """Take note that the step was kept and, after projection, ended in this state."""


@dataclass
class Trajectory:
    """All kept steps of a run, readable at any time."""

    segments: list[Segment] = field(default_factory=list)
    t_end: float = 0.0

    def at(self, times: Array) -> tuple[Array, Array]:
        """Return (q, v) at sorted times, shape (n_times, n) each."""
        starts = np.array([s.t for s in self.segments])
        owner = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, len(starts) - 1)
        n = len(self.segments[0].q)
        q, v = np.empty((len(times), n)), np.empty((len(times), n))
        for k in np.unique(owner):
            mine = owner == k
            q[mine], v[mine] = self.segments[k].at(times[mine])
        return q, v
