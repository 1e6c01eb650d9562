"""What a command says, and where: results to standard output, all else to standard error.

Beside it, what the command line says about the folder of results.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Container, Iterable
from dataclasses import field
from pathlib import Path

import click

from hfsim.errors import HfsimError
from hfsim.maths.frozen import frozen
from hfsim.output.text import printable

_MOST_WARNINGS = 50
"""Warnings that are told of one thing."""


@frozen
class Destination:
    """Where results go, as the command line says it.

    Attributes
    ----------
    output : Path or None
        Folder named; without it a command has a default of its own.
    force : bool
        Whether the results of a finished run or study may be replaced.
    plots : bool
        Whether pictures are drawn.
    format : str
        Of pictures, one of `hfsim.output.pictures.FORMATS`.
    """

    output: Path | None
    force: bool = False
    plots: bool = True
    format: str = "png"


@frozen
class Talk:
    """Results to standard output, everything else to standard error; nothing useful to know is told twice.

    Attributes
    ----------
    quiet, verbose, as_json : bool
        The options of these names.
    aside : bool
        Whether results for people go to standard error: standard output has something else then.
    """

    quiet: bool = False
    verbose: bool = False
    as_json: bool = False
    aside: bool = False
    _told: set[str] = field(default_factory=set, repr=False, compare=False)

    def result(self, text: str, asked: bool = False) -> None:
        """Print a result for people; silent under ``--json``, and under ``-q`` but in a form asked for."""
        if not (self.as_json or (self.quiet and not asked)):
            (print_error if self.aside else print_out)(text)

    def facts(self, facts: object) -> None:
        """Print a result for programs on one line; only under ``--json``."""
        if self.as_json:
            print_out(json.dumps(facts, allow_nan=False, ensure_ascii=False))

    def note(self, text: str) -> None:
        """Tell something useful to know, once; silent under ``-q``."""
        if not self.quiet and text not in self._told:
            self._told.add(text)
            print_error(text)

    def warn(self, about: str, warnings: Iterable[str], told: Container[str] = ()) -> None:
        """Tell warnings about something that were not told before, of many the first; silent under ``-q``."""
        self.notes(about, (f"{about}: warning: {one}" for one in warnings if one not in told))

    def notes(self, about: str, lines: Iterable[str]) -> None:
        """Tell lines that are warnings about something, of many the first; silent under ``-q``."""
        every = list(lines)
        for line in every[:_MOST_WARNINGS]:
            self.note(line)
        if len(every) > _MOST_WARNINGS:
            self.note(f"{about}: and {len(every) - _MOST_WARNINGS} more warnings (--json lists them)")

    def detail(self, text: str) -> None:
        """Tell something only ``-v`` asks for."""
        if self.verbose and not self.quiet:
            print_error(text)


def print_out(text: str) -> None:
    """Print to standard output; a reader that went away (``| head``) is no error."""
    _print(text, 1)


def print_error(text: str) -> None:
    """Print to standard error."""
    _print(text, 2)


def _print(text: str, descriptor: int) -> None:
    stream = sys.stdout if descriptor == 1 else sys.stderr
    encoding = stream.encoding or "utf-8"
    try:
        click.echo(printable(text).encode(encoding, "backslashreplace").decode(encoding), file=stream)
    except BrokenPipeError:
        _redirect_to_nowhere(descriptor)
    except OSError as error:
        why = refused(error, descriptor)
        if descriptor == 1:  # else nobody can be told
            raise why from error


def refused(error: OSError, descriptor: int = 1) -> HfsimError:
    """Print nothing more to a stream that refuses it, as on a full disk; return what is to be said of it."""
    _redirect_to_nowhere(descriptor)
    return HfsimError(f"standard output takes no more: {error.strerror or error}")


def _redirect_to_nowhere(descriptor: int) -> None:
    # the file descriptor itself, or Python would complain when it flushes at exit
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, descriptor)
    os.close(nowhere)
