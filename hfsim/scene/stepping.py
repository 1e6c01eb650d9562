"""The coordinates that steps are made in, where a deck leaves that open."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

from hfsim.integrators import steps_in_absolute_coordinates
from hfsim.parts.bodies.models import MODELS, Model

if TYPE_CHECKING:
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
    framed = (deck.bodies[beam].size for beam, kind in kinds.items() if kind.frame and not kind.varying_mass)
    return "absolute" if sum(framed) >= MANY else stated


def kinds_of(deck: Deck, models: Mapping[str, str]) -> dict[str, Model]:
    """Return the models of the beams with their states in these coordinates."""
    return _stepping_in(deck, models, stepping(deck, models))


def _stepping_in(deck: Deck, models: Mapping[str, str], coordinates: _Coordinates) -> dict[str, Model]:
    return {
        beam: MODELS[one].stepping_in(coordinates, deck.bodies[beam].element) for beam, one in models.items()
    }
