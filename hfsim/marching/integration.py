"""One integration of a scene: its equations given to a method, watched, and what came of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple
from weakref import ref

import numpy as np

from hfsim.errors import LimitReached, SolverFailure
from hfsim.integrators import Limits, Method, PlainIncrements, Problem, Trajectory, choose
from hfsim.marching.record import LegRecord, Record
from hfsim.marching.runaway import RateWatch, SectionsWatch, Watch, Watches
from hfsim.marching.steps import State, Steps, Stop, Strand, Together
from hfsim.marching.stop import SHIELD, BudgetUsedError, Progress, TimeUp
from hfsim.maths.arrays import Array
from hfsim.mechanics.counting import Turns
from hfsim.mechanics.edges import Edges
from hfsim.mechanics.many_forces import MANY
from hfsim.mechanics.projection import Projection, Weakly
from hfsim.mechanics.strained import Strains
from hfsim.mechanics.system import System
from hfsim.parts.bodies.vector_beam import VectorBeam
from hfsim.scene.build import Scene
from hfsim.scene.rules import closes_loops
from hfsim.scene.schema import SolveSpec

if TYPE_CHECKING:
    from hfsim.mechanics.carrying import Carrying, CarryingApart
    from hfsim.mechanics.slopes import Slopes


class Integration(NamedTuple):
    """A trajectory, what it cost and what stopped it."""

    trajectory: Trajectory
    problem: Problem
    method: str
    stop: Stop

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
    """A run, or a part of one, with one choice of models.

    Attributes
    ----------
    begin : float
        When it began [s]; the steps of a run that was put down know only since when it goes on.
    """

    scene: Scene
    done: Integration
    record: LegRecord
    begin: float = 0.0


def run_integration(
    scene: Scene,
    solve: SolveSpec,
    progress: Progress | None = None,
    start: State | None = None,
    extra: Watch | None = None,
    record: Record | None = None,
) -> Integration:
    """Integrate a scene until the end of its duration.

    Parameters
    ----------
    solve : SolveSpec
        How; need not be the scene's own.
    progress : callable, optional
        Called with the share of the duration that is done.
    start : (t, q, v), optional
        Where to begin; the scene's own start without it.
    extra : callable, optional
        Called with every kept state like the watches against models that run away; may raise.
    record : Record, optional
        Gets the steps as a leg, and knows whether they go on from where a run was put down.
    """
    told = None if progress is None else lambda t: progress(t / solve.duration)
    steps = _steps_of(scene, solve, told, start, extra)
    if record is None:
        for _ in steps:
            pass
        stop = steps.stop
    else:
        stop = _recorded(steps, scene, record)
    if isinstance(stop, BudgetUsedError):
        # whoever raised it knows another share: that of all the work, before steps that were made at once
        stop = BudgetUsedError(stop.seconds, steps.path.t_end / solve.duration)
    steps.path.past = steps.problem.past()
    method = ", ".join(steps.path.names) or _method(scene, solve).name
    return Integration(steps.path, steps.problem, method, stop)


def _steps_of(
    scene: Scene,
    solve: SolveSpec,
    told: Callable[[float], None] | None,
    start: State | None,
    extra: Watch | None,
) -> Steps | Together:
    """Return what makes the steps: those of each part side by side where a scene has parts."""
    others = [extra] if extra is not None else []
    if not scene.parts or start is not None or extra is not None:
        if told is not None:
            others.append(lambda t, q, v: told(t))
        return _steps(scene, solve, start, others)
    if told is not None:
        others.append(lambda t, q, v: told(whole().t))  # type: ignore[union-attr]
    together = Together(
        problem_of(scene),
        [Strand(_steps(part.scene, solve, None, others), part.columns, part.bodies) for part in scene.parts],
        (0.0, scene.q, scene.v),
        solve.duration,
    )
    whole = ref(together)  # what it holds must not hold it: memory would wait for the collector
    return together


def _steps(scene: Scene, solve: SolveSpec, start: State | None, others: Sequence[Watch]) -> Steps:
    method, problem = _method(scene, solve), problem_of(scene)
    begin = (0.0, scene.q, scene.v) if start is None else start
    own: list[Watch] = [RateWatch(begin[2], problem.culprit)]
    beams = [body for body in scene.bodies.values() if isinstance(body, VectorBeam) and body.has_sections]
    if beams:
        own.append(SectionsWatch(scene.system, beams))
    watches = Watches(scene.system, [*own, *others], problem.through)
    limits = Limits(solve.step, solve.max_steps)
    return Steps(problem, method, begin, solve.duration, limits, watches)


def _method(scene: Scene, solve: SolveSpec) -> Method:
    return choose(solve, scene.system.dissipates)


def _recorded(steps: Steps | Together, scene: Scene, record: Record) -> Stop:
    """Make all steps and the record of them; return what ended them early."""
    stop: Stop = None
    try:
        memory = record.begin(scene)
        if memory is not None:
            steps.recall(memory)
        for _ in steps:
            if not steps.on_the_brink and record.due(steps.path, steps.counts):
                with SHIELD:
                    steps.settle()
                    record.close(steps.path, steps.counts, steps.memory)
        stop = steps.stop
    except (SolverFailure, LimitReached, KeyboardInterrupt) as told:
        stop = told
    if isinstance(stop, SolverFailure) and stop.item in scene.deck.channels:
        return stop
    try:
        with SHIELD:
            steps.settle()
            record.close(steps.path, steps.counts)
    except (SolverFailure, LimitReached, KeyboardInterrupt) as told:
        stop = stop or told
    return stop


def problem_of(scene: Scene) -> Problem:
    """Return the equations of motion of a scene as integrators see them."""
    system = scene.system
    problem = Problem(
        acceleration=system.acceleration,
        project=None,
        dissipates=system.dissipates,
        admissible=system.admissible,
        positive=None if system.variable_mass else system.reduction.stretches,
        breakdown=system.breakdown,
        culprit=partial(_culprit, scene),
        increments=system.natural or PlainIncrements(),
        slopes=_slopes(scene),
        carrying=partial(_carrying, scene),
        imbalance=system.imbalance if system.balances else None,
        strains=Strains.of(system),
        constant_mass=not system.charts and not system.variable_mass,
        quartic=system.quartic,
        rigid=all(body.rigid for body in scene.deck.bodies.values()),
        loops=closes_loops(scene.deck),
        spatial=scene.deck.dimension == 3,
        many_forces=len(system.together) >= MANY,
        breaks=system.breaks(scene.deck.solve.duration),
        period=partial(system.period, t_end=scene.deck.solve.duration),
        recordings=scene.recordings,
        units=partial(_units, scene),
        recharted=partial(_recharted, system) if any(chart.several for chart in system.charts) else None,
    )
    through = Weakly(problem.through)
    if system.variable_mass:
        problem.admissible = partial(system.admissible, through=through)
    if system.linearizes:
        problem.linearized = partial(system.linearized, through=through)
    problem.turns, problem.edges = Turns(system, through), Edges(system, through)
    if system.equations.constraints:
        problem.project = Projection(system, through)
    return problem


def _units(scene: Scene) -> Array:
    return scene.units[scene.system.reduction.rows]


def _slopes(scene: Scene) -> Slopes | None:
    if scene.deck.dimension == 2:
        return None
    from hfsim.mechanics.slopes import Slopes

    return Slopes.of(scene.system, (scene.q, scene.v))


def _carrying(scene: Scene) -> Carrying | CarryingApart | None:
    return scene.kept(("carrying",), lambda: _carrying_of(scene))


def _carrying_of(scene: Scene) -> Carrying | CarryingApart | None:
    """Return rigid motions in space: of everything, or of what nothing connects."""
    system = scene.system
    if scene.deck.dimension == 2 or system.charts or system.variable_mass:
        return None
    from hfsim.mechanics.carrying import Carrying

    return Carrying.of(system, tuple(scene.bodies.values()), system.absolute(scene.q[None])[0])


def _recharted(system: System, q: Array, v: Array) -> tuple[Array, Array] | None:
    """Return a state (n,) in the charts to go on in, if these are not the ones it is in."""
    one, rate, near = q[None], v[None], q[None].copy()
    for chart in system.charts:
        near[:, chart.columns] = chart.better(one)
    if np.array_equal(near, one):
        return None
    there, moving = system.state(system.absolute(one), system.absolute_velocity(one, rate), near)
    return there[0], moving[0]


def _culprit(scene: Scene, t: float, q: Array, v: Array) -> SolverFailure | None:
    from hfsim.marching.culprit import non_finite

    return non_finite(scene, t, q, v)
