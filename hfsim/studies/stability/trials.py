"""Points of a map as they run, in worker processes.

Where a reference fails too, the experiments of `hfsim.trust.diagnosis` say why, in the same classes.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hfsim.errors import DeckError, SolverFailure
from hfsim.marching.balance import balance, step_samples
from hfsim.marching.integration import Integration
from hfsim.marching.sampling import compute_channels, sample
from hfsim.marching.solution import Channel
from hfsim.marching.stop import Budget, TimeUp
from hfsim.scene.build import Scene, build
from hfsim.scene.loading import parse_deck
from hfsim.studies.stability.verdict import REFUSED, Trial, Truth
from hfsim.studies.timing import solved
from hfsim.trust.diagnosis import diagnose
from hfsim.trust.doubt import validity
from hfsim.trust.experiments import time_for
from hfsim.trust.suspicion import suspect


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
        The reference of its model: of a point, or one that is to be checked.
    bound : float
        Error that a reference checked is to tell from a larger one [-].
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
    bound: float = 1e-2
    diagnosed: bool = False


def why_stopped(scene: Scene, done: Integration, seconds: float) -> tuple[str, str, str]:
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
    if not (np.isfinite(drift) and all_finite(channels)):
        return Trial("failed", "numerical", "the result is not finite", end)
    doubt: dict[str, Any] = {}
    if job.diagnosed:
        facts = {"energy_drift": drift, "validity": validity(samples, done.trajectory)}
        doubt = suspect(scene, done, facts, _for_experiments(left)) or {}
    found = (doubt.get("class", ""), doubt.get("reason", ""), end, doubt.get("item", ""))
    return Trial("done", *found, drift=drift, channels=channels, times=samples.t)


def _stopped(job: Job, scene: Scene, done: Integration, left: float) -> Trial:
    """Return what is known of a failure; experiments are made where there is no reference to judge by."""
    end, stop = done.trajectory.t_end, done.stop
    if not isinstance(stop, SolverFailure):
        return Trial("limit", "", str(stop), end)
    if job.truth is not None:
        return Trial("failed", "deck" if stop.kind == "deck" else "", str(stop), end, stop.item)
    kind, item, reason = why_stopped(scene, done, left)
    return Trial("failed", kind, reason, end, item)


def all_finite(channels: Iterable[Channel]) -> bool:
    """Return whether all values are numbers."""
    return all(np.isfinite(channel.values).all() for channel in channels)


def _for_experiments(left: float) -> Budget:
    return Budget(min(time_for(0.0), max(left, 0.0)), time.process_time)
