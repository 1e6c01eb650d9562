"""The joints of a scene between its bodies, and where these are at the start so that the joints hold."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from functools import partial

import numpy as np

from hfsim.errors import DeckError
from hfsim.maths.arrays import magnitude
from hfsim.mechanics.body import Body
from hfsim.mechanics.constraints import Constraint, constraints_of
from hfsim.scene.assembly import Assembly, Placed
from hfsim.scene.closing import Frame, Linkage, Sense
from hfsim.scene.facing import Facings
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.points import find_marker
from hfsim.scene.posed import posing
from hfsim.scene.rules import LeftOut, welds
from hfsim.scene.schema import Deck
from hfsim.scene.start import assembled, placed
from hfsim.scene.stated import Start


def joints_of(
    deck: Deck, bodies: Mapping[str, Body], facings: Facings, left_out: LeftOut | None = None
) -> tuple[dict[str, tuple[int, ...]], tuple[Constraint, ...]]:
    """Return which constraints each joint is made of, and these, with those that bodies have of their own."""
    joints: dict[str, tuple[int, ...]] = {}
    constraints: list[Constraint] = []
    held = welds(deck, [name for name, body in bodies.items() if body.still])
    for name, spec in deck.joints.items():
        markers = (find_marker(point, bodies, deck, held=True) for point in spec.points)
        holds = () if name in held else spec.held(*facings.of(spec))
        rows = constraints_of(holds, *markers, item=f"joints.{name}")
        if left_out is not None and f"joints.{name}" in left_out["standing_drivers"]:
            rows = tuple(row.standing() for row in rows)
        joints[name] = tuple(range(len(constraints), len(constraints) + len(rows)))
        constraints.extend(rows)
    constraints.extend(one for body in bodies.values() for one in body.own_constraints())
    return joints, tuple(constraints)


def linkage_of(
    deck: Deck, bodies: Mapping[str, Body], facings: Facings, lines: Collection[str] = ()
) -> Linkage:
    """Return the joints between the frames of bodies; of lines they hold the tangent alone."""
    frames = Frame.of(bodies.values(), deck.dimension, facings.centres, lines)
    _, constraints = joints_of(deck, frames, facings)
    n = max(frame.columns.stop for frame in frames.values())
    senses: list[Sense] = []
    for name, spec in deck.joints.items() if deck.dimension == 3 else ():
        a, b = (find_marker(point, frames, deck) for point in spec.between)
        pairs = (pair for held in spec.held(*facings.of(spec)) for pair in getattr(held, "senses", ()))
        senses.extend((f"joints.{name}", a, b, np.array(own), np.array(other)) for own, other in pairs)
    stated = (getattr(one, key, None) for one in deck.initial.values() for key in ("position", "distance"))
    far = max((magnitude(np.array(one)) for one in stated if one is not None), default=0.0)
    return Linkage(
        constraints, n, deck.dimension, facings.centres, tuple(senses), tuple(bodies.values()), far
    )


def start_of(loaded: LoadedDeck, bodies: Mapping[str, Body]) -> tuple[Assembly, Facings]:
    """Return where bodies are at the start, and how they face each other there.

    Axes in B of hinges are where joints hand orientations on, at guessed angles too; where that does not
    close, as they state them.  Axes of drivers are first where the deck states that bodies are.  Where the
    joints move them from there, the start is looked for again with angles that go by where the bodies are
    alone.
    """
    facings = Facings(loaded.deck)
    try:
        at, start, linkage = _placed(loaded, bodies, facings)
    except DeckError:
        if (own := facings.by_own()) is facings:
            raise
        facings = own
        at, start, linkage = _placed(loaded, bodies, facings)
    loose = facings
    while (more := loose.loosened(at.poses)) is not loose:
        loose = more
        at, start, linkage = _placed(loaded, bodies, loose)
    found = facings.at(at.poses)
    if loose is not facings:
        start, linkage = _start(loaded, bodies, found)
    return assembled(start, posing(start, loaded.deck, linkage, rates=True), at), found


def _placed(
    loaded: LoadedDeck, bodies: Mapping[str, Body], facings: Facings
) -> tuple[Placed, Start, Callable[[Deck], Linkage]]:
    """Return where bodies are, and what that is found from."""
    start, linkage = _start(loaded, bodies, facings)
    return placed(posing(start, loaded.deck, linkage, rates=False)), start, linkage


def _start(
    loaded: LoadedDeck, bodies: Mapping[str, Body], facings: Facings
) -> tuple[Start, Callable[[Deck], Linkage]]:
    """Return what a start is found from, and how joints of other decks are between the same bodies."""
    deck, linkage = loaded.deck, partial(linkage_of, bodies=bodies, facings=facings)
    straight = {k: one.length for k, one in deck.bodies.items() if one.type == "beam" and one.axis is None}
    return Start(tuple(bodies), deck.motions, linkage(deck), straight, loaded.problem), linkage
