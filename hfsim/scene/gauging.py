"""How the bodies of a scene can move, each by itself, and by what changes of it are measured."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from hfsim.maths.arrays import Array, BoolArray, IntArray
from hfsim.maths.matrices import Matrix, is_sparse
from hfsim.mechanics.body import Body, VectorBody
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.statics.gauge import Gauge
from hfsim.mechanics.system import System
from hfsim.parts.resistances import SlidingResistanceSpec
from hfsim.scene.assembly import Assembly
from hfsim.scene.freedom import FreeMotion
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.rules import connected, owners
from hfsim.scene.schema import Deck


class Assembled(Protocol):
    """What an equilibrium needs of a scene; see `hfsim.scene.build.Scene`."""

    @property
    def loaded(self) -> LoadedDeck:
        """The deck with its places."""

    @property
    def deck(self) -> Deck:
        """The deck."""

    @property
    def system(self) -> System:
        """The equations."""

    @property
    def bodies(self) -> Mapping[str, Body]:
        """Bodies by their names."""

    @property
    def models(self) -> Mapping[str, str]:
        """Model of each beam."""

    @property
    def q(self) -> Array:
        """State at the start, (n,)."""

    @property
    def start_angles(self) -> Mapping[str, float]:
        """Angles of body frames there [rad]."""

    @property
    def assembly(self) -> Assembly:
        """How the bodies were put together."""

    @property
    def rigid_inertia(self) -> Array:
        """Mass matrices of the bodies taken as rigid, (n_bodies, k, k)."""

    @property
    def free_motions(self) -> Sequence[FreeMotion] | None:
        """What the joints leave free."""

    def marker(self, point: str) -> Marker:
        """Return the marker of a point."""

    def remade(self, models: Mapping[str, str]) -> Assembled:
        """Return the scene with other models of some beams."""


def rigid_motions(scene: Assembled, x: Array, bodies: Collection[str] | None = None) -> Array:
    """Return the motions of each body, or of some, by itself from coordinates (1, n_x) on, (k, n_x)."""
    found = [np.zeros((0, x.shape[1]))]
    for name, body in scene.bodies.items():
        if not body.still and (bodies is None or name in bodies):
            own = body.freedoms(x[0], scene.start_angles[name])
            motions = np.zeros((len(own), x.shape[1]))
            motions[:, body.columns] = own
            found.append(motions)
    return np.concatenate(found)


def gauge_of(scene: Assembled, q: Array | None = None) -> Gauge:
    """Return by what changes of a scene in a state (n,) are measured: at the start without any."""
    system, x = scene.system, scene.system.absolute((scene.q if q is None else q)[None])
    n_dim, moving = scene.deck.dimension, [body for body in scene.bodies.values() if not body.still]
    outlines = {name: body.extent(x)[0] for name, body in scene.bodies.items()}
    every = np.concatenate([*outlines.values(), *(np.array([p]) for p in scene.deck.ground.points.values())])
    moves = np.array([not body.still for body in scene.bodies.values()])
    inertia = scene.rigid_inertia[moves].diagonal(axis1=1, axis2=2)
    masses, turned = inertia[:, :n_dim].max(axis=1), inertia[:, n_dim:].max(axis=1)
    span = max(_reach(scene, x, every), float(np.sqrt(turned / masses).max(initial=0.0)))
    least, part = 1e-2 * (float(np.ptp(every, axis=0).max()) or span), _parts(scene, moving)
    alone, together = _extents([outlines[body.name] for body in moving], part, n_dim)
    tied = turned + masses * np.maximum(together, least) ** 2
    places = [_places(body) for body in moving]
    axes = [one.sections.reshape(-1, 3) for body in moving if (one := body.carried()) is not None]
    directions = [_directions(body) for body in moving]
    turning = np.zeros(system.n_x)
    for columns in directions:
        turning[columns] = 1.0 / max(1, len(columns))
    lengths = [columns.shape[1] for columns in directions for _ in columns]
    return Gauge(
        metric=_metric(system, x),
        starts=np.array([body.columns.start for body in moving]),
        sizes=turned + masses * np.maximum(alone, least) ** 2,
        tied=tied,
        shared=_sums(part, tied),
        members=_sums(part),
        places=_joined(places, n_dim),
        placed=np.cumsum([0, *map(len, places)])[:-1],
        masses=masses,
        axes=_joined(axes, 3),
        directions=np.concatenate([np.zeros(0, dtype=np.intp), *(one.ravel() for one in directions)]),
        firsts=np.cumsum([0, *lengths])[:-1],
        bare=np.array([not len(one) for one in directions]),
        wide=turned + masses * span**2,
        turning=turning,
    )


def units_of(scene: Assembled) -> Array:
    """Return by what coordinates change at large, (n_x,): lengths by the size of their body."""
    gauge, units = gauge_of(scene), np.ones(scene.system.n_x)
    sizes = np.sqrt(gauge.sizes / gauge.masses)
    moving = (body for body in scene.bodies.values() if not body.still)
    for body, size in zip(moving, sizes, strict=True):
        units[body.columns][_are_lengths(body)] = size
    return units


def lengths_of(scene: Assembled) -> BoolArray:
    """Tell which coordinates are lengths, not angles, slopes or directions, (n_x,)."""
    lengths = np.zeros(scene.system.n_x, dtype=bool)
    for body in scene.bodies.values():
        lengths[body.columns] = _are_lengths(body)
    return lengths


def _metric(system: System, x: Array) -> Matrix:
    """Return the mass matrix in a state (1, n_x), with an inverse."""
    equations = system.equations
    if system.variable_mass:
        return np.asarray(equations.mass(x)[0])
    ballast = equations.ballast
    whole = equations.constant_mass if ballast is None else equations.constant_mass + ballast
    return whole.tocsr() if is_sparse(whole) else whole


def _parts(scene: Assembled, moving: Sequence[Body]) -> IntArray:
    """Return to which part of a scene, of those that joints and springs tie, each body belongs, (n_bodies,).

    Bodies that can touch others, which they are not to pass through unseen, are parts by themselves.
    """
    names = [body.name for body in moving]
    contacts = (one for one in scene.deck.springs.values() if one.type == "contact")
    touching = {name for one in contacts for name in owners(one)}
    groups = connected(scene.deck, scene.bodies.keys() - set(names), without="contact")
    part = {name: k for k, group in enumerate(groups) for name in group}
    part.update({name: len(groups) + k for k, name in enumerate(touching)})
    numbers: dict[int, int] = {}
    return np.array([numbers.setdefault(part[name], len(numbers)) for name in names], dtype=np.intp)


def _extents(outlines: Sequence[Array], part: IntArray, n_dim: int) -> tuple[Array, Array]:
    """Return how large bodies with such outlines are, and the parts that they belong to, (n_bodies,)."""
    corners = np.array([[-one.min(axis=0), one.max(axis=0)] for one in outlines]).reshape(-1, 2, n_dim)
    whole = np.full_like(corners, -np.inf)  # more rows than there are parts
    np.maximum.at(whole, part, corners)
    alone, together = (one.sum(axis=1).max(axis=1) for one in (corners, whole[part]))
    return alone, together


def _sums(part: IntArray, values: Array | None = None) -> Array:
    """Return for each body the sum over its part, by default of ones, (n_bodies,)."""
    return np.asarray(np.bincount(part, values)[part], dtype=float)


def _joined(columns: Sequence[IntArray], width: int) -> IntArray:
    return np.concatenate([np.zeros((0, width), dtype=np.intp), *columns])


def _places(body: Body) -> IntArray:
    """Return the coordinates that change alike where a body shifts, (n, n_dim)."""
    columns = body.position_columns
    return columns if len(columns) else body.columns.start + np.arange(body.n_dim)[None]


def _reach(scene: Assembled, x: Array, outlines: Array) -> float:
    """Return how large a scene with outlines (k, n_dim) is at coordinates (1, n_x), with all that is tied."""
    ties = [*scene.deck.joints.values(), *scene.deck.springs.values()]
    ends = {end for one in ties for end in getattr(one, "between", ())}
    every = np.concatenate([outlines, *(scene.marker(end).position(x) for end in ends)])
    return max([float(np.ptp(every, axis=0).max()), *(length for one in ties for length in _lengths(one))])


def _lengths(tie: Any) -> Iterator[float]:
    """Yield the lengths up to which, or to which, a joint or spring lets its ends go without a force."""
    for law in (getattr(tie, "rest_length", None), getattr(tie, "position", None)):
        if law is not None and law.constant is not None:
            yield abs(law.constant)
    for one in (tie, getattr(tie, "sliding", None)):
        if isinstance(one, SlidingResistanceSpec) and one.stops:
            yield from (abs(limit) for limit in (one.stops.lower, one.stops.upper) if limit is not None)


def _are_lengths(body: Body) -> BoolArray:
    """Tell which coordinates of a body are lengths, not angles, slopes or directions, (n_columns,)."""
    if body.variable_mass is not None:
        return body.variable_mass.lengths
    if isinstance(body, VectorBody):
        return np.repeat(body.positions > 0.0, body.n_dim)
    return np.arange(body.columns.stop - body.columns.start) < body.n_dim


def _directions(body: Body) -> IntArray:
    """Return the coordinates of vectors that turn with a body, (n_directions, n_dim), or of its angle."""
    if isinstance(body, VectorBody):
        columns = np.arange(body.columns.start, body.columns.stop).reshape(-1, body.n_dim)
        return np.asarray(columns[body.positions == 0.0])
    if body.angle_column is not None:
        return np.array([[body.angle_column]])
    own = body.carried()
    return np.zeros((0, 3), dtype=np.intp) if own is None else own.sections.reshape(-1, 3)
