"""What one run is worth: held against references and put into a class.

Two errors are told apart.  The *time error* is the distance to the same model solved by Gauss
collocation at a tight tolerance: what the method and its step do.  The *model error* is the distance of
that solution to the one of `exact`: what the model leaves out.  Both are the largest over time in the
worst channel, relative to the channel's scale (`hfsim.studies.compare`).

Whether the scene itself is unstable is asked of `exact`: it is solved a second time with a start
disturbed by next to nothing, and the distance of the two solutions tells.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from hfsim.arrays import Array
from hfsim.balance import balance, step_samples
from hfsim.build import Scene, build
from hfsim.channels import Samples
from hfsim.deck import SolveSpec, parse_deck
from hfsim.errors import DeckError, SolverFailure
from hfsim.integration import Integration, run_integration
from hfsim.simulate import compute_channels, sample
from hfsim.solution import Channel
from hfsim.studies.bench import Budget, OutOfBudgetError, channel_error, judged_scales
from hfsim.studies.compare import ChannelScale

CLASSES = {
    "accurate": "completed; errors and energy drift within the bounds",
    "wrong": "completed, but an error or the energy drift is beyond its bound",
    "unstable": "failed numerically: the same model goes through with gauss at a tight tolerance",
    "broken": "the model broke down where exact goes through",
    "physical": "the scene itself is unstable: a tiny disturbance grows, with exact and tight tolerance too",
    "no result": "no answer: time limit, crash, refused deck or no reference",
    "not computed": "the budget was used up before",
}
"""Classes of points, in words."""

TRUTH_MODEL = "exact"
"""Model that counts as the truth."""
GROWTH = 30.0
"""Factor by which a tiny disturbance grows while the time doubles, from which a scene is unstable: growth
that is no more than a power of time (drifting apart at constant speed: 2) stays far below."""
KICK = 1e2
"""Size of that disturbance over the tolerance it is solved with, relative to the largest speed of the motion:
what grows must not be the error of the integration."""
_MOST_KICK = 1e-4
_SWINGS = 50.0
"""Radians within the duration above which a mode counts as fast for the disturbance."""
WINDOWS = 8
"""Parts of the duration in each of which the largest distance is looked at."""
REFUSED = "the deck is refused: "


@dataclass(frozen=True)
class Bounds:
    """What still counts as accurate.

    Attributes
    ----------
    error : float
        Largest time error and largest model error [-].
    drift : float
        Largest energy drift [-].
    """

    error: float = 1e-2
    drift: float = 1e-3


@dataclass(frozen=True)
class Job:
    """One model of one scene to be solved.

    Attributes
    ----------
    text, file : str
        The deck as written.
    overrides : tuple of str
    model : str
    limit : float
        Wall time it may take [s].
    tolerance : float
        Of a reference, at most a tenth of the deck's [-].
    method : str
        Of a point; empty for a reference.
    disturbed : bool
        Whether a reference is solved a second time to see whether the scene is unstable.
    truth : Truth or None
        For a point: the reference of its model.
    """

    text: str
    file: str
    overrides: tuple[str, ...]
    model: str
    limit: float
    tolerance: float = 1e-8
    method: str = ""
    disturbed: bool = False
    truth: Truth | None = None


@dataclass(frozen=True)
class Truth:
    """A reference, or why there is none.

    Attributes
    ----------
    status : str
        ``done``, ``failed`` or ``lost`` (time limit, crash, refused deck).
    kind, reason : str
        Of a failure: ``model`` or ``numerical``; in words.
    end : float
        Where it ended [s].
    channels : tuple of Channel
    scales : tuple of ChannelScale
    growth : float or None
        Factor by which a tiny disturbance grows while the time doubles, at most; None if not asked for.
    """

    status: str
    kind: str = ""
    reason: str = ""
    end: float = 0.0
    channels: tuple[Channel, ...] = ()
    scales: tuple[ChannelScale, ...] = ()
    growth: float | None = None


@dataclass(frozen=True)
class Trial:
    """What came of one point before it is put into a class.

    Attributes
    ----------
    status : str
        ``done``, ``failed``, ``limit`` or ``lost``.
    kind, reason : str
        As in `Truth`.
    end : float
        Where it ended [s].
    error : float or None
        Time error [-], with `channel`, the worst one.
    drift : float or None
        Energy drift [-].
    steps : int
    cpu : float
        CPU time of the integration [s].
    channels : tuple of Channel
    times : ndarray or None
        The output and its times [s].
    """

    status: str
    kind: str = ""
    reason: str = ""
    end: float = 0.0
    error: float | None = None
    channel: str = ""
    drift: float | None = None
    steps: int = 0
    cpu: float = 0.0
    channels: tuple[Channel, ...] = field(default=(), repr=False)
    times: Array | None = field(default=None, repr=False)


@dataclass(frozen=True)
class Verdict:
    """The class of a point and what it rests on.

    Attributes
    ----------
    outcome : str
        A key of `CLASSES`.
    reason : str
    time_error, model_error, energy_drift, growth : float or None
        Measured values [-]; None where there is none.
    channel : str
        The channel with the larger of the two errors.
    """

    outcome: str
    reason: str = ""
    time_error: float | None = None
    model_error: float | None = None
    energy_drift: float | None = None
    growth: float | None = None
    channel: str = ""

    def facts(self) -> dict[str, Any]:
        """Return it as plain data."""
        return asdict(self)


# --- solving, in a worker process -----------------------------------------------------------------


def solve_reference(job: Job) -> Truth:
    """Solve a model tightly, by the first of a few ways (`_ways`) that reaches the end."""
    try:
        scene = build(parse_deck(job.text, job.file, job.overrides), job.model)
    except DeckError as problem:
        return Truth("lost", reason=REFUSED + problem.problems[0].message)
    budget = Budget(job.limit)
    first: Integration | None = None
    try:
        for solve in _ways(scene, min(job.tolerance, 0.1 * scene.deck.solve.tolerance)):
            done = run_integration(scene, solve, budget.guard(budget.left))
            first = first or done
            if done.stop is None:
                break
    except OutOfBudgetError as stop:
        if first is None:
            return Truth("lost", reason=f"the reference was {stop} after {job.limit:.3g} s")
        done = first
    return _truth_of(scene, done if done.stop is None else first or done, solve, job.disturbed, budget)


def _ways(scene: Scene, tolerance: float) -> Iterator[SolveSpec]:
    """Yield ways to solve a scene tightly; the last is looser, for round-off may forbid the first two."""
    for method, factor in (("gauss", 1.0), ("radau", 1.0), ("gauss", 1e3)):
        update = {"method": method, "tolerance": min(factor * tolerance, 1e-6), "step": None}
        yield scene.deck.solve.model_copy(update={**update, "stages": None, "max_steps": None})


def _truth_of(scene: Scene, done: Integration, solve: SolveSpec, disturbed: bool, budget: Budget) -> Truth:
    samples, end = sample(scene, done.trajectory), done.trajectory.t_end
    growth = _disturbance_growth(scene, done, solve, samples, budget) if disturbed else None
    if done.stop is not None:
        return Truth("failed", _kind(done), str(done.stop), end, growth=growth)
    channels = compute_channels(samples)
    if not all(np.isfinite(channel.values).all() for channel in channels):
        return Truth("failed", "numerical", "the reference is not finite", end, growth=growth)
    return Truth("done", "", "", end, channels, judged_scales(samples, channels), growth)


def _kind(done: Integration) -> str:
    return done.stop.kind if isinstance(done.stop, SolverFailure) else "numerical"


def _slow_direction(scene: Scene, done: Integration) -> Array:
    """Return velocities of size one in which modes that swing often within the duration hardly take part.

    Instabilities grow in slow modes; fast ones would only make the disturbed run expensive.
    """
    random = np.random.default_rng(1).standard_normal(scene.system.n)
    by_q, _ = done.problem.jacobians(0.0, scene.q, scene.v)
    slow = scene.deck.solve.duration / _SWINGS
    direction = np.linalg.lstsq(np.eye(len(random)) - slow**2 * by_q, random, rcond=None)[0]
    return np.asarray(direction / max(float(np.abs(direction).max()), 1e-300))


def _disturbance_growth(
    scene: Scene, done: Integration, solve: SolveSpec, samples: Samples, budget: Budget
) -> float | None:
    """Solve again from a disturbed start and return the growth of the distance; None without time for it."""
    system = scene.system
    speed = float(np.abs(system.absolute_velocity(samples.q, samples.v)).max(initial=0.0))
    if speed == 0.0:
        speed = 1.0
    kick = min(KICK * solve.tolerance, _MOST_KICK) * speed * _slow_direction(scene, done)
    q, v = system.project(np.zeros(1), scene.q[None], scene.v[None] + kick)
    other = replace(scene, q=q[0], v=v[0])
    try:
        again = run_integration(other, solve, budget.guard(max(budget.left, 0.0)))
    except OutOfBudgetError:
        return None
    disturbed = sample(other, again.trajectory)
    n = min(len(disturbed.t), len(samples.t))
    distance = np.abs(system.absolute(disturbed.q[:n]) - system.absolute(samples.q[:n])).max(axis=1)
    return growth_of(distance)


def growth_of(distance: Array) -> float:
    """Return the largest factor by which a distance grows while the time doubles.

    Parameters
    ----------
    distance : ndarray, shape (n,)
        At evenly spaced times, the first one the start.

    Examples
    --------
    >>> t = np.linspace(0.0, 8.0, 801)
    >>> round(growth_of(t), 3), round(growth_of(np.exp(t) - 1.0))
    (2.0, 56)
    """
    if len(distance) <= WINDOWS:
        return 1.0
    most = np.maximum.accumulate(distance)
    reached = most[np.linspace(0, len(distance) - 1, WINDOWS + 1).astype(int)]
    pairs = [(reached[k], reached[2 * k]) for k in range(1, WINDOWS // 2 + 1)]
    return float(max((late / early for early, late in pairs if early > 0.0), default=1.0))


def solve_point(job: Job) -> Trial:
    """Solve one point as its deck says, with the method of the job."""
    overrides = (*job.overrides, f"solve.method={job.method}")
    try:
        deck = parse_deck(job.text, job.file, job.overrides).deck
        scene = build(parse_deck(job.text, job.file, overrides), job.model)
    except DeckError as problem:
        return Trial("lost", reason=REFUSED + problem.problems[0].message)
    solve = scene.deck.solve
    if job.method != deck.solve.method:
        solve = solve.model_copy(update={"stages": None, "order": None})
    start = time.process_time()
    try:
        done = run_integration(scene, solve, Budget(job.limit).guard(job.limit))
    except OutOfBudgetError as stop:
        return Trial("lost", reason=f"{stop} after {job.limit:.3g} s", cpu=time.process_time() - start)
    cpu, counts = time.process_time() - start, done.problem.counts
    end = done.trajectory.t_end
    if done.stop is not None:
        status = "limit" if done.stop.exit_code == 5 else "failed"  # type: ignore[union-attr]
        return Trial(status, _kind(done), str(done.stop), end, steps=counts.steps, cpu=cpu)
    samples = sample(scene, done.trajectory)
    drift = float(balance(scene.system, step_samples(done.trajectory))["energy_drift"])
    channels = compute_channels(samples)
    if not (np.isfinite(drift) and all(np.isfinite(channel.values).all() for channel in channels)):
        return Trial("failed", "numerical", "the result is not finite", end, steps=counts.steps, cpu=cpu)
    error, worst = (
        (None, "") if job.truth is None else distance(channels, job.truth.channels, job.truth.scales)
    )
    return Trial("done", "", "", end, error, worst, drift, counts.steps, cpu, channels, samples.t)


def distance(
    channels: tuple[Channel, ...], truth: tuple[Channel, ...], scales: tuple[ChannelScale, ...]
) -> tuple[float | None, str]:
    """Return the largest relative difference of all judged channels, and in which; None without any."""
    true = {channel.name: channel.values for channel in truth}
    scale = {one.channel: one for one in scales if one.judged}
    errors = {
        c.name: channel_error(c.values, true[c.name], scale[c.name], 0.0).max_relative
        for c in channels
        if c.name in scale and len(true[c.name]) == len(c.values)
    }
    if not errors:
        return None, ""
    worst = max(errors, key=lambda name: errors[name])
    return errors[worst], worst


# --- classes -------------------------------------------------------------------------------------


def classify(trial: Trial, truth: Truth, exact: Truth, bounds: Bounds) -> Verdict:
    """Put a point into a class.

    Parameters
    ----------
    trial : Trial
        The point.
    truth : Truth
        The reference of its model.
    exact : Truth
        The reference of `exact` with the disturbed run.
    bounds : Bounds

    Returns
    -------
    Verdict
    """
    if trial.status == "failed":
        return _failed(trial, truth, exact)
    if trial.status != "done":
        return Verdict("no result", trial.reason)
    return _completed(trial, truth, exact, bounds)


def _failed(trial: Trial, truth: Truth, exact: Truth) -> Verdict:
    facts: Mapping[str, Any] = {"energy_drift": trial.drift, "growth": exact.growth}
    at = f"{trial.reason} (t = {trial.end:.4g} s)"
    if truth.status == "done":
        return Verdict("unstable", f"{at}; gauss at a tight tolerance goes through", **facts)
    if truth.status == "failed" and exact.status == "done":
        return Verdict("broken", f"{truth.reason}; {TRUTH_MODEL} goes through", **facts)
    if truth.status == "failed" and exact.status == "failed":
        found = "physical" if (exact.growth or 0.0) > GROWTH else "unstable"
        return Verdict(found, f"{at}; {TRUTH_MODEL} at a tight tolerance fails as well", **facts)
    if trial.kind == "model":
        return Verdict("broken", at, **facts)
    return Verdict("no result", f"{at}; {_missing(truth, exact)}", **facts)


def _missing(truth: Truth, exact: Truth) -> str:
    lost = truth if truth.status == "lost" else exact
    return f"nothing to judge by: {lost.reason}"


def _completed(trial: Trial, truth: Truth, exact: Truth, bounds: Bounds) -> Verdict:
    if truth.status == "failed":
        where = f"the reference of this model ends at {truth.end:.4g} s: {truth.reason}"
        return Verdict("wrong", where, energy_drift=trial.drift, growth=exact.growth)
    model_error, channel = _model_error(truth, exact)
    facts: Mapping[str, Any] = {
        "time_error": trial.error,
        "model_error": model_error,
        "energy_drift": trial.drift,
        "growth": exact.growth,
        "channel": trial.channel if (trial.error or 0.0) >= (model_error or 0.0) else channel,
    }
    if truth.status == "lost" or exact.status == "lost":
        return Verdict("no result", _missing(truth, exact), **facts)
    beyond = _beyond(trial, model_error, bounds)
    unstable = exact.status == "failed" or (exact.growth or 0.0) > GROWTH
    if unstable and (trial.drift or 0.0) <= bounds.drift:
        how = (
            "exact fails as well" if exact.growth is None else f"a disturbance grows {exact.growth:.3g}-fold"
        )
        return Verdict("physical", f"{how} while the time doubles{'; ' + beyond if beyond else ''}", **facts)
    return Verdict("wrong" if beyond else "accurate", beyond, **facts)


def _model_error(truth: Truth, exact: Truth) -> tuple[float | None, str]:
    if truth is exact:
        return 0.0, ""
    if truth.status != "done" or exact.status != "done":
        return None, ""
    return distance(truth.channels, exact.channels, exact.scales)


def _beyond(trial: Trial, model_error: float | None, bounds: Bounds) -> str:
    """Return which bounds are passed, in words."""
    found = []
    if model_error is not None and model_error > bounds.error:
        found.append(f"model error {model_error:.2g}")
    if trial.error is not None and trial.error > bounds.error:
        found.append(f"time error {trial.error:.2g}")
    if trial.drift is not None and trial.drift > bounds.drift:
        found.append(f"energy drift {trial.drift:.2g}")
    return ", ".join(found)
