"""Which models a scene is compared with, and its deck for each of them.

A deck is given as a function from further overrides to a `LoadedDeck`: that is where commands tell warnings,
and what is to be known of the choice goes to a function that takes a line of text.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from hfsim.deck.repeating import repeated
from hfsim.deck.source import did_you_mean
from hfsim.errors import DeckError, HfsimError, NoStartError
from hfsim.integrators import steps_in_absolute_coordinates
from hfsim.parts.bodies.beam import BeamSpec
from hfsim.parts.bodies.models import MODELS
from hfsim.parts.channels import is_judged
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.measured import blind_channels
from hfsim.scene.schema import Deck
from hfsim.simulate import check

Load: TypeAlias = Callable[[Sequence[str]], LoadedDeck]
"""Gives the deck with further overrides, ``KEY=VALUE`` each; raises `DeckError`."""
Note: TypeAlias = Callable[[str], None]
"""Takes a line that is useful to know."""

_MOST_IN_FRAMES = 400
"""Unknowns up to which steps are made in body frames for the sake of a check: they take dense matrices."""


class ChoiceError(HfsimError):
    """Models or channels that cannot be compared."""

    exit_code = 2


@dataclass(frozen=True)
class Prepared:
    """A scene with each of the models that are compared.

    Attributes
    ----------
    reference : str
        Model that counts as true.
    decks : dict of str to LoadedDeck
        By model.
    overrides : dict of str to tuple of str
        What makes the deck that of the model.
    channels : tuple of str
        Those that are judged; empty for the usual ones.
    refused : dict of str to str
        Models with which the scene has no start, and why; they have no deck.
    """

    reference: str
    decks: dict[str, LoadedDeck]
    overrides: dict[str, tuple[str, ...]]
    channels: tuple[str, ...] = ()
    refused: Mapping[str, str] = field(default_factory=dict)


def usual_models(load: Load, note: Note) -> tuple[str, ...]:
    """Return the models a study takes where none is named: those that all beams have, one without beams.

    Raises
    ------
    DeckError
        If the deck is bad with the model exact too.
    """
    deck = load(("solve.model=exact",)).deck
    if not any(isinstance(body, BeamSpec) for body in deck.bodies.values()):
        note(f"{deck.name}: without beams all models are one")
        return ("exact",)
    found = ["exact"]
    for model in ("lowOrder", "linear"):
        try:
            load((f"solve.model={model}",))
            found.insert(0, model)
        except DeckError as error:
            note(f"{deck.name}: not with {model}: {error.problems[0].message}")
    return tuple(found)


def chosen_models(models: Sequence[str], reference: str) -> tuple[str, ...]:
    """Return the models to run, each once, the reference among them.

    Raises
    ------
    ChoiceError
        If ``auto`` is named.
    """
    chosen = tuple(dict.fromkeys((*models, reference)))
    if "auto" in chosen:
        raise ChoiceError("'auto' is no model of its own; name the models to compare")
    return chosen


def without_blind_channels(load: Load, models: Sequence[str], note: Note) -> tuple[str, ...]:
    """Return overrides that leave out channels of internal forces of beams that a model has rigid; say which.

    There are none, and the deck is refused later, where a body's own model is rigid, or nothing else would
    be left. Raise `DeckError` of a bad deck.
    """
    blind = [model for model in models if not MODELS[model].flexible] if set(models) <= set(MODELS) else []
    if not blind:
        return ()
    deck = load(()).deck
    rigid = [name for name, own in deck.models("").items() if not own]
    out = blind_channels(deck, rigid)
    kept = [channel for channel in deck.channels if channel not in out]
    if not out or not kept:
        return ()
    note(f"{deck.name}: without strains, model {blind[0]} has no {', '.join(out)}: left out")
    return (f"output.channels={json.dumps(kept)}",)


def prepare(
    load: Load, models: Sequence[str], reference: str, channels: Sequence[str], note: Note
) -> Prepared:
    """Load and assemble the deck with every model.

    Parameters
    ----------
    models : sequence of str
        The reference among them, see `chosen_models`.
    channels : sequence of str
        Those that are judged; empty for the usual ones.

    Raises
    ------
    DeckError
        If it is bad with any model, has no start with the reference, or a model is unknown.
    ChoiceError
        If a channel cannot be judged.
    """
    overrides = {model: _settings(load, model, note) for model in models}
    decks, refused = dict[str, LoadedDeck](), dict[str, str]()
    for model, own in overrides.items():
        try:
            decks[model] = _assembled(load(own))
        except NoStartError as error:
            if model == reference:
                raise
            refused[model] = f"{error.problems[0].path}: {error.problems[0].message}"
    channels = copies_in(channels, decks[reference])
    refuse_unjudged(channels, decks[reference].deck)
    if {"exact", "ancf"} <= set(decks) and frames_serve(decks["exact"], note):
        overrides["exact"] += ("solve.coordinates=frame",)
        decks["exact"] = _assembled(load(overrides["exact"]))
    told = {model: note if model == reference else None for model in decks}
    decks = {model: deck.with_numbers(told[model]) for model, deck in decks.items()}
    kept = own_models(decks[reference].deck)
    if kept:
        note(f"{kept} in every run: a body's own model is not replaced")
    return Prepared(reference, decks, overrides, tuple(channels), refused)


def _settings(load: Load, model: str, note: Note) -> tuple[str, ...]:
    own = (f"solve.model={model}",)
    return (*own, *without_blind_channels(lambda more: load((*own, *more)), (model,), note))


def _assembled(loaded: LoadedDeck) -> LoadedDeck:
    check(loaded)
    return loaded


def copies_in(channels: Sequence[str], loaded: LoadedDeck) -> tuple[str, ...]:
    """Return channels with numbers in place of braces; raise `ChoiceError` where one cannot be worked out."""
    found, wrong = repeated(channels, loaded.source.known)
    for number, problem in wrong.items():
        raise ChoiceError(f"channel '{channels[number]}': {problem.message}")
    return tuple(dict.fromkeys(found.values()))


def refuse_unjudged(channels: Sequence[str], deck: Deck) -> None:
    """Refuse to judge by channels that the deck does not have or that are residuals: raise `ChoiceError`."""
    for name in channels:
        if name not in deck.channels:
            raise ChoiceError(f"there is no channel '{name}': {did_you_mean(name, list(deck.channels))}")
        if not is_judged(name, conserved=False):
            raise ChoiceError(f"channel {name} cannot be judged: it has residuals of the joints, not results")


def frames_serve(loaded: LoadedDeck, note: Note) -> bool:
    """Return whether steps of exact can be made in body frames where the deck leaves that open."""
    solve = loaded.deck.solve
    if solve.coordinates != "auto" or steps_in_absolute_coordinates(solve.method):
        return False
    unknowns = check(loaded)["unknowns"]
    if unknowns > _MOST_IN_FRAMES:
        note(f"exact makes no steps in body frames: {unknowns} unknowns are too many for dense matrices")
    return bool(unknowns <= _MOST_IN_FRAMES)


def own_models(deck: Deck) -> str:
    """Return which bodies have a model of their own, in words; empty if none has."""
    beams = deck.models("").items()
    return ", ".join(f"'{body}' is {model}" for body, model in beams if model)
