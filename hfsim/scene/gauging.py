"""By what changes of a scene are measured, without a unit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.matrices import is_sparse
from hfsim.mechanics.body import Body, VectorBody
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.statics.gauge import Gauge
from hfsim.mechanics.system import System
from hfsim.parts.resistances import SlidingResistanceSpec
from hfsim.scene.assembly import Assembly
from hfsim.scene.freedom import FreeMotion
from hfsim.scene.loading import LoadedDeck
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


def gauge_of(scene: Assembled, q: Array | None = None) -> Gauge:
    """Return by what changes of a scene in a state (n,) are measured: at the start without any."""
    system, x = scene.system, scene.system.absolute((scene.q if q is None else q)[None])
    equations, n_dim = system.equations, scene.deck.dimension
    if system.variable_mass:
        metric = equations.mass(x)[0]
    else:
        metric = equations.constant_mass
        metric = metric if equations.ballast is None else metric + equations.ballast
    bodies = [(k, body) for k, body in enumerate(scene.bodies.values()) if not body.still]
    outlines = [body.extent(x)[0] for body in scene.bodies.values()]
    every = np.concatenate([*outlines, *(np.array([p]) for p in scene.deck.ground.points.values())])
    inertia = scene.rigid_inertia[[k for k, _ in bodies]].diagonal(axis1=1, axis2=2)
    masses, turned = inertia[:, :n_dim].max(axis=1), inertia[:, n_dim:].max(axis=1)
    span = max(_reach(scene, x, every), float(np.sqrt(turned / masses).max(initial=0.0)))
    whole = float(np.ptp(every, axis=0).max()) or span
    own = np.array([max(float(np.ptp(outlines[k], axis=0).max()), 1e-2 * whole) for k, _ in bodies])
    starts = np.array([body.columns.start for _, body in bodies])
    axes: list[IntArray] = [np.zeros((0, 3), dtype=np.intp)]
    axes += [one.sections.reshape(-1, 3) for _, body in bodies if (one := body.carried()) is not None]
    turning, directions = np.zeros(system.n_x), [_directions(body) for _, body in bodies]
    for columns in directions:
        turning[columns] = 1.0 / max(1, len(columns))
    lengths = [columns.shape[1] for columns in directions for _ in columns]
    return Gauge(
        metric=metric.tocsr() if is_sparse(metric) else metric,
        starts=starts,
        sizes=turned + masses * own**2,
        axes=np.concatenate(axes),
        directions=np.concatenate([np.zeros(0, dtype=np.intp), *(one.ravel() for one in directions)]),
        firsts=np.cumsum([0, *lengths])[:-1],
        bare=np.array([not len(one) for one in directions]),
        wide=turned + masses * span**2,
        turning=turning,
    )


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


def _directions(body: Body) -> IntArray:
    """Return the coordinates of vectors that turn with a body, (n_directions, n_dim), or of its angle."""
    if isinstance(body, VectorBody):
        columns = np.arange(body.columns.start, body.columns.stop).reshape(-1, body.n_dim)
        return np.asarray(columns[body.positions == 0.0])
    if body.angle_column is not None:
        return np.array([[body.angle_column]])
    own = body.carried()
    return np.zeros((0, 3), dtype=np.intp) if own is None else own.sections.reshape(-1, 3)
