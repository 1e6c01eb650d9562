"""Angles and distances of joints and springs that channels ask for: what measures them, their full turns."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from hfsim.maths.rotations import wrap
from hfsim.mechanics.markers import Marker
from hfsim.parts.bodies.models import MODELS
from hfsim.parts.channels import ChannelKind, kind_of
from hfsim.parts.forces import AnySpring
from hfsim.parts.joints import AnyJoint
from hfsim.scene.acting import measuring
from hfsim.scene.facing import Facings
from hfsim.scene.full_turns import FullTurns
from hfsim.scene.gauging import Assembled
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.posed import stated_of_joints
from hfsim.scene.schema import Deck

if TYPE_CHECKING:
    from hfsim.mechanics.ties import Tie


class Measured(Assembled, Protocol):
    """What is asked of a scene besides what an equilibrium needs; see `hfsim.scene.build.Scene`."""

    @property
    def facings(self) -> Facings:
        """How the bodies face each other at the start."""

    def marker(self, point: str, held: bool = False) -> Marker:
        """Return the marker of a point, or what a joint holds there."""

    def ties(self, name: str) -> tuple[Any, ...]:
        """Return what a joint or a spring exerts on its coordinates."""

    def coordinate(self, name: str, unit: str) -> Any:
        """Return what measures the angle or the distance of a joint or a spring, if anything."""


def ties_of(scene: Measured, name: str) -> tuple[Tie, ...]:
    """Return what a joint, or a spring of a name that no joint has, exerts on its coordinates."""
    from hfsim.mechanics.ties import Tie

    own = ["joints" if name in scene.deck.joints else "springs", name]
    every = (one for one in scene.system.forces if isinstance(one, Tie))
    return tuple(one for one in every if one.item.split(".")[:2] == own)


def coordinate_of(scene: Measured, name: str, unit: str) -> Tie | None:
    """Return what measures the angle (``rad``) or the distance (``m``) of a joint or a spring."""
    return _acting(scene, name, unit) or _idle(scene, name, unit)


def _acting(scene: Measured, name: str, unit: str) -> Tie | None:
    """Return what is exerted on a coordinate, if anything: it counts its turns along a motion."""
    return next((one for one in scene.ties(name) if one.unit == unit and one.measures), None)


def _idle(scene: Measured, name: str, unit: str) -> Tie | None:
    """Return what measures a coordinate without acting on it."""
    deck, x = scene.deck, scene.system.absolute(scene.q[None])[0]
    marker = partial(scene.marker, held=True)
    return measuring(_tied(deck, name), marker, scene.facings, x, unit=unit)


def _tied(deck: Deck, name: str) -> AnyJoint | AnySpring:
    """Return the entry of a joint, or of a spring of a name that no joint has."""
    return deck.joints[name] if name in deck.joints else deck.springs[name]


def refuse_unread(loaded: LoadedDeck, scene: Measured) -> None:
    """Raise `DeckError` for channels of internal forces without strains, and angles that have no meaning."""
    for k, (name, kind) in enumerate(_asked(scene.deck)):
        path, channel, body = f"output.channels.{k}", scene.deck.channels[k], scene.bodies.get(name)
        if kind.of_strains and body and not len(body.outline_places):  # none where it is of another part
            message = f"{channel}: without strains, as in its model, a beam has no internal forces"
            raise loaded.problem(path, message, "take linear or exact")
        if kind.measured and scene.coordinate(name, kind.measured) is None:
            raise loaded.problem(path, f"{channel}: {_NO_ANGLE[0]}", _NO_ANGLE[1])
    for name, unit, key, _ in (one for rates in (False, True) for one in stated_of_joints(scene.deck, rates)):
        if scene.coordinate(name, unit) is None:
            raise loaded.problem(f"initial.{name}.{key}", *_NO_ANGLE)


_NO_ANGLE = (
    "of a line without sections there is no such angle about its axis",
    "take element: cosserat; across the line, name it second",
)


def blind_channels(deck: Deck, rigid: Collection[str]) -> list[str]:
    """Return the channels of internal forces of some beams, which have no strains where they are rigid."""
    return [one for one in deck.channels if kind_of(one).of_strains and one.partition(".")[0] in rigid]


def without_refused_channels(loaded: LoadedDeck) -> LoadedDeck:
    """Return a deck without the channels that its model refuses as one without strains."""
    deck = loaded.deck
    models = deck.models(deck.solve.model).items()
    blind = blind_channels(deck, [name for name, one in models if one in MODELS and not MODELS[one].flexible])
    kept = tuple(one for one in deck.channels if one not in blind)
    output = deck.output.model_copy(update={"channels": kept})
    return replace(loaded, deck=deck.model_copy(update={"output": output}))


def _asked(deck: Deck) -> Iterator[tuple[str, ChannelKind]]:
    """Yield owner and kind of each channel; a part of a scene has not all owners."""
    of = {**deck.bodies, **deck.joints, **deck.springs}
    for channel in deck.channels:
        name = channel.partition(".")[0]
        kind = kind_of(channel, deck)
        yield name, kind if name in of else kind._replace(measured="")


def uncounted(scene: Measured) -> dict[str, Tie]:
    """Return what measures angles that channels ask for and that nothing counts the turns of, by owners."""
    asked = {name for name, kind in _asked(scene.deck) if kind.measured == "rad" and kind.of_turns}
    idle = {name: scene.coordinate(name, "rad") for name in sorted(asked) if not _acting(scene, name, "rad")}
    return {name: tie for name, tie in idle.items() if tie.counter is not None}


def start_turns(scene: Measured) -> dict[str, float]:
    """Return these angles at the start, with the full turns that the deck states [rad]."""
    idle, deck, found = uncounted(scene), scene.deck, dict[str, float]()
    if not idle:
        return found
    x, turns = scene.system.absolute(scene.q[None]), FullTurns(deck)
    for name, tie in idle.items():
        measured = float(tie.angle(x)[0])
        near = turns.between(_tied(deck, name), tie, x, scene.start_angles)
        found[name] = near + float(wrap(np.array(measured - near)))
    return found
