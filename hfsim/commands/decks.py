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
from hfsim.marching.stop import nobody
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
    arguments: Sequence[str],
    overrides: Sequence[str],
    talk: Talk,
    finish: Callable[[LoadedDeck], object] = nobody,
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
    from hfsim.output.api import readable

    loaded, codes = [], []
    for argument in arguments:
        try:
            deck = readable(loader(argument, overrides, talk)(()), talk.note)
            finish(deck)
            loaded.append(deck)
        except HfsimError as error:
            codes.append(report_error(error))
    if codes:
        raise click.exceptions.Exit(worst(codes))
    return loaded


def loader(argument: str, overrides: Sequence[str], talk: Talk) -> Callable[[Sequence[str]], LoadedDeck]:
    """Return what loads a deck with further overrides, and tells its warnings; raise `DeckNotFoundError`."""
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
        talk.notes(loaded.deck.name, loaded.warnings)
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


def load_numbered(argument: str, overrides: Sequence[str], talk: Talk) -> LoadedDeck:
    """Load one deck, with the default elements for auto; raise `DeckError` or `DeckNotFoundError`."""
    return loader(argument, overrides, talk)(()).with_numbers(talk.note)


def command_line() -> str:
    """Return the command line as the user typed it, near enough, for the log."""
    import shlex

    return shlex.join(["hfsim", *sys.argv[1:]])
