"""Decks named on the command line: finding, loading and changing them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import click

from hfsim.commands import report_error, worst
from hfsim.errors import HfsimError
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
    loaded, codes = [], []
    for argument in arguments:
        try:
            deck = without_unread_channels(loader(argument, overrides, talk)(()), talk)
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


def loader(argument: str, overrides: Sequence[str], talk: Talk) -> Callable[[Sequence[str]], LoadedDeck]:
    """Return what loads a deck with further overrides, and tells its warnings.

    Raises
    ------
    DeckNotFoundError
    """
    path = None if argument == "-" else find_deck(argument, talk)

    def load(more: Sequence[str]) -> LoadedDeck:
        settings = (*overrides, *more)
        if path is not None and path.is_file():
            from hfsim.scene.loading import load_deck

            loaded = load_deck(path, settings)
        else:
            from hfsim.scene.loading import parse_deck

            text, file = (_piped(path), str(path)) if path else (_standard_input(sys.stdin), "stdin")
            loaded = parse_deck(text, file, settings)
        _warn(loaded, talk)
        return loaded

    return load


@cache
def _piped(path: Path) -> bytes:
    """Return what is in a pipe, which can be read but once."""
    from hfsim.deck.source import read_bytes

    return read_bytes(path)


@cache
def _standard_input(stream: TextIO) -> bytes:
    """Return all of standard input, which can be read but once, as far as a deck may go."""
    from hfsim.deck.source import MOST_BYTES

    return stream.buffer.read(MOST_BYTES)


def usual_models(argument: str, overrides: Sequence[str], talk: Talk) -> tuple[str, ...]:
    """Return the models a study takes where none is named; see `hfsim.studies.compare.usual_models`."""
    from hfsim.studies.compare import usual_models

    return usual_models(loader(argument, overrides, talk), talk.note)


def without_unread_channels(loaded: LoadedDeck, talk: Talk) -> LoadedDeck:
    """Return a deck without channels that a model which is set has not, and say which."""
    from hfsim.output.api import readable

    return readable(loaded, talk.note)


def without_blind_channels(
    argument: str, overrides: Sequence[str], models: Sequence[str], talk: Talk
) -> tuple[str, ...]:
    """Return overrides that leave out channels that some models have not; see `hfsim.studies.compare`."""
    from hfsim.studies.compare import without_blind_channels

    return without_blind_channels(loader(argument, overrides, talk), models, talk.note)


def with_numbers(loaded: LoadedDeck, talk: Talk) -> LoadedDeck:
    """Return a deck with the default elements where it says auto, and say so."""
    return loaded.with_numbers(talk.note) if loaded.auto_elements else loaded


def load_numbered(argument: str, overrides: Sequence[str], talk: Talk) -> LoadedDeck:
    """Load one deck, with the default elements where it says auto: for all commands but `run`.

    Raises
    ------
    DeckError, DeckNotFoundError
    """
    return with_numbers(loader(argument, overrides, talk)(()), talk)


def command_line() -> str:
    """Return the command line as the user typed it, near enough, for the log."""
    import shlex

    return shlex.join(["hfsim", *sys.argv[1:]])
