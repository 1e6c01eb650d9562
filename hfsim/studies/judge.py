"""What one run is worth: held against references and put into a class.

Two errors are told apart.  The *time error* is the distance to the same model solved by Gauss
collocation at a tight tolerance: what the method and its step do.  The *model error* is the distance of
that solution to the one of `exact`: what the model leaves out.  Both are the largest over time in the
worst channel, relative to the channel's scale (`hfsim.studies.compare`).

Whether the scene itself is unstable is asked of `exact`: it is solved a second time with a start
disturbed by next to nothing, and the distance of the two solutions tells (`hfsim.trust.growth`).  Where
references fail too, the experiments of `hfsim.trust.diagnosis` say why, in the same classes.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from hfsim.errors import DeckError, SolverFailure
from hfsim.maths.arrays import Array
from hfsim.parts.channels import Samples
from hfsim.run.balance import balance, step_samples
from hfsim.run.distance import ChannelScale, farthest, gap, reference_scales
from hfsim.run.integration import Integration, run_integration
from hfsim.run.solution import Channel
from hfsim.run.stop import Budget, TimeUp
from hfsim.scene.build import Scene, build
from hfsim.scene.loading import parse_deck
from hfsim.scene.schema import SolveSpec
from hfsim.simulate import compute_channels, sample, validity
from hfsim.trust.diagnosis import diagnose
from hfsim.trust.experiments import time_for
from hfsim.trust.growth import Growth, disturbed_growth
from hfsim.trust.suspicion import instability, suspect

CLASSES = {
    "accurate": "completed; errors and energy drift within the bounds",
    "wrong": "completed, but an error or the energy drift is beyond its bound",
    "numerical": "failed, and the same model goes through with gauss at a tight tolerance",
    "model": "the model failed, and exact goes through",
    "physical": "the scene itself fails or is unstable: a tiny disturbance grows, whatever method and model",
    "deck": "the numbers or joints of the deck make it: refused, not finite, redundant, without mass",
    "no result": "no answer: time limit, crash or no reference",
    "not computed": "the budget was used up before",
}
"""Classes of points, in words."""

TRUTH_MODEL = "exact"
"""Model that counts as the truth."""
_STAGES = {"gauss": 14, "radau": 9}
"""Stages of references: those of no default, so that even where a run and its reference take the same few
steps, two discretisations are compared."""
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
    diagnosed : bool
        Whether a point that completes is looked at for what makes it suspicious, as `hfsim run` does.
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
    diagnosed: bool = False


@dataclass(frozen=True)
class Truth:
    """A reference, or why there is none.

    Attributes
    ----------
    status : str
        ``done``, ``failed`` or ``lost`` (time limit, crash, refused deck).
    kind, item, reason : str
        Class, deck path and words of what made it fail, or of what makes the scene unstable.
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
    item: str = ""
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
    kind, item, reason : str
        As in `Truth`; of a failure or a suspicion. No class where experiments have not decided.
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
    item: str = ""
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
    cause : str
        ``numerical``, ``model``, ``physical`` or ``deck``: what makes a point not accurate, or one that is
        suspicious; else empty.
    item : str
        Deck path of what is to blame, where that is known.
    time_error, model_error, energy_drift, growth : float or None
        Measured values [-]; None where there is none.
    channel : str
        The channel with the larger of the two errors.
    """

    outcome: str
    reason: str = ""
    cause: str = ""
    item: str = ""
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
            done = run_integration(scene, solve, budget.guard()).in_time()
            first = first or done
            if done.stop is None:
                break
    except TimeUp as stop:
        if first is None:
            return Truth("lost", reason=f"the reference was {stop} after {job.limit:.3g} s")
        done = first
    return _truth_of(scene, done if done.stop is None else first or done, solve, job.disturbed, budget)


def _ways(scene: Scene, tolerance: float) -> Iterator[SolveSpec]:
    """Yield ways to solve a scene tightly; the last is looser, for round-off may forbid the first two."""
    for method, factor in (("gauss", 1.0), ("radau", 1.0), ("gauss", 1e3)):
        update = {"method": method, "tolerance": min(factor * tolerance, 1e-6), "step": None}
        update |= {"stages": _STAGES[method], "max_steps": None}
        yield scene.deck.solve.model_copy(update=update)


def _truth_of(scene: Scene, done: Integration, solve: SolveSpec, disturbed: bool, budget: Budget) -> Truth:
    samples, end = sample(scene, done.trajectory), done.trajectory.t_end
    growth = _growth(scene, done, solve, budget) if disturbed else None
    factor = growth.factor if growth else None
    if done.stop is not None:
        as_solved = replace(scene, loaded=scene.loaded.with_solve(solve.model_dump()))
        kind, item, reason = _why(as_solved, done, budget.left)
        return Truth("failed", kind, reason, end, item, growth=factor)
    channels = compute_channels(samples)
    if not all(np.isfinite(channel.values).all() for channel in channels):
        return Truth("failed", "numerical", "the reference is not finite", end, growth=factor)
    found = instability(scene, growth) if growth and growth.unstable else None
    kind, item, reason = (found.kind, found.item, found.reason) if found else ("", "", "")
    return Truth("done", kind, reason, end, item, channels, reference_scales(samples, channels), factor)


def _why(scene: Scene, done: Integration, seconds: float) -> tuple[str, str, str]:
    """Return class, item and reason of a failure; no class if experiments have not decided."""
    if not isinstance(done.stop, SolverFailure):
        return "", "", str(done.stop)
    found = diagnose(scene, done, min(time_for(0.0), max(seconds, 0.0)))
    kind = "" if "undecided" in found.evidence else found.kind
    return kind, found.item, found.reason


def _growth(scene: Scene, done: Integration, solve: SolveSpec, budget: Budget) -> Growth | None:
    """Return how a disturbance of the start grows; None without time for it."""
    return disturbed_growth(scene, done, solve, budget.guard())


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
        scene = replace(scene, loaded=scene.loaded.with_solve(solve.model_dump()))
    start, budget = time.process_time(), Budget(job.limit)
    try:
        done = run_integration(scene, solve, budget.guard()).in_time()
    except TimeUp as stop:
        return Trial("lost", reason=f"{stop} after {job.limit:.3g} s", cpu=time.process_time() - start)
    cpu, steps = time.process_time() - start, done.problem.counts.steps
    judge = _tried if done.stop is None else _stopped
    return replace(judge(job, scene, done, budget.left), steps=steps, cpu=cpu)


def _tried(job: Job, scene: Scene, done: Integration, left: float) -> Trial:
    """Return what came of a run that reached its end."""
    samples, end = sample(scene, done.trajectory), done.trajectory.t_end
    drift = float(balance(scene.system, step_samples(done.trajectory))["energy_drift"])
    channels = compute_channels(samples)
    if not (np.isfinite(drift) and all(np.isfinite(channel.values).all() for channel in channels)):
        return Trial("failed", "numerical", "the result is not finite", end)
    error, worst = (
        (None, "") if job.truth is None else distance(channels, job.truth.channels, job.truth.scales)
    )
    doubt = _doubt(scene, done, samples, drift, left) if job.diagnosed else {}
    found = (doubt.get("class", ""), doubt.get("reason", ""), end, doubt.get("item", ""))
    return Trial("done", *found, error, worst, drift, channels=channels, times=samples.t)


def _stopped(job: Job, scene: Scene, done: Integration, left: float) -> Trial:
    """Return what is known of a failure; experiments are made where there is no reference to judge by."""
    end, stop = done.trajectory.t_end, done.stop
    if not isinstance(stop, SolverFailure):
        return Trial("limit", "", str(stop), end)
    if job.truth is not None:
        return Trial("failed", "deck" if stop.kind == "deck" else "", str(stop), end, stop.item)
    kind, item, reason = _why(scene, done, left)
    return Trial("failed", kind, reason, end, item)


def _doubt(scene: Scene, done: Integration, samples: Samples, drift: float, left: float) -> dict[str, Any]:
    """Return what makes a completed run suspicious; empty if nothing does."""
    facts = {"energy_drift": drift, "validity": validity(samples, done.trajectory)}
    return suspect(scene, done, facts, min(time_for(0.0), max(left, 0.0))) or {}


def distance(
    channels: tuple[Channel, ...], truth: tuple[Channel, ...], scales: tuple[ChannelScale, ...]
) -> tuple[float | None, str]:
    """Return the largest relative difference of all judged channels, and in which; None without any."""
    true = {channel.name: channel.values for channel in truth}
    scale = {one.channel: one.scale for one in scales if one.judged}
    errors = {
        c.name: gap(c.values, true[c.name]).largest / scale[c.name]
        for c in channels
        if c.name in scale and len(true[c.name]) == len(c.values)
    }
    worst, error = farthest(errors)
    return error, worst


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
    if trial.status == "done":
        found = _completed(trial, truth, exact, bounds)
    elif trial.status == "failed":
        found = _failed(trial, truth, exact)
    else:
        found = Verdict("deck" if trial.reason.startswith(REFUSED) else "no result", trial.reason)
    return replace(found, cause=found.outcome) if found.outcome in _CAUSES else found


_CAUSES = ("numerical", "model", "physical", "deck")


def _failed(trial: Trial, truth: Truth, exact: Truth) -> Verdict:
    facts: Mapping[str, Any] = {"energy_drift": trial.drift, "growth": exact.growth}
    at = f"{trial.reason} (t = {trial.end:.4g} s)"
    if trial.kind == "deck":
        return Verdict("deck", at, item=trial.item, **facts)
    if truth.status == "done":
        why = f"{at}; gauss at a tight tolerance goes through"
        return Verdict("numerical", why, item=trial.item, **facts)
    if truth.status == "failed" and exact.status == "done":
        return Verdict("model", f"{truth.reason}; {TRUTH_MODEL} goes through", item=truth.item, **facts)
    if truth.status == "failed" and exact.status == "failed":
        why = f"{exact.reason}; {TRUTH_MODEL} at a tight tolerance fails as well"
        return Verdict(exact.kind or "numerical", why, item=exact.item, **facts)
    if trial.kind:
        return Verdict(trial.kind, at, item=trial.item, **facts)
    return Verdict("no result", f"{at}; {_missing(truth, exact)}", **facts)


def _missing(truth: Truth, exact: Truth) -> str:
    lost = truth if truth.status == "lost" else exact
    return f"nothing to judge by: {lost.reason}"


def _completed(trial: Trial, truth: Truth, exact: Truth, bounds: Bounds) -> Verdict:
    if truth.status == "failed":
        where = f"the reference of this model ends at {truth.end:.4g} s: {truth.reason}"
        cause = "model" if exact.status == "done" else exact.kind
        facts: Mapping[str, Any] = {"energy_drift": trial.drift, "growth": exact.growth}
        return Verdict("wrong", where, cause, truth.item, **facts)
    model_error, channel = _model_error(truth, exact)
    facts = {
        "time_error": trial.error,
        "model_error": model_error,
        "energy_drift": trial.drift,
        "growth": exact.growth,
        "channel": trial.channel if (trial.error or 0.0) >= (model_error or 0.0) else channel,
    }
    if truth.status == "lost" or exact.status == "lost":
        return Verdict("no result", _missing(truth, exact), **facts)
    beyond = _beyond(trial, model_error, bounds)
    unstable = next((one for one in (exact, trial) if one.kind == "physical"), None)
    if unstable is not None and (trial.drift or 0.0) <= bounds.drift:
        why = f"{unstable.reason}{'; ' + beyond if beyond else ''}"
        return Verdict("physical", why, item=unstable.item, **facts)
    if not beyond:
        return Verdict("accurate", trial.reason, trial.kind, trial.item, **facts)
    # with a time error within its bound, the model itself leaves the truth or loses energy
    numerical = model_error == 0.0 or (trial.error or 0.0) > bounds.error
    return Verdict("wrong", beyond, "numerical" if numerical else "model", trial.item, **facts)


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
