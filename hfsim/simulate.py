"""From a deck to results: build, integrate, sample, judge. The pipeline to read first."""

from __future__ import annotations

from typing import Any

import numpy as np

from hfsim.arrays import Array
from hfsim.balance import balance, step_samples
from hfsim.build import Scene, build
from hfsim.channels import CHANNELS, Samples
from hfsim.clock import PhaseClock
from hfsim.deck import LoadedDeck
from hfsim.diagnosis import diagnose, suspect
from hfsim.errors import HfsimError, LimitReached, SolverFailure
from hfsim.integration import Integration, Progress, run_integration
from hfsim.integrators import Trajectory
from hfsim.solution import Channel, Run
from hfsim.validity import validity_warnings, watch_validity

LARGE_DRIFT = 1e-3
"""Energy drift from which a run warns."""


def simulate(
    loaded: LoadedDeck,
    model: str | None = None,
    progress: Progress | None = None,
    error_estimate: bool = True,
    diagnosis: bool = False,
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
    with clock.phase("build"):
        scene = build(loaded, model)
    with clock.phase("solve"):
        done = run_integration(scene, scene.deck.solve, progress)
        samples = sample(scene, done.trajectory)
        # numbers out of all range at the end of a failed run: they never reach a file
        with np.errstate(all="ignore"):
            channels = compute_channels(samples)
            statistics = _statistics(scene, done, samples)
    if error_estimate and done.trajectory.segments and not isinstance(done.stop, KeyboardInterrupt):
        with clock.phase("error_estimate"):
            statistics |= _measured_error(scene, done, samples, channels)
    stop = done.stop
    if diagnosis and not isinstance(stop, KeyboardInterrupt):
        with clock.phase("diagnosis"):
            if isinstance(stop, SolverFailure):
                stop = diagnose(scene, done, clock.cpu["solve"])
            elif stop is None:
                statistics["suspicion"] = suspect(scene, done, statistics, clock.cpu["solve"])
    statistics["cpu_s"], statistics["wall_s"] = clock.cpu, clock.wall
    status, reason, failure, code = _outcome(scene, stop)
    return Run(
        name=scene.deck.name,
        model=scene.model,
        method=done.method,
        status=status,
        reason=reason,
        t=samples.t,
        channels=channels,
        outlines={name: body.outline(samples.x) for name, body in scene.bodies.items()},
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
        "bodies": {kind: kinds.count(kind) for kind in ("beam", "rigid") if kind in kinds},
        "joints": len(deck.joints),
        "springs": len(deck.springs),
        "loads": len(deck.loads),
        "unknowns": system.n,
        "multipliers": system.n_rows,
        "degrees_of_freedom": system.n - system.n_rows,
    }


def sample(scene: Scene, trajectory: Trajectory) -> Samples:
    """Read the trajectory at the output times and move the states onto the joints."""
    count = int(np.floor(scene.deck.solve.duration / scene.deck.interval * (1.0 + 1e-12)))
    times = scene.deck.interval * np.arange(count + 1)
    times[-1] = min(times[-1], scene.deck.solve.duration)
    times = times[times <= trajectory.t_end]
    return samples_at(scene, trajectory, times)


def samples_at(scene: Scene, trajectory: Trajectory, times: Array) -> Samples:
    """Return samples at sorted times."""
    q, v = trajectory.at(times)
    q, v = scene.system.project(times, q, v)
    turns = _turns(scene, trajectory, times)
    return Samples(scene, times, q, v, turns)


def _turns(scene: Scene, trajectory: Trajectory, times: Array) -> dict[str, Array]:
    """Count full turns of bodies whose angle is measured from slopes, along all steps."""
    names = [name for name, body in scene.bodies.items() if body.angle_column is None]
    if not names or not len(times):
        return {}
    ends = trajectory.step_ends()
    inner = (ends[:-1, None] + np.diff(ends)[:, None] * np.array([0.25, 0.5, 0.75])).ravel()
    every = np.unique(np.concatenate([ends, inner, times]))
    x = scene.system.absolute(trajectory.at(every)[0])
    at = np.searchsorted(every, times)
    turns = {}
    for name in names:
        angle = np.unwrap(scene.marker(name).angle(x))
        start = scene.start_angles[name]
        turns[name] = (angle + 2.0 * np.pi * np.round((start - angle[0]) / (2.0 * np.pi)))[at]
    return turns


def compute_channels(samples: Samples) -> tuple[Channel, ...]:
    """Return the columns that the deck asks for."""
    columns = []
    for name in samples.scene.deck.channels:
        subject, _, quantity = name.rpartition(".")
        kind = CHANNELS[quantity]
        unit = "m" if name == "constraint.position" else kind.unit
        columns.append(Channel(name, unit, np.ascontiguousarray(kind.compute(samples, subject, quantity))))
    return tuple(columns)


def _statistics(scene: Scene, done: Integration, samples: Samples) -> dict[str, Any]:
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
    scene: Scene, done: Integration, samples: Samples, channels: tuple[Channel, ...]
) -> dict[str, Any]:
    """Integrate again, tighter and with Gauss collocation, and return the largest differences."""
    solve = scene.deck.solve
    tighter = max(min(solve.tolerance, 1e-6) * 1e-2, 1e-13)
    update = {"method": "gauss", "tolerance": tighter, "step": None, "stages": None}
    update |= {"duration": done.trajectory.t_end, "max_steps": None}
    again = run_integration(scene, solve.model_copy(update=update)).trajectory
    reference = compute_channels(samples_at(scene, again, samples.t[samples.t <= again.t_end]))
    spans = _spans(reference)
    errors: dict[str, float] = {}
    relative: dict[str, float] = {}
    for mine, better in zip(channels, reference, strict=True):
        n = len(better.values)
        if not n or mine.name.startswith("constraint."):
            continue
        errors[mine.name] = float(np.abs(mine.values[:n] - better.values).max())
        # the total energy of a conservative scene has no range to be measured by
        if mine.name != "energy.total" and spans[mine.name] > 0.0:
            relative[mine.name] = errors[mine.name] / spans[mine.name]
    return {
        "error_estimate": max(relative.values(), default=0.0),
        "error_by_channel": errors,
        "error_estimate_by": f"difference to a second run, gauss at tolerance {tighter:g}",
    }


def _spans(channels: tuple[Channel, ...]) -> dict[str, float]:
    """Return the range of each channel, at least a thousandth of the largest among those of its unit."""
    ranges = {c.name: float(np.ptp(c.values)) if len(c.values) else 0.0 for c in channels}
    largest: dict[str, float] = {}
    for c in channels:
        largest[c.unit] = max(largest.get(c.unit, 0.0), ranges[c.name])
    return {c.name: max(ranges[c.name], 1e-3 * largest[c.unit]) for c in channels}


def _outcome(
    scene: Scene, stop: HfsimError | KeyboardInterrupt | None
) -> tuple[str, str, dict[str, Any] | None, int]:
    """Return status, reason, failure facts and exit code."""
    if stop is None:
        return "done", "", None, 0
    if isinstance(stop, KeyboardInterrupt):
        return "interrupted", "interrupted from the keyboard", None, 130
    if isinstance(stop, LimitReached):
        return "limit", stop.reason, None, stop.exit_code
    assert isinstance(stop, SolverFailure)
    return "failed", stop.reason, stop.facts(scene.loaded.line_of), stop.exit_code
