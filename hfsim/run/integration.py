"""One integration of a scene: its equations given to a method, watched, and what came of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from hfsim.errors import HfsimError, LimitReached, SolverFailure
from hfsim.integrators import Limits, PlainIncrements, Problem, Trajectory, choose, integrate, joined
from hfsim.maths.arrays import Array
from hfsim.run.runaway import EnergyWatch, PartsWatch
from hfsim.run.stop import Progress, TimeUp
from hfsim.scene.build import Scene
from hfsim.scene.schema import SolveSpec

Watch = Callable[[float, Array, Array], None]


class Integration(NamedTuple):
    """A trajectory, what it cost and what stopped it."""

    trajectory: Trajectory
    problem: Problem
    method: str
    stop: HfsimError | KeyboardInterrupt | None

    def in_time(self) -> Integration:
        """Return itself.

        Raises
        ------
        TimeUp, KeyboardInterrupt
            If one of them ended it.
        """
        if isinstance(self.stop, TimeUp | KeyboardInterrupt):
            raise self.stop
        return self


class Leg(NamedTuple):
    """A run, or a part of one, with one choice of models."""

    scene: Scene
    done: Integration


def run_integration(
    scene: Scene,
    solve: SolveSpec,
    progress: Progress | None = None,
    start: tuple[float, Array, Array] | None = None,
    extra: Watch | None = None,
) -> Integration:
    """Integrate a scene until the end of its duration.

    Parameters
    ----------
    scene : Scene
    solve : SolveSpec
        How; need not be the scene's own.
    progress : callable, optional
        Called with the share of the duration that is done.
    start : (t, q, v), optional
        Where to begin; the scene's own start without it.
    extra : callable, optional
        Called with every kept state like the watches against models that run away; may raise.
    """
    if scene.parts and start is None and extra is None:
        return _run_parts(scene, solve, progress)
    system, duration = scene.system, solve.duration
    problem = problem_of(scene)
    method = choose(solve, system.dissipates)
    watches: list[Watch] = [EnergyWatch(system), PartsWatch(system)]
    if extra is not None:
        watches.append(extra)

    def watch(t: float, q: Array, v: Array) -> None:
        for look in watches:
            look(t, q, v)
        if progress is not None:
            progress(t / duration)

    begin = (0.0, scene.q, scene.v) if start is None else start
    try:
        watch(*begin)
    except (LimitReached, SolverFailure) as stop_at_once:
        nothing = Trajectory(begin[0], *begin)
        return Integration(nothing, problem, method.name, stop_at_once)
    limits = Limits(solve.step, solve.max_steps)
    trajectory, stop = integrate(problem, method, begin, duration, limits, watch)
    return Integration(trajectory, problem, ", ".join(trajectory.methods) or method.name, stop)


def problem_of(scene: Scene) -> Problem:
    """Return the equations of motion of a scene as integrators see them."""
    system = scene.system
    return Problem(
        acceleration=system.acceleration,
        project=partial(system.project, strict=True),
        dissipates=system.dissipates,
        admissible=system.admissible,
        breakdown=system.breakdown,
        culprit=partial(_culprit, scene),
        linearized=system.linearized if system.linearizes else None,
        increments=system.natural or PlainIncrements(),
        imbalance=system.imbalance if system.balances else None,
        constant_mass=system.linearizes,
        quartic=system.quartic,
        breaks=system.breaks,
        period=system.period,
    )


def _culprit(scene: Scene, t: float, q: Array, v: Array) -> SolverFailure | None:
    from hfsim.run.culprit import non_finite

    return non_finite(scene, t, q, v)


def _run_parts(scene: Scene, solve: SolveSpec, progress: Progress | None) -> Integration:
    """Integrate each part of a scene with steps of its own; a part that stops ends all at that time."""
    problem, runs, end = problem_of(scene), [], solve.duration
    stop: HfsimError | KeyboardInterrupt | None = None
    for number, part in enumerate(scene.parts):
        told = None if progress is None else _share(progress, number, len(scene.parts))
        run = run_integration(part.scene, solve.model_copy(update={"duration": end}), told)
        runs.append(run)
        problem.counts.add(run.problem.counts)
        end = min(end, run.trajectory.t_end)
        if run.stop is not None:
            stop = _named(run.stop, part.bodies)
        if isinstance(stop, KeyboardInterrupt) or not end:
            break
    if len(runs) < len(scene.parts) or not end:
        return Integration(Trajectory(0.0, 0.0, scene.q, scene.v), problem, runs[0].method, stop)
    paths = [(run.trajectory, part.columns) for run, part in zip(runs, scene.parts, strict=True)]
    whole = joined(paths, end)
    return Integration(whole, problem, ", ".join(whole.methods), stop)


def _share(progress: Progress, number: int, count: int) -> Progress:
    return lambda share: progress((number + share) / count)


def _named(stop: HfsimError | KeyboardInterrupt, bodies: tuple[str, ...]) -> HfsimError | KeyboardInterrupt:
    """Say which part of the scene stopped."""
    part = f"in the part of {', '.join(bodies)}: "
    if isinstance(stop, SolverFailure):
        return replace(stop, reason=part + stop.reason)
    if isinstance(stop, LimitReached):
        # whoever raised it must know it again by its class
        stop.reason = part + stop.reason
        stop.args = (stop.reason,)
    return stop
