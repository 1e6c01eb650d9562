"""The forces that springs, loads and the free motions of joints exert in a scene."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.mechanics.body import Body
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.system import System
from hfsim.parts.specs import JointSpec, LoadSpec, SpringSpec
from hfsim.scene.facing import Facings
from hfsim.scene.full_turns import FullTurns
from hfsim.scene.rules import LeftOut
from hfsim.scene.schema import Deck

if TYPE_CHECKING:
    from hfsim.mechanics.ties import Tie


def acting(
    deck: Deck,
    bodies: Mapping[str, Body],
    facings: Facings,
    marker: Callable[[str], Marker],
    left_out: LeftOut,
    x: Array,
    angles: Mapping[str, float],
) -> list[ForcePart]:
    """Return the forces that a deck states, but for those that the rules leave out.

    Parameters
    ----------
    facings : Facings
        How bodies face each other at the start.
    marker : callable
        From the name of a point to what holds it.
    x : ndarray, shape (n,)
        Coordinates at the start.
    angles : mapping of str to float
        Angles of the bodies there, with the turns that the deck states [rad].
    """
    gone = {*left_out["springs"], *left_out["loads"]}
    found, turns = [], FullTurns(deck)
    for item, entry, part in chain(_ties(deck, facings, marker, x), _loads(deck, bodies, marker)):
        if part.counter is not None:
            part.counter.suppose(0.0, turns.between(entry, part, x[None], angles))
        if item not in gone:
            found.append(replace(part, item=item))
    if any(part.events for part in found):
        from hfsim.mechanics.once import events_of, start

        start(events_of(found), 0.0, x[None])
    return found


def thrown(system: System, x: Array, resting: Sequence[Body]) -> Iterator[tuple[str, str]]:
    """Yield, with its item, what will throw a state (n,) at the start off, not at rest there."""
    yield from beyond_stops(system, x, resting)
    yield from ((item, f"starts with {what}") for item, what in undirected(system, x, resting))


def beyond_stops(system: System, x: Array, resting: Iterable[Body]) -> Iterator[tuple[str, str]]:
    """Yield, with its item, what is far beyond a stop in a state (n,) at the start, not at rest there."""
    edged = [part for part in _moving(system, resting) if part.has_edges]
    if not edged:
        return
    from hfsim.mechanics.ties import Tie

    for part in (part for part in edged if isinstance(part, Tie)):
        if depth := part.beyond(np.zeros(1), x[None]):
            yield part.item, f"starts {depth:.4g} {part.unit} beyond its stop, which will throw it back"


def undirected(system: System, x: Array, resting: Iterable[Body] = ()) -> Iterator[tuple[str, str]]:
    """Yield, with its item, what has a force without a direction in a state (n,), not at rest there."""
    for part in _moving(system, resting):
        if size := part.undirected(np.zeros(1), x[None]):
            yield part.item, f"both points in one place, where its force of {size:.4g} N has no direction"


def _moving(system: System, resting: Iterable[Body]) -> Iterator[ForcePart]:
    """Yield the forces on anything but bodies that are at rest."""
    starts = {body.columns.start for body in resting}
    for part in system.forces:
        if not all(m.grounded or m.columns.start in starts for m in part.markers):
            yield part


def _ties(
    deck: Deck, facings: Facings, marker: Callable[[str], Marker], x: Array
) -> Iterator[tuple[str, JointSpec | SpringSpec, ForcePart]]:
    """Yield, with its item and entry, what acts between two bodies."""
    for name, spring in deck.springs.items():
        own = _coupled if spring.on else _between
        yield from _let_go(spring, own(f"springs.{name}", spring, marker, facings, x))
    for name, joint in deck.joints.items():
        for key, held, resistances in joint.resisted(*facings.of(joint)):
            item = f"joints.{name}.{key}" if key else f"joints.{name}"
            from hfsim.mechanics.ties import tie_on

            first, second = map(marker, joint.between)
            yield item, joint, tie_on(held, first, second, resistances)


def _let_go(
    spring: SpringSpec, parts: Iterable[tuple[str, JointSpec | SpringSpec, ForcePart]]
) -> Iterator[tuple[str, JointSpec | SpringSpec, ForcePart]]:
    """Yield the parts of a spring, which are there until its release, if it has one."""
    if spring.release is None:
        yield from parts
        return
    from hfsim.mechanics.releases import Released

    release = spring.release.build()
    for item, entry, part in parts:
        if not part.counts_for_others:
            held = tuple(Released(one, release) for one in part.resistances)  # type: ignore[attr-defined]
            part = replace(part, resistances=held)  # type: ignore[call-arg]
        yield item, entry, part


def _between(
    item: str, spring: SpringSpec, marker: Callable[[str], Marker], facings: Facings, x: Array
) -> Iterator[tuple[str, JointSpec | SpringSpec, ForcePart]]:
    """Yield what acts between two points."""
    first, second = map(marker, spring.between)
    for key, part in spring.parts(first, second, x):
        yield f"{item}.{key}".removesuffix("."), spring, part


def _coupled(
    item: str, spring: SpringSpec, marker: Callable[[str], Marker], facings: Facings, x: Array
) -> Iterator[tuple[str, JointSpec | SpringSpec, ForcePart]]:
    """Yield what counts turns of angles that a coupling adds up, then the coupling, as they begin by then."""
    from hfsim.mechanics.coupled import NO_FORCE, CountingTie
    from hfsim.mechanics.ties import GapTie

    parts = []
    for key, entry in spring.on.items():
        part = measuring(entry, marker, facings, x, key.partition(".")[2])
        assert part is not None
        if isinstance(part, GapTie) and part.counter is not None:
            counting = CountingTie(part.first, part.second, (NO_FORCE,), part.measure, part.counter)
            yield f"{item}.of.{key}", entry, counting
        parts.append(part)
    yield item, spring, spring.coupling(parts, x)


def measuring(
    entry: Any, marker: Callable[[str], Marker], facings: Facings, x: Array, key: str = "", unit: str = ""
) -> Tie | None:
    """Return what measures a coordinate of a joint or a spring, by its key or its unit, without acting on it.

    None is returned where nothing does.
    """
    from hfsim.mechanics.ties import tie_on

    first, second = map(marker, entry.between)
    if isinstance(entry, SpringSpec):
        return replace(entry.build(first, second, x), resistances=())  # type: ignore[call-arg, return-value]
    axes = first.n_axes == 1, second.n_axes == 1
    own = (held for name, held in entry.coordinates(*facings.of(entry)) if not key or name == key)
    known = (tie_on(held, first, second, ()) for held in own if held.fits(*axes))
    return next((tie for tie in known if not unit or tie.unit == unit), None)


def _loads(
    deck: Deck, bodies: Mapping[str, Body], marker: Callable[[str], Marker]
) -> Iterator[tuple[str, LoadSpec, ForcePart]]:
    """Yield, with its item and entry, what acts from outside."""
    for name, load in deck.loads.items():
        own = load.owner
        yield f"loads.{name}", load, load.build_on(marker, bodies[own], deck.bodies[own])
