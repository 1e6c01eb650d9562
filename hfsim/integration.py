"""One integration of a scene: its equations given to a method, watched, and what came of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from hfsim.arrays import Array
from hfsim.build import Scene
from hfsim.culprit import non_finite
from hfsim.deck import SolveSpec
from hfsim.errors import HfsimError
from hfsim.integrators import Limits, PlainIncrements, Problem, Trajectory, choose, integrate
from hfsim.runaway import DisplacementWatch, EnergyWatch

Progress = Callable[[float], None]
Watch = Callable[[float, Array, Array], None]


@dataclass(frozen=True)
class Integration:
    """A trajectory, what it cost and what stopped it."""

    trajectory: Trajectory
    problem: Problem
    method: str
    stop: HfsimError | KeyboardInterrupt | None


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
    system, duration = scene.system, solve.duration
    problem = Problem(
        acceleration=system.acceleration,
        project=partial(system.project, strict=True),
        dissipates=system.dissipates,
        admissible=system.admissible,
        breakdown=system.breakdown,
        culprit=lambda t, q, v: non_finite(scene, t, q, v),
        linearized=system.linearized if system.linearizes else None,
        increments=system.natural or PlainIncrements(),
        constant_mass=system.linearizes,
        quartic=system.quartic,
    )
    method = choose(solve, system.dissipates)
    watches: list[Watch] = [EnergyWatch(system), DisplacementWatch(system)]
    if extra is not None:
        watches.append(extra)

    def watch(t: float, q: Array, v: Array) -> None:
        for look in watches:
            look(t, q, v)
        if progress is not None:
            progress(t / duration)

    begin = (0.0, scene.q, scene.v) if start is None else start
    watch(*begin)
    limits = Limits(solve.step, solve.max_steps)
    trajectory, stop = integrate(problem, method, begin, duration, limits, watch)
    return Integration(trajectory, problem, method.name, stop)
