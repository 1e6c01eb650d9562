"""A scene at rest: which of its forces are loads, how its bodies turn, and what its equilibrium is."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hfsim.deck.laws import Law, StandingLaw
from hfsim.errors import HfsimError, SolverFailure
from hfsim.maths.arrays import Array
from hfsim.maths.rank import others_than
from hfsim.maths.rotations import wrap
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.force import ConstantForce, ForcePart
from hfsim.mechanics.point_loads import Load
from hfsim.mechanics.resistances import Push
from hfsim.mechanics.statics.closing import Closing
from hfsim.mechanics.statics.equilibrium import Equilibrium, Search
from hfsim.mechanics.statics.newton import NotFoundError
from hfsim.mechanics.statics.problem import Problem, State, Weighted
from hfsim.mechanics.statics.relaxation import ENDLESS
from hfsim.mechanics.subset import Subset
from hfsim.mechanics.system import System
from hfsim.mechanics.ties import Tie
from hfsim.parts.bodies.models import MODELS
from hfsim.scene.acting import undirected
from hfsim.scene.assembly import few_of
from hfsim.scene.gauging import Assembled, gauge_of, rigid_motions
from hfsim.scene.measured import Measured, uncounted

FELT = 1e-3
"""Part of the fastest rate that counts as motion of a body."""
GRAVITY = "gravity"
"""Name of the weight among loads that are varied."""


@dataclass(frozen=True)
class FactorLaw(Law):
    """A law of time, or one, times a factor."""

    factor: float
    law: Law | None

    def _derivative(self, t: Array, order: int) -> Array:
        if self.law is None:
            return np.full_like(t, self.factor if order == 0 else 0.0)
        return self.factor * self.law._derivative(t, order)


class Turns:
    """Keeps count of the turns of all bodies on the way of a search.

    Attributes
    ----------
    q : ndarray, shape (1, n)
        State last kept.
    angles : dict of str to float
        Angles of the bodies in the plane whose coordinates do not have them, and of joints and springs that
        channels ask for and nothing else counts [rad].
    """

    def __init__(self, scene: Measured) -> None:
        self._scene = scene
        plane, bodies = scene.deck.dimension == 2, scene.bodies.items()
        own = (name for name, body in bodies if plane and body.angle_column is None)
        self._angle_of: dict[str, Callable[[Array], Array]] = {
            **{name: scene.marker(name).angle for name in own},
            **{name: tie.angle for name, tie in uncounted(scene).items()},
        }
        self.begin()

    def begin(self) -> None:
        """Begin anew where the scene starts."""
        self.q = self._scene.q[None]
        self.angles = {name: self._scene.start_angles[name] for name in self._angle_of}

    def __call__(self, load: float, x: Array) -> None:
        """Go on to coordinates (1, n_x)."""
        self.q = self._scene.system.state(x, np.zeros_like(x), self.q)[0]
        for name, near in self.angles.items():
            self.angles[name] = near + float(wrap(self._angle_of[name](x) - near)[0])


def problem_of(
    scene: Assembled,
    t: float = 0.0,
    turns: Turns | None = None,
    varied: Collection[str] | None = None,
    bodies: Collection[str] | None = None,
    x: Array | None = None,
    moving: bool = False,
) -> Problem:
    """Return the static problem of a scene at a time [s].

    Parameters
    ----------
    turns : Turns, optional
        Told the load factor and the coordinates that are kept on the way, and when the way begins anew.
    varied : collection of str, optional
        Names of the loads and motors that the load factor is of, ``gravity`` among them; all without it.
    bodies : collection of str, optional
        Those that can move; all without it.
    x : ndarray, shape (1, n_x), optional
        Coordinates from which it is sought; those of the start without them.
    moving : bool
        Whether what servos go to counts as moving, as in a steady rotation.
    """
    system, x = scene.system, scene.system.absolute(scene.q[None]) if x is None else x
    if any(part.events for part in system.forces):
        from hfsim.mechanics.once import stand

        stand(system.forces, t)
    z = system.reduction.free(x)
    if bodies is not None:
        still = np.ones(system.n_x, dtype=bool)
        for name in bodies:
            still[scene.bodies[name].columns] = False
        # what several bodies share is held where one of them is
        free = np.asarray(abs(system.reduction.basis)[still].sum(axis=0)).ravel() == 0.0
        part = system.reduction.part(free, z)
        system, z = replace(system, equations=replace(system.equations, reduction=part)), z[:, free]
    forces = list(_weighted(scene, varied, moving))
    if not system.variable_mass:
        forces = [one._replace(part=one.part.in_strains()) for one in forces]
    gauge = gauge_of(scene)
    if (closing := Closing.of(system, np.array([t]), x, gauge.unit)) is not None:
        forces.append(Weighted(closing, 1.0, 0.0))

    def kept(load: float, state: State) -> None:
        reached = system.reduction.expand(state.z)
        if (lost := beyond_mesh(scene, t, reached)) is not None:
            raise NotFoundError(str(lost), state)
        if turns is not None:
            turns(load, reached)

    problem = Problem.of(system, t, z, forces, gauge, kept)
    return problem if turns is None else replace(problem, restart=turns.begin)


def equilibrium_of(
    scene: Assembled, problem: Problem, bodies: Collection[str] | None = None
) -> Equilibrium:
    """Return where a scene, or some bodies of it while the others stay, come to rest, in its coordinates."""
    found = Search(problem, lambda x: rigid_motions(scene, x, bodies)).found()
    return found if bodies is None else found.of_whole(problem, scene.system.reduction)


def beyond_mesh(scene: Assembled, t: float, x: Array) -> SolverFailure | None:
    """Return why elements of a body mean nothing in a state (1, n_x), if they do not."""
    every = (body.beyond_mesh(t, x) for body in scene.bodies.values())
    return next((one for one in every if one is not None), None)


def _load(part: ForcePart) -> str:
    """Return the name of a load or motor; empty for what is none."""
    kind, _, name = part.item.partition(".")
    if kind == "loads":
        return name
    pushes = isinstance(part, Tie) and all(isinstance(one, Push) for one in part.resistances)
    return name if pushes and kind == "joints" else ""


def _standing(part: ForcePart) -> ForcePart:
    """Return a force at rest: without rates at which what it goes to moves on."""
    if not isinstance(part, Tie) or not part.laws:
        return part
    return replace(part, resistances=tuple(one.standing() for one in part.resistances))


def _halted(constraint: Constraint) -> Constraint:
    """Return a joint equation whose law stands still wherever it has come to."""
    if isinstance(constraint, Subset):
        return Subset.of(_halted(constraint.whole), constraint.kept)
    return replace(constraint, law=StandingLaw(constraint.law)) if constraint.law else constraint


def standing(system: System, moving: bool = False) -> System:
    """Return the equations of what lasts: the laws of joints stand still, and those of servos if not moving.

    Their accelerations would load joints, and so add to the stiffness.
    """
    forces = system.forces if moving else tuple(map(_standing, system.forces))
    if not system.driven:
        return replace(system, forces=forces)
    constraints = tuple(map(_halted, system.constraints))
    return replace(system, forces=forces, equations=replace(system.equations, all_constraints=constraints))


def _weighted(scene: Assembled, varied: Collection[str] | None, moving: bool) -> Iterator[Weighted]:
    """Yield all forces with their factors."""
    heavy = varied is None or GRAVITY in varied
    for part in standing(scene.system, moving).together:
        name = _load(part)
        if (name and (varied is None or name in varied)) or (heavy and isinstance(part, ConstantForce)):
            yield Weighted(part, 0.0, 1.0)
        elif heavy and hasattr(part, "gravity") and any(part.gravity):
            # its weight is no force by itself
            light: Any = part
            yield Weighted(part, 0.0, 1.0)
            yield Weighted(replace(light, gravity=(0.0,) * len(light.gravity)), 1.0, -1.0)
        else:
            yield Weighted(part, 1.0, 0.0)


def scaled(scene: Assembled, varied: Collection[str] | None, factor: float) -> System:
    """Return the equations of a scene at rest with all loads that are varied scaled."""
    system = standing(scene.system)
    if factor == 1.0:
        return system
    heavy = varied is None or GRAVITY in varied
    found: list[ForcePart] = []
    for part in system.forces:
        name, own = _load(part), part
        if name and (varied is None or name in varied):
            if isinstance(part, Tie):
                pushes = (one for one in part.resistances if isinstance(one, Push))
                own = replace(part, resistances=tuple(replace(one, size=factor * one.size) for one in pushes))
            elif isinstance(part, Load):
                law: Any = {"law": FactorLaw(factor, part.law)}
                own = replace(part, **law)
        elif heavy and isinstance(part, ConstantForce):
            own = replace(part, values=factor * part.values, energy=factor * part.energy)
        elif heavy and hasattr(part, "gravity"):
            light: Any = part
            own = replace(light, gravity=tuple(factor * one for one in light.gravity))
        found.append(own)
    return replace(system, forces=tuple(found))


def loads_of(scene: Assembled) -> list[str]:
    """Return the names of all that a load factor can be of: loads, motors, and gravity."""
    names = {name for part in scene.system.forces if (name := _load(part))}
    return sorted(names | ({GRAVITY} if any(scene.deck.gravity) else set()))


# --- what to say of it ----------------------------------------------------------------------------


def held_by_nothing(scene: Assembled, motions: Array) -> list[str]:
    """Return in words the free motions, nearest to the ground, that motions (k, n) are made of."""
    u = scene.system.reduction.expand_rates(motions) / gauge_of(scene).broad
    u = u / np.abs(u).max(axis=1, keepdims=True)
    bodies = scene.bodies.items()
    moving = [name for name, body in bodies if np.abs(u[:, body.columns]).max(initial=0.0) > FELT]
    told, left = list[str](), np.ones(len(u), dtype=bool)
    for one in scene.free_motions or ():
        columns = scene.bodies[one.body].columns
        moved = np.flatnonzero(left & u[:, columns].any(axis=1))
        mixed, sizes, _ = np.linalg.svd(u[moved, columns], full_matrices=False)
        number = min(int(np.sum(sizes > FELT)), one.number)
        if number:
            told.append(str(one) if number == one.number else f"{one} ({number} of these)")
            # the others, in which this body stands still
            u[moved[number:]], left[moved[:number]] = others_than(mixed[:, :number], u[moved]), False
    return told or moving


def one_of_many(scene: Assembled, motions: Array) -> str:
    """Return in a sentence that motions (k, n) lead from an equilibrium to others."""
    return f"one equilibrium of many, since nothing resists: {few_of(held_by_nothing(scene, motions), '; ')}"


def doubts(scene: Assembled, found: Equilibrium, x: Array, t: float = 0.0) -> Iterator[str]:
    """Yield what a user should know of an equilibrium, at coordinates (1, n_x), before trusting it."""
    if found.reason:
        return
    for item, what in undirected(scene.system, x[0]):
        yield f"{item} has {what}: neither frequencies, nor whether it is stable, are to be relied on"
    yield from passed(scene, x, t)
    if not found.stable:
        time = 1.0 / float(np.sqrt(-found.values[0]))
        since, remedy = "", "a start a little beside it (initial), or a small load across, leads away from it"
        if found.crossed is not None:
            since = f" from {found.crossed:.4g} of the loads on"
            remedy = (
                "a smaller load, or, unless it swings as it grows, a small load across, leads to one that is"
            )
        yield f"the equilibrium is not stable{since}: a small push grows e-fold in {time:.3g} s; {remedy}"
    elif not found.complete:
        yield "whether it is stable is not certain: of so many motions an unstable one may have been missed"
    elif found.crossed is not None:
        yield (
            f"from {found.crossed:.4g} of the loads on, places of rest on the way are not stable: "
            "hfsim static --path tells what is crossed"
        )
    if len(found.neutral):
        yield one_of_many(scene, found.neutral)
    if found.limit:  # at none of the loads nothing says that they cannot be put on
        yield (
            f"beyond {found.limit:.4g} of the loads the scene snaps to another place: "
            "hfsim static --path tells what is between"
        )
    if found.others:
        yield "the scene has another place of rest: hfsim static --path leads there from a rest without loads"


_PASSED = {
    "latches": "rests beyond the place of its latch, which would have caught on the way: "
    "start it at that place (initial), where it is caught, to see where it rests then",
    "releases": "bears more at rest than it can, and would have let go on the way: "
    "state 'release: {time: 0}' to see where the scene rests without it",
}


def passed(scene: Assembled, x: Array, t: float) -> Iterator[str]:
    """Yield which latches are open, and which springs hold, though in a state (1, n_x) they would not."""
    forces = scene.system.forces
    if any(part.events for part in forces):
        from hfsim.mechanics.once import events_of

        for event, ties in events_of(forces):
            if event.side[0] * event.past(ties, np.array([t]), x, 0.0 * x)[0] < 0.0:
                yield f"{event.item(ties)} {_PASSED[event.told]}"


def _rests_with(scene: Assembled, models: dict[str, str], t: float) -> bool:
    """Tell whether the scene comes to rest at a time [s] with other models of some beams."""
    try:
        other = scene.remade(models)
        # what starts from where it rests has found that place
        begun = t == 0.0 and bool(scene.deck.resting or scene.deck.steady)
        return begun or not equilibrium_of(other, problem_of(other, t)).reason
    except (HfsimError, np.linalg.LinAlgError):
        return False


def why_not(scene: Assembled, t: float, found: Equilibrium) -> SolverFailure:
    """Return why there is no equilibrium at a time [s], with what to try."""
    lost = found.lost or found.state
    x = scene.system.reduction.expand(lost.z)
    if (failure := beyond_mesh(scene, t, x)) is not None:
        return failure
    for part in scene.system.forces:
        if part.runs_away and (away := part.runaway(t, x)) is not None:
            remedy = "hfsim static with --model exact, or a smaller load"
            reason = f"{away.reason} and finds no rest"
            return SolverFailure(reason, t, away.item, "model", away.evidence, remedy, away.cause)
    if found.limit:
        reason = f"the loads can be put on to {found.limit:.4g} of their size, and beyond no rest is found"
        remedy = "--path follows the load through its limit; --set changes a load"
        return SolverFailure(reason, t, evidence={"load": found.limit, "search": found.reason}, remedy=remedy)
    rough = [name for name, model in scene.models.items() if MODELS[model].truncated]
    if rough and (found.reason == ENDLESS or _rests_with(scene, dict.fromkeys(rough, "exact"), t)):
        models = " and ".join(dict.fromkeys(scene.models[name] for name in rough))
        reason = f"no place of rest is found with the model {models} of {', '.join(rough)}"
        remedy = "the model exact" if found.reason == ENDLESS else "the model exact: with it there is one"
        evidence = {"search": found.reason}
        return SolverFailure(reason, t, f"bodies.{rough[0]}", "model", evidence, remedy)
    if len(found.neutral):
        names = held_by_nothing(scene, found.neutral)
        reason = f"nothing holds what the loads push: {few_of(names, '; ')}"
        remedy = "a spring, a servo or a joint that holds it, or no load along it"
        body = names[0].partition(":")[0]
        return SolverFailure(reason, t, f"bodies.{body}", "deck", {"search": found.reason}, remedy)
    reason = f"no place of rest is found: {found.reason}"
    remedy = "start nearer to it (initial), or damp the scene and run it until it rests"
    return SolverFailure(reason, t, evidence={"search": found.reason}, remedy=remedy)
