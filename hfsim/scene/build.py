"""From a deck to an assembled scene: coordinates numbered, names resolved, equations put together."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property, partial
from typing import Any, NamedTuple, TypeVar

import numpy as np

from hfsim.integrators import Recordings, steps_in_absolute_coordinates
from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import assemble, dense_up_to
from hfsim.mechanics.body import Body
from hfsim.mechanics.chart import side_by_side
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.elimination import eliminate
from hfsim.mechanics.equations import Equations
from hfsim.mechanics.force import merged
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.pose import Twist
from hfsim.mechanics.system import System
from hfsim.parts.bodies.models import Model
from hfsim.scene.acting import acting, thrown
from hfsim.scene.assembly import Assembly
from hfsim.scene.closing import Linkage
from hfsim.scene.facing import Facings
from hfsim.scene.freedom import FreeMotion, free_motions, slips
from hfsim.scene.gauging import gauge_of, units_of
from hfsim.scene.joining import joints_of, linkage_of, start_of
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.measured import coordinate_of, refuse_unread, start_turns, ties_of
from hfsim.scene.memory import refuse_too_large
from hfsim.scene.points import find_marker
from hfsim.scene.redundancy import Redundancy, redundancy
from hfsim.scene.rules import LeftOut, apply_rules, connected, keeps, owners, still_bodies
from hfsim.scene.schema import Deck
from hfsim.scene.stepping import kinds_of, stepping, unread

_Found = TypeVar("_Found")


@frozen
class Scene:
    """A deck with a model for each of its beams, ready to be simulated.

    Attributes
    ----------
    model : str
        Of the beams that have none of their own.
    models : dict of str to str
        Model of each beam.
    joints : dict of str to tuple of int
        Which constraints of the system each joint is made of.
    q, v : ndarray, shape (n,)
        State at the start, consistent with the joints.
    start_angles : dict of str to float
        Those of body frames, and of `measured.uncounted`, with the full turns that the deck states [rad].
    left_out : LeftOut
        What the rules found that the scene does not need.
    assembly : Assembly
        How the bodies were put together.
    facings : Facings
        How they face each other there.
    redundancy : Redundancy
        What the joints hold more than once.
    rest : tuple of str
        What is to be told of the equilibrium that it starts from.
    begin : float
        When it starts: later than at 0 where it goes on from another scene with other models [s].
    """

    loaded: LoadedDeck
    model: str
    models: dict[str, str]
    system: System
    bodies: dict[str, Body]
    joints: dict[str, tuple[int, ...]]
    q: Array
    v: Array
    start_angles: dict[str, float]
    left_out: LeftOut
    assembly: Assembly
    facings: Facings
    redundancy: Redundancy
    rest: tuple[str, ...] = ()
    begin: float = 0.0

    @property
    def deck(self) -> Deck:
        """The deck."""
        return self.loaded.deck

    @cached_property
    def recordings(self) -> Recordings:
        """What is replayed of the equations, for all integrations of the scene, which keep it here."""
        return Recordings()

    @cached_property
    def free_motions(self) -> list[FreeMotion] | None:
        """What the joints leave free at the start, bodies taken as rigid; None in large mechanisms."""
        held = replace(self.assembly, linkage=self._held) if self._lines else self.assembly
        return free_motions(held, self._rigid_energy, self._lines)

    @cached_property
    def _lines(self) -> tuple[str, ...]:
        """Bodies that are lines without sections in space."""
        spatial, specs = self.deck.dimension == 3, self.deck.bodies
        return tuple(name for name in self.bodies if spatial and not specs[name].sectioned)

    @cached_property
    def _held(self) -> Linkage:
        """The joints between frames of which they hold no more than of the bodies."""
        return linkage_of(self.deck, self.bodies, self.facings, self._lines)

    @cached_property
    def rigid_inertia(self) -> Array:
        """Mass matrices (n_bodies, k, k) of the bodies' frames at the start, bodies taken as rigid."""
        x, units = self.system.absolute(self.q[None]), list(Twist.units(self.deck.dimension))
        u = np.zeros((len(units), x.shape[1]))
        for body, pose in zip(self.bodies.values(), self.assembly.poses.values(), strict=True):
            u[:, body.columns] = [body.moving(pose, unit) for unit in units]
        momentum = self.system.equations.momentum(x, u)
        return np.stack([momentum[:, b.columns] @ u[:, b.columns].T for b in self.bodies.values()])

    def _rigid_energy(self, rates: Array) -> float:
        """Return the kinetic energy [J] of frames that move at rates (n,) at the start."""
        rows = rates.reshape(len(self.bodies), 1, -1)
        moving = np.flatnonzero(rows.any(axis=2))
        return float(0.5 * np.sum(rows[moving] @ self.rigid_inertia[moving] * rows[moving]))

    @cached_property
    def warnings(self) -> list[str]:
        """What looks wrong: slips in the deck, guesses far off, free motions hardly meant to be so."""
        found, at_start = [*self.loaded.warnings, *self.assembly.warnings()], not self.begin
        doubtful, off = (self._doubtful(), self._thrown()) if at_start else ((), ())
        told = (*unread(self.loaded), *doubtful, *self.redundancy.told(self.loaded), *self._not_borne(), *off)
        for path, what in told:
            line = self.loaded.line_of(path)
            found.append(f"{path}{f' (line {line})' if line else ''}: {what}")
        return [*found, *(self.rest if at_start else ())]

    def _thrown(self) -> Iterator[tuple[str, str]]:
        """Yield, with the deck path, what throws it off at the start."""
        resting = [self.bodies[name] for name in self.deck.resting if name in self.bodies]
        yield from thrown(self.system, self.system.absolute(self.q[None])[0], resting)

    def _doubtful(self) -> Iterator[tuple[str, str]]:
        """Yield, with the deck path, what of the start hardly can be meant."""
        yield from slips(self.deck, self.assembly, self.free_motions or [])
        if self.deck.springs or self.deck.dimension == 3:
            from hfsim.scene.doubtful import doubtful

            yield from doubtful(self)

    def _not_borne(self) -> Iterator[tuple[str, str]]:
        """Yield, with the deck path, what lines without sections would need them for."""
        if self._lines:
            from hfsim.scene.spatial_lines import rolled, twisting, untwisted

            yield from untwisted(self.assembly, self._held, self._lines)
            yield from (one for of in (twisting, rolled) for one in of(self.deck, self.assembly, self._lines))

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """Parts that nothing connects and that are integrated by themselves; none where all is one."""
        if not self.left_out.fires("parts"):
            return ()
        still = still_bodies(self.deck, _kinds(self.loaded, self.models))
        return tuple(_part(self, group, still) for group in connected(self.deck, still))

    @cached_property
    def units(self) -> Array:
        """By what coordinates change at large, (n_x,): lengths by the size of their body, others by one."""
        return units_of(self)

    def remade(self, models: Mapping[str, str]) -> Scene:
        """Return the scene with other models of some beams."""
        return build(self.loaded, self.model, {**self.models, **models})

    def marker(self, point: str, held: bool = False) -> Marker:
        """Return the marker of a point such as ``b1.tip``, or what a joint holds there."""
        return self.kept((point, held), lambda: find_marker(point, self.bodies, self.deck, held))

    def ties(self, name: str) -> tuple[Any, ...]:
        """Return what a joint or a spring exerts on its coordinates."""
        return self.kept(("ties", name), lambda: ties_of(self, name))

    def coordinate(self, name: str, unit: str) -> Any:
        """Return what measures the angle (``rad``) or the distance (``m``) of a joint or a spring."""
        return self.kept((unit, name), lambda: coordinate_of(self, name, unit))

    def kept(self, key: tuple[Any, ...], find: Callable[[], _Found]) -> _Found:
        """Return what is found under a key, once."""
        known: dict[tuple[Any, ...], _Found] = self._known
        if key not in known:
            known[key] = find()
        return known[key]

    @cached_property
    def _known(self) -> dict[tuple[Any, ...], Any]:
        return {}


class Part(NamedTuple):
    """A part of a scene that nothing connects to the rest.

    Attributes
    ----------
    scene : Scene
        The part alone.
    columns : ndarray of int
        Where its state stands in that of the whole scene.
    """

    bodies: tuple[str, ...]
    scene: Scene
    columns: IntArray


FALLBACK = "exact"
"""Model of beams whose model is to be chosen in the run, where nothing chooses."""


def build(loaded: LoadedDeck, model: str | None = None, models: Mapping[str, str] | None = None) -> Scene:
    """Assemble a scene.

    Parameters
    ----------
    model : str, optional
        Instead of the deck's ``solve.model``; beams with a model of their own keep it.
    models : mapping of str to str, optional
        Models of some beams, whatever the deck says.

    Raises
    ------
    DeckError
        If the initial state contradicts the joints, joints are redundant, or it would not fit into memory.
    """
    deck = loaded.deck
    name = model or deck.solve.model
    named = deck.models(name) | dict(models or {})
    named = {beam: FALLBACK if one == "auto" else one for beam, one in named.items()}
    kinds = _kinds(loaded, named)
    bodies = _bodies(deck, kinds)
    refuse_too_large(loaded, bodies)
    start, facings = start_of(loaded, bodies)
    joints, constraints = joints_of(deck, bodies, facings)
    every = tuple(zip(bodies.values(), start.poses.values(), start.twists.values(), strict=True))
    x = np.concatenate([body.placed(pose) for body, pose, _ in every])
    u = np.concatenate([body.moving(pose, twist) for body, pose, twist in every])
    angles = {name: pose.angle for name, pose in start.poses.items()}
    left_out = apply_rules(deck, kinds)
    if left_out.fires("fixed_bodies"):
        still = still_bodies(deck, kinds)
        moving = _moving_columns(bodies, still)
        folded = {name: bodies[name].folded(start.poses[name]) for name in still}
        bodies = _bodies(deck, kinds, folded)
        joints, constraints = joints_of(deck, bodies, facings, left_out)
        x, u = x[moving], u[moving]
    elif left_out.fires("standing_drivers"):
        joints, constraints = joints_of(deck, bodies, facings, left_out)
    system = _system(deck, bodies, facings, constraints, left_out, x, angles)
    near = np.zeros((1, system.n_x))
    for body in bodies.values() if system.charts else ():
        if body.angle_column is not None:
            near[0, body.angle_column] = angles[body.name]
    q, v = system.state(x[None], u[None], system.reduction.free_rates(near))
    args = loaded, name, named, system, bodies, joints, q[0], v[0], angles, left_out, start, facings
    scene = Scene(*args, Redundancy())
    found = redundancy(loaded, system, joints, x, gauge_of(scene))
    system = system.without(found.left_out) if found.left_out else system
    q, v = system.project(np.zeros(1), q, v)
    scene = replace(scene, system=system, q=q[0], v=v[0], redundancy=found)
    refuse_unread(loaded, scene)
    scene = replace(scene, start_angles={**angles, **start_turns(scene)})
    if deck.resting or deck.steady is not None:
        from hfsim.scene.resting import at_rest

        return replace(scene, **at_rest(scene)._asdict())
    return scene


def _kinds(loaded: LoadedDeck, models: Mapping[str, str]) -> dict[str, Model]:
    for beam, one in models.items():
        if lacks := loaded.deck.bodies[beam].lacking(one, loaded.deck.dimension):
            raise loaded.problem(f"bodies.{beam}", *lacks)
    kinds, method = kinds_of(loaded.deck, models), loaded.deck.solve.method
    for beam, kind in kinds.items():
        if kind.varying_mass and steps_in_absolute_coordinates(method):
            why = f"{method} needs a constant mass matrix, and that of {models[beam]} changes with the motion"
            raise loaded.problem("solve.method", why, "take gauss, or another model")
    return kinds


def _part(scene: Scene, group: tuple[str, ...], still: tuple[str, ...]) -> Part:
    deck, there = scene.deck, {"ground", *group, *still}

    def tied(entries: dict[str, Any]) -> dict[str, Any]:
        return {k: e for k, e in entries.items() if owners(e) <= there}

    update = {
        "bodies": {name: spec for name, spec in deck.bodies.items() if name in there},
        "joints": tied(deck.joints),
        "springs": tied(deck.springs),
        "loads": {k: load for k, load in deck.loads.items() if load.owner in there},
        "initial": deck.initial_of(there),
        "solve": deck.solve.model_copy(update={"coordinates": stepping(deck, scene.models)}),
    }
    own = {name: model for name, model in scene.models.items() if name in there}
    part = build(LoadedDeck(deck.model_copy(update=update), scene.loaded.source), scene.model, own)
    columns = [np.arange(scene.bodies[n].columns.start, scene.bodies[n].columns.stop) for n in group]
    x_columns, of_x = np.concatenate(columns), np.zeros(scene.system.n_x, dtype=np.intp)
    of_x[scene.system.reduction.rows] = np.arange(scene.system.n)
    return Part(group, part, of_x[x_columns[part.system.reduction.rows]])


def _moving_columns(bodies: dict[str, Body], still: tuple[str, ...]) -> IntArray:
    moving = (body.columns for name, body in bodies.items() if name not in still)
    return np.concatenate([np.arange(columns.start, columns.stop) for columns in moving])


def _bodies(
    deck: Deck, models: Mapping[str, Model], folded: Mapping[str, Body] | None = None
) -> dict[str, Body]:
    """Number the coordinates: each body that is not folded has a run of its own in x."""
    bodies, at = dict(folded or {}), 0
    for name, spec in deck.bodies.items():
        if name not in bodies:
            bodies[name] = spec.assemble(name, at, deck, models.get(name))
            at = bodies[name].columns.stop
    return {name: bodies[name] for name in deck.bodies}


def _system(
    deck: Deck,
    bodies: dict[str, Body],
    facings: Facings,
    constraints: tuple[Constraint, ...],
    left_out: LeftOut,
    x: Array,
    angles: Mapping[str, float],
) -> System:
    n, every = len(x), bodies.values()
    moving = {name: body for name, body in bodies.items() if not body.still}
    eliminated = partial(eliminate, moving, () if keeps(deck, "tree_joints") else constraints, x=x)
    # of all coordinates first: sparse matrices, with which it is known what is left, take an import
    sparse = not _few(n, constraints, deck.dimension) and all(body.banded for body in every)
    free = eliminated(sparse=sparse)
    left = tuple(one for k, one in enumerate(constraints) if k not in free.reduction.eliminated)
    if sparse and deck.dimension == 2 and _few(len(free.reduction.rows), left, 2):
        sparse, free = False, eliminated(sparse=False)
    mass = assemble([body.mass_entries() for body in every], (n, n), sparse)
    variable = tuple(one for body in every if (one := body.variable_mass) is not None)
    own = (part for body in every for part in body.forces(n))
    needed = (part for part in own if not (part.idle and left_out.fires(part.rule)))
    charts = side_by_side(body.chart() for body in every)
    at = partial(find_marker, bodies=bodies, deck=deck, held=True)
    lacking = [body.ballast() for body in every]
    ballast = assemble(lacking, (n, n), sparse) if any(one.values.size for one in lacking) else None
    once = left_out.fires("constant_mass")
    return System(
        charts=tuple(chart.at(free.reduction.free_columns(chart.columns)) for chart in charts),
        forces=(*merged(needed), *acting(deck, bodies, facings, at, left_out, x, angles)),
        equations=Equations(mass, variable, constraints, free.reduction, once, ballast),
        natural=free.increments(every),
        keeps_rates=not left_out.fires("rates"),
        keeps_work=not left_out.fires("work"),
    )


def _few(coordinates: int, constraints: tuple[Constraint, ...], n_dim: int) -> bool:
    """Tell whether there are so few coordinates that dense matrices are the faster ones."""
    return coordinates <= dense_up_to(coordinates, sum(one.rows for one in constraints), n_dim)
