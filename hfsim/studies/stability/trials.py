"""Runs that points of a map rest on: references, solved tightly, and the points themselves.

Whether the scene itself is unstable is asked of `exact`: it is solved a second time with a start
disturbed by next to nothing, and the distance of the two solutions tells (`hfsim.trust.growth`).  Where
references fail too, the experiments of `hfsim.trust.diagnosis` say why, in the same classes.

All of this happens in worker processes.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hfsim.errors import DeckError, SolverFailure
from hfsim.marching.balance import balance, step_samples
from hfsim.marching.distance import reference_scales
from hfsim.marching.integration import Integration, run_integration
from hfsim.marching.sampling import SceneSamples, compute_channels, sample
from hfsim.marching.stop import Budget, TimeUp
from hfsim.scene.build import Scene, build
from hfsim.scene.loading import parse_deck
from hfsim.scene.schema import SolveSpec
from hfsim.studies.stability.verdict import REFUSED, Trial, Truth, distance
from hfsim.studies.timing import solved
from hfsim.trust.diagnosis import diagnose
from hfsim.trust.doubt import validity
from hfsim.trust.experiments import time_for
from hfsim.trust.growth import disturbed_growth
from hfsim.trust.suspicion import instability, suspect

_STAGES = {"gauss": 14, "radau": 9}
"""Stages of references: those of no default, so that even where a run and its reference take the same few
steps, two discretisations are compared."""


@dataclass(frozen=True)
class Job:
    """One model of one scene to be solved.

    Attributes
    ----------
    text, file : str
        The deck as written.
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
    growth = disturbed_growth(scene, done, solve, budget.guard()) if disturbed else None
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
    found = diagnose(scene, done, _for_experiments(seconds))
    kind = "" if "undecided" in found.evidence else found.kind
    return kind, found.item, found.reason


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
    budget = Budget(job.limit)
    done, cpu = solved(scene, solve, budget.guard())
    if isinstance(done.stop, TimeUp):
        return Trial("lost", reason=f"{done.stop} after {job.limit:.3g} s", cpu=cpu)
    steps = done.problem.counts.steps
    judge = _tried if done.stop is None else _stopped
    return replace(judge(job, scene, done, budget.left), steps=steps, cpu=cpu)


def _tried(job: Job, scene: Scene, done: Integration, left: float) -> Trial:
    """Return what came of a run that reached its end."""
    samples, end = sample(scene, done.trajectory), done.trajectory.t_end
    drift = float(balance(scene, step_samples(done.trajectory))["energy_drift"])
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


def _doubt(
    scene: Scene, done: Integration, samples: SceneSamples, drift: float, left: float
) -> dict[str, Any]:
    """Return what makes a completed run suspicious; empty if nothing does."""
    facts = {"energy_drift": drift, "validity": validity(samples, done.trajectory)}
    return suspect(scene, done, facts, _for_experiments(left)) or {}


def _for_experiments(left: float) -> Budget:
    return Budget(min(time_for(0.0), max(left, 0.0)), time.process_time)
