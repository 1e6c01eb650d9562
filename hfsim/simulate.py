"""From a deck to results: build, integrate, sample, judge. The pipeline to read first.

Where models are chosen in the run, it consists of several legs, each with a scene of its own; else of one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from time import process_time
from typing import TYPE_CHECKING, Any

import numpy as np

from hfsim.errors import LimitReached, SolverFailure, interruption_code, interruption_words
from hfsim.integrators import Memory
from hfsim.marching.between import Between
from hfsim.marching.clock import PhaseClock
from hfsim.marching.integration import Leg, run_integration
from hfsim.marching.plan import motions_of, plan_of
from hfsim.marching.record import Reader, Record, Sink
from hfsim.marching.sampling import outlines_of
from hfsim.marching.solution import Run
from hfsim.marching.statistics import joined, leg_statistics
from hfsim.marching.steps import Stop
from hfsim.marching.stop import Budget, Progress, nobody
from hfsim.parts.bodies import BODIES
from hfsim.scene.build import Scene, build
from hfsim.scene.loading import LoadedDeck
from hfsim.trust.after import Aftermath, Stages, Wish
from hfsim.trust.doubt import doubts
from hfsim.trust.estimate import Compared

if TYPE_CHECKING:
    from hfsim.trust.adaptive import Course


AFTER_ITS_END = "interrupted after its end: what was to be done after it is missing"
"""Reason of a run that reached its end before a signal came."""


def simulate(
    loaded: LoadedDeck,
    model: str | None = None,
    progress: Progress | None = None,
    error_estimate: bool = True,
    diagnosis: bool = False,
    outlines: bool | None = None,
    sink: Sink | None = None,
    memory: Memory | None = None,
    mesh_estimate: bool = False,
    after: float | None = None,
    reader: Reader | None = None,
) -> Run:
    """Simulate one scene with one model.

    Parameters
    ----------
    model : str, optional
        Instead of the deck's.
    progress : callable, optional
        Called with the share that is done of all the work, 0 to 1.
    error_estimate : bool
        Whether to measure the error of the integration by a second one.
    diagnosis : bool
        Whether to find out by short experiments why a run fails or is suspicious.
    outlines : bool, optional
        Whether to compute the outlines of the bodies; without it, if the deck wants plots or everything.
    sink : Sink, optional
        Gets the rows of the output while the run goes on, and the memories to take it up again from.
    memory : Memory, optional
        From where a run that was put down goes on.
    mesh_estimate : bool
        Whether to measure the error of the mesh by runs on others.
    after : float, optional
        CPU time for estimates and diagnosis [s]; without it as much as the run has taken, or two seconds.
    reader : Reader, optional
        Gets the steps as they are made; of a run that goes on from a memory, those since then.

    Returns
    -------
    Run
        A failure of solver or model is not raised but told in it, with what was computed until then.

    Raises
    ------
    DeckError
        If the scene cannot be assembled.
    """
    clock, record = PhaseClock(), Record(sink, memory, reader=reader)
    wish = Wish(error_estimate, mesh_estimate, diagnosis, after)
    stages = Stages(progress or nobody, wish)
    course: Course | None = None
    if "auto" in loaded.deck.models(model or loaded.deck.solve.model).values():
        from hfsim.trust.adaptive import Adaptive

        with clock.phase("solve"):
            course = Adaptive(loaded, model, stages.solving, record).run()
        legs = course.legs
    else:
        with clock.phase("build"):
            scene = build(loaded, model)
        record.open(scene)
        with clock.phase("solve"):
            done = run_integration(scene, scene.deck.solve, stages.solving, record=record)
        legs = [Leg(scene, done, record.legs[-1])]
    run = assess(legs, record, clock, wish, outlines, course, stages.after)
    for leg in legs:
        leg.scene.recordings.clear()  # they hold what holds the scene: memory would wait for the collector
    stages.end()
    return run


def assess(
    legs: Sequence[Leg],
    record: Record,
    clock: PhaseClock,
    wish: Wish,
    outlines: bool | None = None,
    course: Course | None = None,
    report: Progress = nobody,
) -> Run:
    """Return what integrations have found, with their error and what is doubtful about it.

    Parameters
    ----------
    legs : sequence of Leg
        One, or several where models change in between.
    record : Record
        What they have left behind.
    clock : PhaseClock
        With the phases so far, ``solve`` among them; gets those that follow.
    wish : Wish
        What is to be found out about them.
    outlines : bool, optional
        As in `simulate`.
    course : Course, optional
        How the models were chosen.
    report : callable
        Told the share used of the time for what is to be found out.
    """
    run, scene = _solved(legs, record, clock, course), legs[-1].scene
    record.solved(run)
    budget = Budget(wish.allowed(clock.cpu["solve"]), process_time, report=report)
    found = Aftermath(Compared(legs, run.channels), wish, clock, budget)
    found.find(run.statistics)
    samples = [leg.record.samples for leg in legs]
    told = {"statistics": {**run.statistics, **found.facts}, **_outcome(scene, found.stop), "states": samples}
    if found.interruption is not None:
        told["exit_code"] = interruption_code(found.interruption)
        told["reason"] = run.reason or AFTER_ITS_END
    run = replace(run, fine=Between(legs, run.t, run.channels), **told)
    if scene.left_out.fires("plots") if outlines is None else not outlines:
        return run
    seen = outlines_of(samples)
    with np.errstate(all="ignore"):
        shots = tuple(shot for leg in legs for shot in leg.record.shots.snapshots())
    run = replace(run, outline_t=seen.t, outlines=seen.points, outline_forces=seen.forces)
    return replace(run, snapshots=shots)


def _solved(legs: Sequence[Leg], record: Record, clock: PhaseClock, course: Course | None) -> Run:
    """Return what the integrations themselves have given."""
    scene, done = legs[-1].scene, legs[-1].done
    with clock.phase("solve"):
        channels = record.channels()
        statistics = joined([_facts(leg) for leg in legs])
    if course is not None:
        statistics["auto"] = course.facts()
    times = {"cpu_s": clock.cpu, "wall_s": clock.wall}
    return Run(
        name=scene.deck.name,
        model=scene.model,
        method=done.method,
        t=record.table()[:, 0],
        channels=channels,
        statistics={**statistics, "plan": plan_of(scene), **times},
        reached=float(done.trajectory.t_end),
        **_outcome(scene, done.stop),
    )


def check(loaded: LoadedDeck, model: str | None = None) -> dict[str, Any]:
    """Assemble a scene without running it and return its sizes, how its joints close, and what looks wrong.

    Raises
    ------
    DeckError
        If it cannot be assembled.
    """
    scene = build(loaded, model)
    deck, system = scene.deck, scene.system
    kinds = [spec.type for spec in deck.bodies.values()]
    return {
        "name": deck.name,
        "model": scene.model,
        "models": scene.models,
        "bodies": {kind: kinds.count(kind) for kind in BODIES if kind in kinds},
        "joints": len(deck.joints),
        "springs": len(deck.springs),
        "loads": len(deck.loads),
        "unknowns": system.n,
        "multipliers": system.n_rows,
        "degrees_of_freedom": system.n - system.n_rows,
        "assembly": {**scene.assembly.facts(), "branches": scene.assembly.branches()},
        "free_motions": motions_of(scene),
        "warnings": scene.warnings,
    }


def _facts(leg: Leg) -> dict[str, Any]:
    # numbers out of all range at the end of a failed run: they never reach a file
    with np.errstate(all="ignore"):
        facts = leg_statistics(leg)
        return facts | doubts(leg, facts["energy_drift"])


def _outcome(scene: Scene, stop: Stop) -> dict[str, Any]:
    """Return status, reason, failure facts and exit code."""
    if stop is None:
        return {"status": "done", "reason": "", "failure": None, "exit_code": 0}
    if isinstance(stop, KeyboardInterrupt):
        told = {"status": "interrupted", "reason": interruption_words(stop), "failure": None}
        return told | {"exit_code": interruption_code(stop)}
    if isinstance(stop, LimitReached):
        return {"status": "limit", "reason": stop.reason, "failure": None, "exit_code": stop.exit_code}
    assert isinstance(stop, SolverFailure)
    failure = stop.facts(scene.loaded.line_of)
    return {"status": "failed", "reason": str(stop), "failure": failure, "exit_code": stop.exit_code}
