"""The equilibrium of a scene as a run of one row: its channels, shapes and facts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from hfsim.errors import ArgumentError, HfsimError, SolverFailure
from hfsim.marching.clock import PhaseClock
from hfsim.marching.sampling import SceneSamples, compute_channels, outlines_of
from hfsim.marching.solution import Channel, Run
from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.mechanics.pose import Twist
from hfsim.mechanics.statics.buckling import critical_factors
from hfsim.mechanics.statics.equilibrium import Equilibrium
from hfsim.mechanics.statics.newton import Effort, NotFoundError
from hfsim.mechanics.statics.path import Path
from hfsim.mechanics.statics.problem import Problem, State
from hfsim.parts.bodies.models import MODELS
from hfsim.scene.acting import undirected
from hfsim.scene.build import Scene, build
from hfsim.scene.equilibrium import (
    GRAVITY,
    Turns,
    doubts,
    equilibrium_of,
    held_by_nothing,
    loads_of,
    problem_of,
    scaled,
    why_not,
)
from hfsim.scene.initial import AT_REST
from hfsim.scene.loading import LoadedDeck
from hfsim.trust.validity import watch_validity

METHOD = "static"
"""What stands in the place of a method of integration."""
LOAD = "load"
"""Column of the load factor in a path."""
NO_ERROR = "an equilibrium is no motion"
NO_MESH = "not measured: compare with more elements"


@frozen
class StaticSamples(SceneSamples):
    """States at rest: joints that move by themselves count as if they stood.

    Attributes
    ----------
    weight : float
        Share of the weight that acts.
    """

    weight: float = 1.0

    @cached_property
    def solved(self) -> tuple[Array, Array]:
        """Accelerations, and the multipliers of all joints, (n_times, n_rows).

        Bodies know their weight, and what falls with a share of it carries the rest; at rest with all of it.
        """
        system, falling = self.scene.system, np.zeros_like(self.x)
        own, force = system.unreduced, system.force(self.t, self.x, self.u)
        still = np.zeros((len(self.t), own.n_rows))
        gravity = (1.0 - self.weight) * np.array(self.scene.deck.gravity)
        for name, body in self.scene.bodies.items() if gravity.any() else ():
            for shift, size in zip(Twist.units(len(gravity)), gravity, strict=False):
                falling[:, body.columns] += size * body.moving(self.scene.assembly.poses[name], shift)
        return falling, own.constrained(self.x, own.reduction.free_force(force), still)[1]


class Wish(NamedTuple):
    """What is to be found.

    Attributes
    ----------
    t : float
        Time at which loads and drivers are taken [s].
    path : bool
        Whether the load is followed by arc length.
    buckling : int
        How many critical load factors are sought.
    varied : tuple of str or None
        Names of what these factors are of: loads, motors, ``gravity``; all of them without any.
    """

    t: float = 0.0
    path: bool = False
    buckling: int = 0
    varied: tuple[str, ...] | None = None


AT_THE_START = Wish()
"""Where a scene comes to rest under what acts at first."""


def run_static(loaded: LoadedDeck, wish: Wish = AT_THE_START) -> Run:
    """Return where a scene comes to rest under what acts on it at a time, as a run.

    It has one row, of a path one for each point. Outlines are those of the start and of each row; where there
    is no equilibrium, the row is what was reached on the way, with the share of the loads that was on.

    Raises
    ------
    ArgumentError
        If the time or the number of factors is below zero, or loads are varied for nothing.
    DeckError
        If the scene cannot be assembled, or a law has no value somewhere until the time.
    UnknownLoadError
        If there is no such load.
    """
    _check(wish)
    clock = PhaseClock()
    with clock.phase("build"):
        if wish.t:
            loaded.until(wish.t)
        scene = build(loaded)
        for name in wish.varied or ():
            if name not in loads_of(scene):
                raise UnknownLoadError(name, loads_of(scene))
    told = list(scene.warnings)  # of the start: from there on turns are counted
    with clock.phase("solve"):
        rows, found, facts = _followed(scene, wish) if wish.path else _rested(scene, wish)
        if wish.buckling:
            facts |= _critical(scene, wish)
        samples = [_sampled(scene, wish, row) for row in rows]
        loads = np.array([row.load for row in rows])
        channels = _channels(samples, loads if wish.path else None)
    facts = {**facts_of(scene, samples[-1], found), **facts}
    facts["warnings"] = _warnings(scene, told, facts)
    start = SceneSamples(scene, np.zeros(1), scene.q[None], np.zeros((1, scene.system.n)), {})
    seen = outlines_of([start, *samples])
    failure = _failure(scene, wish, found, len(rows))
    return Run(
        name=scene.deck.name,
        model=scene.model,
        method=METHOD,
        t=np.full(len(rows), wish.t),
        channels=channels,
        statistics={**facts, "cpu_s": clock.cpu, "wall_s": clock.wall},
        status="done" if failure is None else "failed",
        reason="" if failure is None else str(failure),
        failure=None if failure is None else failure.facts(scene.loaded.line_of),
        exit_code=0 if failure is None else failure.exit_code,
        outline_t=np.array([0.0, *loads]),
        outlines=seen.points,
        outline_forces=seen.forces,
        snapshots=tuple(samples[-1].snapshots()) if failure is None else (),
        states=samples,
    )


def _check(wish: Wish) -> None:
    if not 0.0 <= wish.t < np.inf:
        raise ArgumentError(f"at {wish.t:g} s nothing acts: time begins at 0 s")
    if wish.buckling < 0:
        raise ArgumentError(f"buckling is {wish.buckling}: as many critical factors cannot be sought")
    if wish.varied and not (wish.path or wish.buckling):
        raise ArgumentError("vary goes with path and buckling only: else all loads are put on")


def _channels(samples: Sequence[StaticSamples], loads: Array | None) -> tuple[Channel, ...]:
    """Return the channels of all rows as one; before them the loads of a path."""
    columns = [compute_channels(one) for one in samples]
    joined = tuple(
        one._replace(values=np.concatenate([c.values for c in every]))
        for every, one in zip(zip(*columns, strict=True), columns[0], strict=True)
    )
    return joined if loads is None else (Channel(LOAD, "", loads), *joined)


def _warnings(scene: Scene, told: Sequence[str], facts: dict[str, Any]) -> list[str]:
    """Return what is told of the start, but for what is told of the rest again, and then of the rest."""
    again = {f"initial.{AT_REST}: {one}" for one in facts["warnings"]}
    told = [*(one for one in told if one not in again), *facts["warnings"]]
    return [*told, *out_of_range(scene, facts["validity"]), *doubtful_factors(scene, facts)]


def _failure(scene: Scene, wish: Wish, found: Equilibrium, rows: int) -> SolverFailure | None:
    """Return why there is no rest, or no path beyond so many rows; None if there is."""
    if not found.reason:
        return None
    if wish.path and found.lost is None:
        kind, other = ("numerical", "a smaller load") if rows > 1 else ("physical", "leave out --path")
        return SolverFailure(found.reason, wish.t, kind=kind, remedy=f"{other}, or --vary some loads only")
    return failure_of(scene, wish.t, found)


class UnknownLoadError(HfsimError):
    """A name that is of no load of the scene."""

    exit_code = 2

    def __init__(self, name: str, known: list[str]) -> None:
        super().__init__(f"there is no load '{name}'; there are {', '.join(known) or 'none'}")


class _Row(NamedTuple):
    load: float
    q: Array
    angles: dict[str, float]


class _Rows(Turns):
    """Keeps the states of a path too."""

    def begin(self) -> None:
        super().begin()
        self.rows: list[_Row] = []

    def __call__(self, load: float, x: Array) -> None:
        super().__call__(load, x)
        self.rows.append(_Row(load, self.q, dict(self.angles)))


def _rested(scene: Scene, wish: Wish) -> tuple[list[_Row], Equilibrium, dict[str, Any]]:
    """Return the equilibrium."""
    turns = Turns(scene)
    problem = problem_of(scene, wish.t, turns, wish.varied)
    found = equilibrium_of(scene, problem)
    turns(found.share, problem.expand(found.state.z))
    return [_Row(found.share, turns.q, turns.angles)], found, {}


def _followed(scene: Scene, wish: Wish) -> tuple[list[_Row], Equilibrium, dict[str, Any]]:
    """Return the path."""
    kept = _Rows(scene)
    problem = problem_of(scene, wish.t, kept, wish.varied)
    path, why, lost = _along(problem)
    points = path.points
    if not points:
        kept.begin()
        rows, state = [_Row(0.0, kept.q, kept.angles)], path.problem.start
        values: Array = np.zeros(0)
    else:
        rows, state, values = kept.rows[-len(points) :], points[-1].state, points[-1].values
    nothing = np.zeros((0, state.z.shape[1]))
    loose = points[-1].problem.free if points else None
    free = nothing if loose is None else loose
    led = problem.way.followed and not path.effort.descents
    args = state, rows[-1].load, values, nothing, free, False, None, path.effort, why, lost
    reached = Equilibrium(*args, led=led)
    told = {kind: [one.load for one in path.crossings if one.kind == kind] for kind in ("limit", "branch")}
    return rows, reached, {"points": len(points), "limits": told["limit"], "branches": told["branch"]}


def _along(problem: Problem) -> tuple[Path, str, State | None]:
    """Return a path, why it ends, and the state in which it was lost."""
    path = Path(problem, Effort())
    try:
        return path, path.follow(), None
    except NotFoundError as error:
        return path, str(error), error.state


def _critical(scene: Scene, wish: Wish) -> dict[str, Any]:
    """Return the critical load factors."""
    try:
        found = critical_factors(problem_of(scene, wish.t, None, wish.varied), Effort(), wish.buckling)
    except (NotFoundError, np.linalg.LinAlgError) as error:
        return {"critical": [], "critical_reached": [], "critical_reason": str(error)}
    reason = "" if found else "no load factor makes the stiffness singular"
    return {
        "critical": [one.load for one in found],
        "critical_reached": [one.found for one in found],
        "critical_reason": reason,
    }


def doubtful_factors(scene: Scene, facts: dict[str, Any]) -> list[str]:
    """Return what a user should know of critical load factors before trusting them."""
    found = list[str]()
    pairs = zip(facts.get("critical", ()), facts.get("critical_reached", ()), strict=True)
    if far := [f"{load:.4g}" for load, reached in pairs if not reached]:
        found.append(
            f"the critical load {'factor' if len(far) == 1 else 'factors'} {', '.join(far)}: extrapolated "
            "from smaller loads, not reached, as where a limit point lies before or the scene bends away; "
            "what a larger load with --path crosses is exact"
        )
    stiff = [name for name, model in scene.models.items() if "stiffening" in MODELS[model].leaves_out]
    if "critical" in facts and stiff:
        found.append(
            f"the model {scene.models[stiff[0]]} of {', '.join(stiff)} leaves out that forces along a beam "
            "change its stiffness, and so how it buckles: --model exact has that"
        )
    return found


def _sampled(scene: Scene, wish: Wish, row: _Row) -> StaticSamples:
    """Return the samples of a row, under its loads."""
    own = replace(scene, system=scaled(scene, wish.varied, row.load))
    angles = {name: np.array([angle]) for name, angle in row.angles.items()}
    weight = row.load if wish.varied is None or GRAVITY in wish.varied else 1.0
    return StaticSamples(own, np.array([wish.t]), row.q, np.zeros_like(row.q), angles, weight=weight)


def facts_of(scene: Scene, samples: StaticSamples, found: Equilibrium) -> dict[str, Any]:
    """Return what summaries say of an equilibrium."""
    gaps, unknown = scene.system.residual(samples.t, samples.x), any(undirected(scene.system, samples.x[0]))
    return {
        "kind": METHOD,
        "load": found.share,
        "stable": None if found.reason or unknown else found.stable,
        "smallest_eigenvalue": float(found.values[0]) if len(found.values) and not unknown else None,
        "held_by_nothing": held_by_nothing(scene, found.neutral) if len(found.neutral) else [],
        "relaxed": found.relaxed,
        "limit": found.limit,
        "unstable_from": found.crossed,
        "steps": found.effort.steps,
        "newton_iterations": found.effort.iterations,
        "unknowns": scene.system.n,
        "multipliers": scene.system.n_rows,
        "constraint_position": float(np.abs(gaps).max(initial=0.0)),
        "constraint_velocity": 0.0,
        "error_estimate_reason": NO_ERROR,
        "mesh_error_estimate_reason": NO_MESH,
        "models": scene.models,
        "assembly": scene.assembly.facts(),
        "validity": watch_validity(scene, samples.t, samples.q, samples.v),
        "warnings": [
            *doubts(scene, found, samples.x, float(samples.t[-1])), *singular_rest(scene, samples, found),
            *(() if found.led else turned_joints(scene, float(samples.t[-1]))),
        ],
    }


def failure_of(scene: Scene, t: float, found: Equilibrium) -> SolverFailure:
    """Return why there is no equilibrium at a time [s]; joints that lose their rank on the way come first."""
    failure = why_not(scene, t, found)
    if failure.kind == "model" or found.lost is None or not scene.system.n_rows:
        return failure
    from hfsim.trust.experiments import DEAD, joint_dependence

    x = scene.system.reduction.expand(found.lost.z)
    lost = scene.system.state(x, np.zeros_like(x), scene.q[None])[0][0]
    start, here = (joint_dependence(scene, q) for q in (scene.q, lost))
    if here.size > DEAD * start.size:
        return failure
    names = ", ".join(here.joints)
    return SolverFailure(
        reason=f"no place of rest is found: on the way the equations of joints {names} lose their rank, "
        "as in a dead centre",
        time=t,
        item=f"joints.{here.joints[0]}",
        kind="physical",
        evidence={
            "search": found.reason,
            "smallest_singular_value": here.size,
            "smallest_singular_value_at_start": start.size,
        },
        remedy="start beyond that position (initial), or hold the scene off it by a spring or a stop",
    )


def turned_joints(scene: Scene, t: float) -> Iterator[str]:
    """Yield joints that laws have turned so far until a time [s] that full turns may be missing."""
    for name, joint in scene.deck.joints.items():
        if law := dict(getattr(joint, "laws", ())).get(joint.led_angle):
            begin, end = law.build().value(np.array([0.0, t]))
            if abs(end - begin) > np.pi:
                yield (
                    f"joints.{name} has turned by {end - begin:.4g} rad since the start: full turns are not "
                    "counted on the way, in angles and in what springs and beams exert; "
                    "let its law start there"
                )


def singular_rest(scene: Scene, samples: StaticSamples, found: Equilibrium) -> Iterator[str]:
    """Yield that joint equations have lost their rank where the scene rests, as in a dead centre."""
    if found.reason or not scene.system.n_rows:
        return
    from hfsim.trust.experiments import DEAD, joint_dependence

    start, here = (joint_dependence(scene, q) for q in (scene.q, samples.q[-1]))
    if here.size <= DEAD * start.size:
        yield (
            f"at rest the equations of joints {', '.join(here.joints)} lose their rank, as in a dead centre: "
            "neither their forces, nor the frequency and whether it is stable, are to be relied on"
        )


def out_of_range(scene: Scene, validity: dict[str, Any]) -> Iterator[str]:
    """Yield a line for each beam that is deformed beyond the range of its model."""
    for name, facts in validity.items():
        if facts["left_at"] is not None:
            model, reason = scene.models[name], facts["reason"]
            yield f"body '{name}' is beyond the range of {model}: {reason}; --model exact"
