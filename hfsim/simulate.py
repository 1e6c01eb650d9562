"""From a deck to results: build, integrate, sample, judge. The pipeline to read first.

Where models are chosen in the run, it consists of several legs, each with a scene of its own; else of one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hfsim.errors import HfsimError, LimitReached, SolverFailure, Terminated
from hfsim.integrators import Trajectory
from hfsim.maths.arrays import Array
from hfsim.parts.bodies import BODIES
from hfsim.parts.channels import CHANNELS, Samples
from hfsim.run.balance import balance, step_samples
from hfsim.run.clock import PhaseClock
from hfsim.run.distance import channel_errors
from hfsim.run.integration import Integration, Leg, run_integration
from hfsim.run.plan import plan_of
from hfsim.run.solution import Channel, Run
from hfsim.run.stop import Progress
from hfsim.run.turns import count_turns
from hfsim.scene.build import Scene, build
from hfsim.scene.loading import LoadedDeck
from hfsim.trust.experiments import time_for
from hfsim.trust.suspicion import suspect
from hfsim.trust.validity import validity_warnings, watch_validity

if TYPE_CHECKING:
    from hfsim.trust.adaptive import Course

LARGE_DRIFT = 1e-3
"""Energy drift from which a run warns."""


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
            statistics = _statistics(legs, samples)
    if course is not None:
        statistics["auto"] = course.facts()
    if error_estimate and done.trajectory.segments and not isinstance(done.stop, KeyboardInterrupt):
        with clock.phase("error_estimate"):
            statistics |= _measured_error(legs, samples, channels)
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
        outlines=_outlines(samples) if outlines else {},
        statistics=statistics,
        failure=failure,
        exit_code=code,
    )


def check(loaded: LoadedDeck, model: str | None = None) -> dict[str, Any]:
    """Assemble a scene without running it and return its sizes.

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
    }


def sample_legs(legs: Sequence[Leg]) -> list[Samples]:
    """Read each leg at its output times; one at which models change belongs to the leg that ends."""
    parts, seen = [], -np.inf
    for leg in legs:
        times = output_times(leg.scene)
        mine = times[(times > seen) & (times <= leg.done.trajectory.t_end)]
        parts.append(samples_at(leg.scene, leg.done.trajectory, mine))
        seen = leg.done.trajectory.t_end
    return parts


def join_channels(samples: Sequence[Samples]) -> tuple[Channel, ...]:
    """Return the columns that the deck asks for, over all legs."""
    parts = [compute_channels(one) for one in samples]
    return tuple(
        Channel(same[0].name, same[0].unit, np.concatenate([one.values for one in same]))
        for same in zip(*parts, strict=True)
    )


def _outlines(samples: Sequence[Samples]) -> dict[str, Array]:
    """Return the outlines of all bodies over all legs; those of a rigid beam get as many points as later."""
    outlines: dict[str, Array] = {}
    for name in samples[0].scene.bodies:
        parts = [one.scene.bodies[name].outline(one.x) for one in samples]
        most = max(part.shape[1] for part in parts)
        outlines[name] = np.concatenate([_refined(part, most) for part in parts])
    return outlines


def _refined(points: Array, count: int) -> Array:
    """Return polylines (n_times, n_points, 2) with straight pieces cut until there are ``count`` points."""
    n = points.shape[1]
    if n == count:
        return points
    at = np.linspace(0.0, n - 1.0, count)
    left = np.minimum(at.astype(int), n - 2)
    share = (at - left)[:, None]
    return np.asarray(points[:, left] * (1.0 - share) + points[:, left + 1] * share)


def output_times(scene: Scene) -> Array:
    """Return the output times of a whole run."""
    count = int(np.floor(scene.deck.solve.duration / scene.deck.interval * (1.0 + 1e-12)))
    times = scene.deck.interval * np.arange(count + 1)
    times[-1] = min(times[-1], scene.deck.solve.duration)
    return np.asarray(times)


def sample(scene: Scene, trajectory: Trajectory) -> Samples:
    """Read the trajectory at the output times and move the states onto the joints."""
    times = output_times(scene)
    return samples_at(scene, trajectory, times[times <= trajectory.t_end])


def samples_at(scene: Scene, trajectory: Trajectory, times: Array) -> Samples:
    """Return samples at sorted times."""
    q, v = trajectory.at(times)
    q, v = scene.system.project(times, q, v)
    turns = count_turns(scene, trajectory, times)
    return Samples(scene, times, q, v, turns)


def compute_channels(samples: Samples) -> tuple[Channel, ...]:
    """Return the columns that the deck asks for."""
    columns = []
    for name in samples.scene.deck.channels:
        subject, _, quantity = name.rpartition(".")
        kind = CHANNELS[quantity]
        unit = "m" if name == "constraint.position" else kind.unit
        columns.append(Channel(name, unit, np.ascontiguousarray(kind.compute(samples, subject, quantity))))
    return tuple(columns)


_SUMS = (
    *("steps", "rejected", "newton_iterations", "evaluations", "evaluation_calls", "factorisations"),
    "work_done",
)
_LARGEST = ("unknowns", "multipliers", "energy_drift", "constraint_position", "constraint_velocity")


def _statistics(legs: Sequence[Leg], samples: Sequence[Samples]) -> dict[str, Any]:
    """Return the statistics of a run: sums or the largest over its legs, the rest of the last."""
    parts = [_of_leg(leg.scene, leg.done, one) for leg, one in zip(legs, samples, strict=True)]
    facts = dict(parts[-1])
    facts |= {key: sum(part[key] for part in parts) for key in _SUMS}
    facts |= {key: max(part[key] for part in parts) for key in _LARGEST}
    facts["energy_initial"] = parts[0]["energy_initial"]
    facts["warnings"] = [warning for part in parts for warning in part["warnings"]]
    return facts


def _of_leg(scene: Scene, done: Integration, samples: Samples) -> dict[str, Any]:
    counts, system = done.problem.counts, scene.system
    facts: dict[str, Any] = {
        "steps": counts.steps,
        "rejected": counts.rejected,
        "newton_iterations": counts.iterations,
        "evaluations": counts.evaluations,
        "evaluation_calls": counts.calls,
        "factorisations": counts.factorisations,
        "unknowns": system.n,
        "multipliers": system.n_rows,
        "models": scene.models,
    }
    facts |= balance(system, step_samples(done.trajectory))
    facts["validity"] = validity(samples, done.trajectory)
    facts["warnings"] = _warnings(scene, done, facts["energy_drift"])
    facts["warnings"] += validity_warnings(scene.models, facts["validity"])
    return facts


def validity(samples: Samples, trajectory: Trajectory) -> dict[str, Any]:
    """Return what `watch_validity` finds at the output times and at the ends of the steps."""
    steps = step_samples(trajectory)
    times, first = np.unique(np.concatenate([samples.t, steps.t]), return_index=True)
    q, v = (np.concatenate(pair)[first] for pair in ((samples.q, steps.q), (samples.v, steps.v)))
    return watch_validity(samples.scene, times, q, v)


def _warnings(scene: Scene, done: Integration, drift: float) -> list[str]:
    """Return what a user should know before trusting the curves."""
    if drift < LARGE_DRIFT or done.stop is not None:
        return []
    truncated = [body.name for body in scene.system.variable_mass if body.truncated]
    if truncated:
        why = f"lowOrder leaves out inertia terms of {', '.join(truncated)}; compare with exact"
    else:
        why = f"method {done.method} does not resolve the motion; lower the tolerance or take gauss"
    return [f"the energy balance is off by {drift:.2g} of the energies that change: {why}"]


def _measured_error(
    legs: Sequence[Leg], samples: Sequence[Samples], channels: tuple[Channel, ...]
) -> dict[str, Any]:
    """Integrate again, tighter and with Gauss collocation, and return the largest differences.

    Models change where they did in the run: how good they are is not judged here.
    """
    solve = legs[0].scene.deck.solve
    tighter = max(min(solve.tolerance, 1e-6) * 1e-2, 1e-13)
    update = {"method": "gauss", "tolerance": tighter, "step": None, "stages": None, "max_steps": None}
    parts: list[Samples] = []
    before: tuple[Scene, Trajectory] | None = None
    for leg, mine in zip(legs, samples, strict=True):
        path = leg.done.trajectory
        again = solve.model_copy(update=update | {"duration": path.t_end})
        scene = leg.scene
        if before is not None:
            from hfsim.trust.handover import hand_over

            scene = hand_over(before[0], scene, before[1])[0]
        tight = run_integration(scene, again, start=(path.t_start, scene.q, scene.v)).trajectory
        parts.append(samples_at(scene, tight, mine.t[mine.t <= tight.t_end]))
        if tight.t_end < path.t_end:
            break
        before = scene, tight
    absolute, relative = channel_errors(channels, join_channels(parts))
    return {
        "error_estimate": max(relative.values(), default=0.0),
        "error_by_channel": absolute,
        "error_estimate_by": f"difference to a second run, gauss at tolerance {tighter:g}",
    }


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
