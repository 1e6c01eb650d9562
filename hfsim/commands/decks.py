"""Decks named on the command line: finding, loading and changing them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hfsim.commands import report_error, worst
from hfsim.commands.options import with_settings
from hfsim.errors import DeckError, HfsimError
from hfsim.output.talk import Talk

if TYPE_CHECKING:
    from hfsim.scene.loading import LoadedDeck

def find_deck(argument: str, talk: Talk) -> Path:
    """Return the deck a command-line argument means, and tell where it is a shipped case.

    Raises
    ------
    DeckNotFoundError
        If it is neither a file nor a shipped case.
    """
    from hfsim.scene import shipped

    path = shipped.find_deck(argument)
    if path.is_relative_to(shipped.CASES) and str(path) != argument:
        talk.note(f"{argument}: using the shipped case {path}")
    return path


def load_decks(
    arguments: Sequence[str], overrides: Sequence[str], talk: Talk, finish: Callable[[LoadedDeck], object]
) -> list[LoadedDeck]:
    """Load every deck before anything is done with any, and report the problems of all.

    Parameters
    ----------
    arguments : sequence of str
        Files or names of shipped cases.
    overrides : sequence of str
        ``key=value`` settings for all of them.
    talk : Talk
        For notes.
    finish : callable
        Further checks of a loaded deck; a `HfsimError` from it counts as the deck's.

    Returns
    -------
    list of LoadedDeck
        One for each argument.

    Raises
    ------
    click.exceptions.Exit
        With code 2 if any deck is bad; its problems have been printed then.
    """
    from hfsim.scene.loading import load_deck

    loaded, codes = [], []
    for argument in arguments:
        try:
            deck = load_deck(find_deck(argument, talk), tuple(overrides))
            _warn(deck, talk)
            finish(deck)
            loaded.append(deck)
        except HfsimError as error:
            codes.append(report_error(error))
    if codes:
        raise click.exceptions.Exit(worst(codes))
    return loaded


def _warn(loaded: LoadedDeck, talk: Talk) -> None:
    talk.notes(loaded.deck.name, loaded.warnings)


def assemble(loaded: LoadedDeck) -> None:
    """Build a deck's scene and throw it away, to find what only then shows.

    Raises
    ------
    DeckError
        If it cannot be built.
    """
    from hfsim.simulate import check

    check(loaded)


def usual_models(argument: str, overrides: Sequence[str], talk: Talk) -> tuple[str, ...]:
    """Return the models a study takes where none is named: those that all beams have, one without beams.

    Raises
    ------
    DeckError, DeckNotFoundError
        If the deck is bad with the model exact too.
    """
    from hfsim.parts.bodies.beam import BeamSpec
    from hfsim.scene.loading import load_deck

    path = find_deck(argument, replace(talk, quiet=True))
    deck = load_deck(path, with_settings(overrides, "exact")).deck
    if not any(isinstance(body, BeamSpec) for body in deck.bodies.values()):
        talk.note(f"{deck.name}: without beams all models are one")
        return ("exact",)
    found = ["exact"]
    for model in ("lowOrder", "linear"):
        try:
            load_deck(path, with_settings(overrides, model))
            found.insert(0, model)
        except DeckError as error:
            talk.note(f"{deck.name}: not with {model}: {error.problems[0].message}")
    return tuple(found)


def without_blind_channels(
    argument: str, overrides: Sequence[str], models: Sequence[str], talk: Talk
) -> tuple[str, ...]:
    """Return overrides that leave out channels of internal forces of beams that a model has rigid; say which.

    Without them, where a body's own model is rigid, or where nothing else would be left, the deck is refused.

    Raises
    ------
    DeckError, DeckNotFoundError
    """
    from hfsim.parts.bodies.models import MODELS
    from hfsim.parts.channels import kind_of
    from hfsim.scene.loading import load_deck

    blind = [model for model in models if not MODELS[model].flexible] if set(models) <= set(MODELS) else []
    if not blind:
        return ()
    deck = load_deck(find_deck(argument, replace(talk, quiet=True)), tuple(overrides)).deck
    rigid = [name for name, own in deck.models("").items() if not own]
    out = [c for c in deck.channels if kind_of(c).of_strains and c.partition(".")[0] in rigid]
    kept = [channel for channel in deck.channels if channel not in out]
    if not out or not kept:
        return ()
    talk.note(f"{deck.name}: without strains, model {blind[0]} has no {', '.join(out)}: left out")
    return (f"output.channels=[{', '.join(kept)}]",)


def with_numbers(loaded: LoadedDeck, talk: Talk) -> LoadedDeck:
    """Return a deck with the default elements where it says auto, and say so."""
    if not loaded.auto_elements:
        return loaded
    from hfsim.parts.bodies.beam import DEFAULT_ELEMENTS

    beams = ", ".join(loaded.auto_elements)
    words = f"elements: auto of {beams} taken as {DEFAULT_ELEMENTS}"
    talk.note(f"{loaded.deck.name}: {words}; only hfsim run chooses them")
    return loaded.with_numbers()


def load_numbered(argument: str, overrides: Sequence[str], talk: Talk) -> LoadedDeck:
    """Load one deck, with the default elements where it says auto: for all commands but `run`.

    Raises
    ------
    DeckError, DeckNotFoundError
    """
    from hfsim.scene.loading import load_deck

    loaded = load_deck(find_deck(argument, talk), tuple(overrides))
    _warn(loaded, talk)
    return with_numbers(loaded, talk)


def command_line() -> str:
    """Return the command line as the user typed it, near enough, for the log."""
    import shlex

    return shlex.join(["hfsim", *sys.argv[1:]])
