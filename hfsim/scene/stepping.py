"""The coordinates that steps are made in, where a deck leaves that open; what its method does not read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Literal

from hfsim.integrators import METHODS, integrator, steps_in_absolute_coordinates
from hfsim.parts.bodies.models import MODELS, Model

if TYPE_CHECKING:
    from hfsim.scene.loading import LoadedDeck
    from hfsim.scene.schema import Deck

_Coordinates = Literal["auto", "frame", "absolute"]
MANY = 50
"""Coordinates of beams in body frames from which on their dense matrices cost more than these frames save."""


def stepping(deck: Deck, models: Mapping[str, str]) -> _Coordinates:
    """Return the coordinates that steps are made in with such models of the beams.

    They are absolute ones where the method needs a constant mass matrix, and where `MANY` are left open.
    """
    stated: _Coordinates = deck.solve.coordinates
    if steps_in_absolute_coordinates(deck.solve.method):
        return "absolute"
    if stated != "auto":
        return stated
    kinds = _stepping_in(deck, models, stated)
    framed = [beam for beam, kind in kinds.items() if kind.frame and not kind.varying_mass]
    return "absolute" if sum(deck.bodies[beam].size(deck.dimension) for beam in framed) >= MANY else stated


def unread(loaded: LoadedDeck) -> Iterator[tuple[str, str]]:
    """Yield, with its deck path, what a deck states that its method does not read.

    Where an override chooses the method, that is what overrides state too: decks are shared by methods.
    """
    solve, source, own = loaded.deck.solve, loaded.source, ("order", "stages", "rho_inf")
    stated = [key for key in own if getattr(solve, key) != type(solve).model_fields[key].default]
    if source.is_overridden(("solve", "method")):
        stated = [key for key in stated if source.is_overridden(("solve", key))]
    method = source.data["solve"].get("method", "auto") if stated else ""
    readers = {key: [name for name in METHODS if key in integrator(name).reads] for key in stated}
    if method == "auto":
        readers.pop("stages", None)
    idle = {key: names for key, names in readers.items() if method not in names}
    if idle:
        others = ", ".join(f"{key} (of {', '.join(names)})" for key, names in idle.items())
        yield f"solve.{next(iter(idle))}", f"method {method} does not read {others}"


def kinds_of(deck: Deck, models: Mapping[str, str]) -> dict[str, Model]:
    """Return the models of the beams with their states in these coordinates."""
    return _stepping_in(deck, models, stepping(deck, models))


def _stepping_in(deck: Deck, models: Mapping[str, str], coordinates: _Coordinates) -> dict[str, Model]:
    return {
        beam: MODELS[one].stepping_in(coordinates, deck.bodies[beam].element) for beam, one in models.items()
    }
