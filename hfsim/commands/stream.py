"""`hfsim run -o -`: the history to standard output, all else to standard error, no folder."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import click

from hfsim.commands import STARTED
from hfsim.commands.decks import load_decks
from hfsim.output.talk import Talk

if TYPE_CHECKING:
    from hfsim.output.extras import Extras


def run_to_stream(
    decks: Sequence[str],
    overrides: Sequence[str],
    wanted: Extras,
    wish: tuple[bool, bool],
    talk: Talk,
) -> int:
    """Simulate one deck, write its history to standard output, and return its exit code.

    Parameters
    ----------
    wanted : Extras
        Of which pictures are left out.
    wish : tuple of bool
        Whether errors are estimated, and failures diagnosed.

    Raises
    ------
    click.UsageError
        If there are several decks, or something is wanted that needs a folder.
    HfsimError
        If the deck cannot be assembled.
    """
    from hfsim.output.api import carry_out
    from hfsim.output.progress import Progress
    from hfsim.output.report import tell
    from hfsim.output.runfolder import Stopwatch
    from hfsim.output.stream import Stream
    from hfsim.output.writers import Provenance, summary_of

    if len(decks) != 1:
        raise click.UsageError("-o - takes one deck")
    if talk.as_json or wanted.animation or wanted.vtk:
        raise click.UsageError("-o - writes the history alone, without --json, --animate, --vtk and --report")
    talk = replace(talk, aside=True)
    (loaded,) = load_decks(decks, overrides, talk)
    watch = Stopwatch(wall_start=STARTED)
    stream = Stream(sys.stdout, Provenance.of(loaded, decks[0], overrides))
    with Progress(loaded.deck.name, sys.stderr, talk.quiet or sys.stdout.isatty()) as progress:
        result = carry_out(
            loaded,
            progress,
            error_estimate=wish[0],
            diagnosis=wish[1],
            after=wanted.after,
            outlines=False,
            recording=stream,
        )
    result = watch.added_to(result)
    tell(result, summary_of(result, stream.provenance, ()), None, talk, loaded.warnings)
    return result.exit_code
