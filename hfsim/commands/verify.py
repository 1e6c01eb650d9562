"""`hfsim verify`: published values against what hfsim finds."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hfsim.commands.decks import load_decks
from hfsim.commands.options import PLACE, setting_options, talk_options, workers_options
from hfsim.output.study import Study
from hfsim.output.talk import Destination, Talk, print_error

if TYPE_CHECKING:
    from hfsim.studies.cluster import Workers
    from hfsim.studies.verify.study import Entry


@click.command()
@click.argument("names", metavar="[NAME or DECK...]", nargs=-1)
@click.option("--list", "listing", is_flag=True, help="Tell what there is, and run nothing.")
@click.option("--markdown", is_flag=True, help="Print the tables as Markdown.")
@workers_options
@click.option("-o", "--output", type=PLACE, metavar="DIR", help="Write tables there.")
@click.option("--force", is_flag=True, help="Replace the results of a finished study.")
@setting_options()
@talk_options
def verify(
    names: tuple[str, ...],
    listing: bool,
    markdown: bool,
    workers: Workers,
    output: Path | None,
    force: bool,
    overrides: tuple[str, ...],
    talk: Talk,
) -> None:
    """Hold what hfsim finds against published values: of the shipped benchmarks, those NAMEd, or a DECK.

    A deck says under 'verify' what is known of it, also one of your own: see 'hfsim help verify'. Runs are
    made twice at least, each time tighter, until their error in time is small beside the bounds. Exit code
    4: a value is missed; 3: something could not be computed.
    """
    from hfsim.output.verify import as_list, list_facts
    from hfsim.studies.verify.study import entries_of, entry_of, published_decks

    shipped = published_decks()  # whose names go before files of the same name
    files = [str(shipped.get(name, name)) for name in names or shipped]
    entries = entries_of(load_decks(files, overrides, talk, entry_of))
    if listing:
        for facts in list_facts(entries):
            talk.facts(facts)
        talk.result(as_list(entries))
        return
    study = Study.claim("verify", Destination(output, force), "", talk) if output else Study("verify", talk)
    raise click.exceptions.Exit(_carry_out(entries, workers, markdown, study))


def _carry_out(entries: list[Entry], workers: Workers, markdown: bool, study: Study) -> int:
    """Find, write and tell all values; return the exit code."""
    from hfsim.output.progress import Progress
    from hfsim.output.verify import COLUMNS, as_markdown, as_text
    from hfsim.studies.verify.result import as_facts
    from hfsim.studies.verify.study import verify

    texts = {name: text for entry in entries for name, text in entry.loaded.source.texts.items()}
    with (
        workers.executor(texts) as executor,
        Progress("verify", sys.stderr, study.talk.quiet) as progress,
    ):
        result = verify(entries, executor, progress)
    text = (as_markdown if markdown else as_text)(result)
    study.publish(as_facts(result), {"verify": (COLUMNS, result.rows)}, text, asked=markdown)
    missed, count = len(result.rows) - result.held, len(result.rows)
    if result.interrupted:
        print_error("interrupted; what was found until then is told")
    elif missed:
        print_error(f"error: {missed} of {count} published values are not found within their bounds")
    return result.exit_code
