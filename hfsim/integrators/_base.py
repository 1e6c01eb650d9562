"""What integrators see and give: functions of (t, q, v), and steps with a polynomial inside.

The loop around the steps is shared (`integrate`); a method makes one step at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

import numpy as np

from hfsim.errors import HfsimError, LimitReached, SolverFailure
from hfsim.integrators._tableau import legendre
from hfsim.maths.arrays import Array, IntArray, distinct
from hfsim.maths.shapes import gauss_legendre
from hfsim.mechanics.linearized import Linearized


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

    def add(self, other: Counts) -> None:
        """Add what another run cost."""
        for name, value in vars(other).items():
            setattr(self, name, getattr(self, name) + value)


class Increments(Protocol):
    """Coordinates for Newton corrections in which the derivative of the accelerations changes little.

    ``geometry`` gives what the other maps need of a batch of states; all arrays are (n_batch, n).
    """

    def geometry(self, q: Array) -> Any:
        """Return what belongs to these states."""

    def to_natural(self, at: Any, dq: Array) -> Array:
        """Return small changes of the states in natural coordinates."""

    def from_natural(self, at: Any, y: Array) -> Array:
        """Return small natural increments as changes of the states."""

    def to_natural_forces(self, at: Any, f: Array) -> Array:
        """Return forces on the states as forces on natural increments."""

    def advance(self, at: Any, y: Array) -> Array:
        """Return finite natural increments as changes of the states."""

    def rates(self, at: Any, v: Array, a: Array) -> tuple[Array, Array, Array]:
        """Return the first and second time derivatives of the natural coordinates.

        Third comes the part of the second ones that velocities alone cause.
        """


@dataclass(frozen=True)
class PlainIncrements:
    """The state coordinates themselves."""

    def geometry(self, q: Array) -> None:
        """Return nothing."""

    def to_natural(self, at: None, dq: Array) -> Array:
        """Return ``dq``."""
        return dq

    def from_natural(self, at: None, y: Array) -> Array:
        """Return ``y``."""
        return y

    advance = from_natural

    def to_natural_forces(self, at: None, f: Array) -> Array:
        """Return ``f``."""
        return f

    def rates(self, at: None, v: Array, a: Array) -> tuple[Array, Array, Array]:
        """Return ``v``, ``a`` and zero."""
        return v, a, np.zeros_like(a)


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
    admissible : callable
        q, shape (n,) -> whether the equations make sense there; no step ends where they do not.
    breakdown : callable
        (t, q) -> the failure that explains why steps get ever shorter near this state, or None.
    linearized : callable or None
        (t, q, v) -> the equations linearised at a state; without it derivatives come from differences.
    culprit : callable
        (t, q, v) -> the failure that names what is not finite in this state, or None.
    increments : Increments
        Coordinates for Newton corrections.
    imbalance : callable or None
        (t, q, v, a) -> the forces (n_batch, n) and joint accelerations (n_batch, n_rows) by which
        accelerations fail the equations of motion.
    constant_mass : bool
        Whether the state are coordinates with a constant mass matrix.
    quartic : bool
        Whether, besides, joints are linear in them and the potential is a polynomial of degree four at most.
    """

    acceleration: Callable[[Array, Array, Array], Array]
    project: Callable[[Array, Array, Array], tuple[Array, Array]]
    dissipates: bool
    admissible: Callable[[Array], bool] = lambda q: True
    breakdown: Callable[[float, Array], SolverFailure | None] = lambda t, q: None
    linearized: Callable[[float, Array, Array], Linearized] | None = None
    culprit: Callable[[float, Array, Array], SolverFailure | None] = lambda t, q, v: None
    increments: Increments = field(default_factory=PlainIncrements)
    imbalance: Callable[[Array, Array, Array, Array], tuple[Array, Array]] | None = None
    constant_mass: bool = True
    quartic: bool = False
    counts: Counts = field(default_factory=Counts)

    def evaluate(self, t: Array, q: Array, v: Array) -> Array:
        """Return accelerations of a batch and count the call."""
        self._count(q)
        return np.asarray(self.acceleration(t, q, v))

    def unbalanced(self, t: Array, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """Return by how much accelerations of a batch fail the equations and count the call."""
        assert self.imbalance is not None
        self._count(q)
        return self.imbalance(t, q, v, a)

    def _count(self, q: Array) -> None:
        self.counts.calls += 1
        self.counts.evaluations += len(q)

    def single(self, t: float, q: Array, v: Array) -> Array:
        """Return the accelerations of one state, shape (n,)."""
        return np.asarray(self.evaluate(np.array([t]), q[None], v[None])[0])

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


class Segment(NamedTuple):
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


class Attempt(NamedTuple):
    """The outcome of trying one step.

    Attributes
    ----------
    error : float
        Estimated local error relative to the tolerance; with a free step length the step is kept
        if it is at most 1.  Infinite where the nonlinear equations were not solved.
    growth : float
        Factor by which the method would change the step.
    q, v : ndarray, shape (n,)
        State at the end of the step.
    series : ndarray, shape (m, n)
        For `Segment`.
    """

    error: float
    growth: float
    q: Array
    v: Array
    series: Array

    @property
    def solved(self) -> bool:
        """Whether the equations of the step were solved."""
        return bool(np.isfinite(self.error))


def unsolved(growth: float = 0.5) -> Attempt:
    """Return the outcome of a step whose equations could not be solved."""
    nothing = np.zeros(0)
    return Attempt(np.inf, growth, nothing, nothing, nothing)


class Method(Protocol):
    """One-step view of an integrator; what it remembers between steps is its own."""

    name: str

    def start(self, problem: Problem, t: float, q: Array, v: Array) -> float:
        """Take the initial state; return a first step length to try."""

    def attempt(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        """Try a step of length h."""

    def accept(self, t: float, q: Array, v: Array) -> None:
        """Take note that the step was kept and, after projection, ended in this state."""


@dataclass
class Trajectory:
    """All kept steps of a run, readable at any time between its start and its end."""

    t_start: float
    t_end: float
    q: Array
    v: Array
    """State at ``t_end``."""
    segments: list[Segment] = field(default_factory=list)

    def at(self, times: Array) -> tuple[Array, Array]:
        """Return (q, v) at sorted times, shape (n_times, n) each."""
        if not self.segments:
            return np.repeat(self.q[None], len(times), 0), np.repeat(self.v[None], len(times), 0)
        starts = np.array([s.t for s in self.segments])
        owner = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, len(starts) - 1)
        q, v = np.empty((len(times), len(self.q))), np.empty((len(times), len(self.q)))
        edges = np.searchsorted(owner, np.arange(len(starts) + 1))
        for k in distinct(owner):
            mine = slice(edges[k], edges[k + 1])
            q[mine], v[mine] = self.segments[k].at(times[mine])
        return q, v

    def step_ends(self) -> Array:
        """Return all step boundaries, the start and the end included."""
        return np.array([s.t for s in self.segments] + [self.t_end])


def joined(paths: list[tuple[Trajectory, IntArray]], t_end: float) -> Trajectory:
    """Return one trajectory of parts that were integrated apart, up to a time that all have reached.

    Its steps end wherever one of any part does; within them the parts' polynomials are the same.

    Parameters
    ----------
    paths : list of (Trajectory, ndarray of int)
        Each part with the columns that its state has in the whole.
    t_end : float
    """
    n = sum(len(columns) for _, columns in paths)
    ends = distinct(np.concatenate([path.step_ends() for path, _ in paths]))
    ends = np.append(ends[ends < t_end], t_end)
    q, v = np.empty((len(ends), n)), np.empty((len(ends), n))
    count = max((len(s.series) for path, _ in paths for s in path.segments), default=1)
    series = np.zeros((len(ends) - 1, count, n))
    for path, columns in paths:
        q[:, columns], v[:, columns] = path.at(ends)
        if path.t_end == t_end:
            q[-1, columns], v[-1, columns] = path.q, path.v
        series[:, :, columns] = _cut(path.segments, ends, count)
    steps = [Segment(a, b - a, q[k], v[k], series[k]) for k, (a, b) in enumerate(pairwise(map(float, ends)))]
    return Trajectory(paths[0][0].t_start, float(t_end), q[-1], v[-1], steps)


def _cut(segments: list[Segment], ends: Array, count: int) -> Array:
    """Return the series of steps over the stretches between ``ends``, shape (n_stretches, count, n)."""
    places, weights = gauss_legendre(count)
    basis, _, _ = legendre(places, count)
    fit = (2.0 * np.arange(count) + 1.0)[:, None] * basis.T * weights
    inside = ends[:-1, None] + np.diff(ends)[:, None] * places
    starts = np.array([step.t for step in segments])
    owner = np.clip(np.searchsorted(starts, ends[:-1], side="right") - 1, 0, len(starts) - 1)
    out = np.zeros((len(inside), count, segments[0].series.shape[1]))
    for k in distinct(owner):
        mine, step = np.flatnonzero(owner == k), segments[k]
        if len(mine) == 1 and ends[mine[0]] == step.t:
            out[mine[0], : len(step.series)] = step.series
            continue
        values, _, _ = legendre((inside[mine].ravel() - step.t) / step.h, len(step.series))
        out[mine] = fit @ (values @ step.series).reshape(len(mine), count, -1)
    return out


class Limits(NamedTuple):
    """When a run ends early.

    Attributes
    ----------
    step : float or None
        Fixed step length [s].
    max_steps : int or None
    short, shortest : float
        Step lengths, relative to the duration: below the first a known cause ends the run, below the
        second the run has failed whatever the cause.
    """

    step: float | None = None
    max_steps: int | None = None
    short: float = 1e-6
    shortest: float = 1e-11


WINDOW = 1000
"""Attempted steps after which the pace is looked at."""
HOPELESS = 1e7
"""Attempted steps still to come, at the pace of two windows, from which a run ends."""
GAINING = 1.2
"""Progress over that of the window before from which steps are growing, and the run is left alone."""
IN_A_ROW = 3
"""Unsolved steps one after another from which it is looked whether something is not finite."""
AHEAD = 1e-4
"""Length of a step, relative to the duration, up to which what lies at its end is to blame."""


@dataclass
class _Pace:
    """Ends a run that crawls: two windows in a row at whose pace the end is out of reach.

    Steps that are short at first and grow, as in a stiff start, gain in each window and are left alone.
    """

    t: float
    t_end: float
    attempts: int = 0
    rejected: int = 0
    unsolved: int = 0
    before: float | None = None
    """Progress of the window before, if that was hopeless too."""

    def note(self, t: float, rejected: bool, unsolved: bool) -> None:
        """Count one attempt that ended at t.

        Raises
        ------
        SolverFailure
            If the run crawls.
        """
        self.attempts += 1
        self.rejected += rejected
        self.unsolved = self.unsolved + 1 if unsolved else 0
        if self.attempts % WINDOW:
            return
        progress, self.t = t - self.t, t
        share, self.rejected = self.rejected / WINDOW, 0
        left = (self.t_end - t) / progress * WINDOW if progress > 0.0 else np.inf
        if left <= HOPELESS:
            self.before = None
        elif self.before is None or progress > GAINING * self.before:
            self.before = progress
        else:
            raise _crawl(t, progress, share)


def _crawl(t: float, progress: float, rejected: float) -> SolverFailure:
    return SolverFailure(
        f"the steps crawl: the last {WINDOW} of them, {100.0 * rejected:.0f} % rejected, gained "
        f"{progress:.2g} s; at this pace more than {HOPELESS:.0e} would follow",
        t,
        evidence={"progress": progress, "rejected_share": rejected},
    )


def integrate(
    problem: Problem,
    method: Method,
    start: tuple[float, Array, Array],
    t_end: float,
    limits: Limits,
    watch: Callable[[float, Array, Array], None],
) -> tuple[Trajectory, HfsimError | KeyboardInterrupt | None]:
    """Make steps until ``t_end``.

    Parameters
    ----------
    problem : Problem
    method : Method
    start : (t, q, v)
    t_end : float
    limits : Limits
    watch : callable
        Called with every kept state; may raise to end the run.

    Returns
    -------
    trajectory : Trajectory
        All kept steps, also those before a failure.
    stop : exception or None
        What ended the run before ``t_end``: `SolverFailure`, `LimitReached` or KeyboardInterrupt.
    """
    t, q, v = start
    trajectory = Trajectory(t, t, q, v)
    try:
        with np.errstate(all="ignore"):
            for segment, end in _steps(problem, method, start, t_end, limits):
                trajectory.segments.append(segment)
                trajectory.t_end, trajectory.q, trajectory.v = end
                watch(*end)
    except (SolverFailure, LimitReached, KeyboardInterrupt) as stop:
        return trajectory, stop
    return trajectory, None


def _steps(
    problem: Problem, method: Method, start: tuple[float, Array, Array], t_end: float, limits: Limits
) -> Iterator[tuple[Segment, tuple[float, Array, Array]]]:
    """Yield each kept step and the projected state at its end."""
    t, q, v = start
    duration = t_end - t
    wish = _first_step(problem, method, t, q, v)
    pace = _Pace(t, t_end)
    while t < t_end * (1.0 - 1e-14):
        if limits.max_steps is not None and problem.counts.steps >= limits.max_steps:
            raise LimitReached(f"{limits.max_steps} steps were made", t)
        h = _fitted(limits.step or wish, t_end - t, limits.step is not None)
        attempt = _attempt(problem, method, t, q, v, h)
        if not attempt.solved and limits.step is not None:
            why = f"the equations of a step of {h:g} s could not be solved"
            raise _not_finite(problem, t, q, v, h) or problem.breakdown(t, q) or SolverFailure(why, t)
        if not attempt.solved or (limits.step is None and attempt.error > 1.0):
            problem.counts.rejected += 1
            pace.note(t, True, not attempt.solved)
            if pace.unsolved >= IN_A_ROW and (h < AHEAD * duration or pace.unsolved == IN_A_ROW):
                ahead = h if h < AHEAD * duration else 0.0
                cause = _not_finite(problem, t, q, v, ahead)
                if cause is not None:
                    raise cause
            wish = h * min(max(attempt.growth, 0.1), 0.9)
            _refuse_collapse(problem, limits, wish / duration, t, q)
            continue
        segment = Segment(t, h, q, v, attempt.series)
        t = t_end if h == t_end - t else t + h
        q, v = attempt.q, attempt.v
        method.accept(t, q, v)
        problem.counts.steps += 1
        if limits.step is None:
            pace.note(t, False, False)
        wish = h * min(max(attempt.growth, 0.2), 5.0) if h >= 0.5 * wish else wish
        yield segment, (t, q, v)


def _first_step(problem: Problem, method: Method, t: float, q: Array, v: Array) -> float:
    try:
        wish = method.start(problem, t, q, v)
    except np.linalg.LinAlgError:
        wish = np.nan
    if not np.isfinite(wish):
        why = "the accelerations at the start are not finite"
        raise problem.culprit(t, q, v) or SolverFailure(why, t)
    return wish


def _not_finite(problem: Problem, t: float, q: Array, v: Array, h: float) -> SolverFailure | None:
    """Return what is not finite where a step that could not be solved begins, or just ahead of it."""
    return problem.culprit(t, q, v) or problem.culprit(t + h, q + h * v, v)


def _fitted(wish: float, rest: float, fixed: bool) -> float:
    """Return the next step length: the wish, shortened so that the end is met without a sliver."""
    if rest <= wish * (1.0 + 1e-9):
        return rest
    return 0.5 * rest if not fixed and rest < 2.0 * wish else wish


def _refuse_collapse(problem: Problem, limits: Limits, relative: float, t: float, q: Array) -> None:
    """Raise the cause when steps have become too short to go on."""
    if relative > limits.short:
        return
    cause = problem.breakdown(t, q)
    if cause is not None:
        raise cause
    if relative < limits.shortest:
        raise SolverFailure(f"the step length fell below {limits.shortest:g} of the duration", t)


def _attempt(problem: Problem, method: Method, t: float, q: Array, v: Array, h: float) -> Attempt:
    """Try a step and move its end onto the constraints."""
    try:
        attempt = method.attempt(t, q, v, h)
        if not attempt.solved:
            return attempt if np.isfinite(attempt.growth) else unsolved()
        finite = np.isfinite(attempt.q).all() and np.isfinite(attempt.v).all()
        if not finite or not problem.admissible(attempt.q):
            return unsolved()
        end, rate = problem.project(np.array([t + h]), attempt.q[None], attempt.v[None])
        return attempt._replace(q=end[0], v=rate[0])
    except np.linalg.LinAlgError:
        return unsolved()
