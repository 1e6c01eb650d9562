"""From a deck to results: build, integrate, sample, judge. The pipeline to read first.

Where models are chosen in the run, it consists of several legs, each with a scene of its own; else of one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hfsim.errors import HfsimError, LimitReached, SolverFailure, Terminated
from hfsim.parts.bodies import BODIES
from hfsim.run.clock import PhaseClock
from hfsim.run.integration import Leg, run_integration
from hfsim.run.plan import plan_of
from hfsim.run.sampling import SceneSamples, join_channels, outlines_of, sample_legs
from hfsim.run.solution import Run
from hfsim.run.statistics import joined, leg_statistics
from hfsim.run.stop import Progress
from hfsim.scene.build import Scene, build
from hfsim.scene.loading import LoadedDeck
from hfsim.trust.doubt import doubts
from hfsim.trust.experiments import time_for
from hfsim.trust.suspicion import suspect

if TYPE_CHECKING:
    from hfsim.trust.adaptive import Course


def simulate(
    loaded: LoadedDeck,
    model: str | None = None,
    progress: Progress | None = None,
    error_estimate: bool = True,
    diagnosis: bool = False,
    outlines: bool | None = None,
) -> Run:
    """Simulate one scene with one model.

    Parameters
    ----------
    loaded : LoadedDeck
    model : str, optional
        Instead of the deck's.
    progress : callable, optional
        Called with the share of the duration that is done, 0 to 1.
    error_estimate : bool
        Whether to measure the error of the integration by a second, tighter one.
    diagnosis : bool
        Whether to find out by short experiments why a run fails or is suspicious.
    outlines : bool, optional
        Whether to compute the outlines of the bodies; without it, if the deck wants plots or everything.

    Returns
    -------
    Run
        A failure of solver or model is not raised but told in it, with what was computed until then.

    Raises
    ------
    DeckError
        If the scene cannot be assembled.
    """
    clock = PhaseClock()
    course: Course | None = None
    if "auto" in loaded.deck.models(model or loaded.deck.solve.model).values():
        from hfsim.trust.adaptive import run_adaptive

        with clock.phase("solve"):
            course = run_adaptive(loaded, model, progress)
        legs = course.legs
    else:
        with clock.phase("build"):
            scene = build(loaded, model)
        with clock.phase("solve"):
            legs = [Leg(scene, run_integration(scene, scene.deck.solve, progress))]
    return assess(legs, clock, error_estimate, diagnosis, outlines, course)


def assess(
    legs: Sequence[Leg],
    clock: PhaseClock,
    error_estimate: bool = True,
    diagnosis: bool = False,
    outlines: bool | None = None,
    course: Course | None = None,
) -> Run:
    """Return what integrations have found, with their error and what is doubtful about it.

    Parameters
    ----------
    legs : sequence of Leg
        One, or several where models change in between.
    clock : PhaseClock
        With the phases so far, ``solve`` among them; gets those that follow.
    error_estimate, diagnosis, outlines : bool
        As in `simulate`.
    course : Course, optional
        How the models were chosen.
    """
    scene, done = legs[-1].scene, legs[-1].done
    with clock.phase("solve"):
        samples = sample_legs(legs)
        # numbers out of all range at the end of a failed run: they never reach a file
        with np.errstate(all="ignore"):
            channels = join_channels(samples)
            statistics = joined([_facts(leg, one) for leg, one in zip(legs, samples, strict=True)])
    if course is not None:
        statistics["auto"] = course.facts()
    if error_estimate and done.trajectory.segments and not isinstance(done.stop, KeyboardInterrupt):
        with clock.phase("error_estimate"):
            from hfsim.trust.error import measured_error

            statistics |= measured_error(legs, samples, channels)
    stop = done.stop
    if diagnosis and len(legs) == 1 and not isinstance(stop, KeyboardInterrupt):
        with clock.phase("diagnosis"):
            if isinstance(stop, SolverFailure):
                from hfsim.trust.diagnosis import diagnose

                stop = diagnose(scene, done, time_for(clock.cpu["solve"]))
            elif stop is None:
                statistics["suspicion"] = suspect(scene, done, statistics, time_for(clock.cpu["solve"]))
    statistics["plan"] = plan_of(scene)
    statistics["cpu_s"], statistics["wall_s"] = clock.cpu, clock.wall
    status, reason, failure, code = _outcome(scene, stop)
    if outlines is None:
        outlines = not scene.left_out.fires("plots")
    return Run(
        name=scene.deck.name,
        model=scene.model,
        method=done.method,
        status=status,
        reason=reason,
        t=np.concatenate([one.t for one in samples]),
        channels=channels,
        outlines=outlines_of(samples) if outlines else {},
        statistics=statistics,
        failure=failure,
        exit_code=code,
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
        "warnings": scene.assembly.warnings(),
    }


def _facts(leg: Leg, samples: SceneSamples) -> dict[str, Any]:
    facts = leg_statistics(leg)
    return facts | doubts(leg, samples, facts["energy_drift"])


def _outcome(
    scene: Scene, stop: HfsimError | KeyboardInterrupt | None
) -> tuple[str, str, dict[str, Any] | None, int]:
    """Return status, reason, failure facts and exit code."""
    if stop is None:
        return "done", "", None, 0
    if isinstance(stop, KeyboardInterrupt):
        if isinstance(stop, Terminated):
            return "interrupted", "ended by the signal SIGTERM", None, 143
        return "interrupted", "interrupted from the keyboard", None, 130
    if isinstance(stop, LimitReached):
        return "limit", stop.reason, None, stop.exit_code
    assert isinstance(stop, SolverFailure)
    return "failed", str(stop), stop.facts(scene.loaded.line_of), stop.exit_code
