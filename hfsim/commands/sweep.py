"""`hfsim sweep`: many runs of one deck, a row for each."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hfsim.commands import import_libraries
from hfsim.commands.decks import load_numbered
from hfsim.commands.options import (
    PLACE,
    not_both,
    output_options,
    setting_options,
    talk_options,
    time_option,
    workers_options,
)
from hfsim.output.talk import Destination, Talk, print_error

if TYPE_CHECKING:
    from hfsim.studies.cluster import Workers

_MANY = 100_000
"""Runs beyond which one is asked to say --yes."""


@click.command()
@click.argument("words", metavar="DECK [QUANTITY]...", nargs=-1, required=True)
@click.option(
    "--vary",
    multiple=True,
    metavar="PATH=VALUES",
    help="An entry of the deck, or parameters.NAME, and its values: lin(0.5,2,7), log(1e5,1e9,5) or 1,2,5; "
    "with --sample also uniform(a,b), normal(mean,deviation) and others. May be repeated.",
)
@click.option("--sample", type=click.IntRange(min=1), metavar="N", help="N random runs instead of a grid.")
@click.option("--sampler", metavar="NAME", help="lhs (Latin hypercube, the usual), sobol or random.")
@click.option("--seed", type=click.IntRange(min=0), metavar="N", help="Of samples; 1 without it.")
@click.option(
    "--table",
    type=PLACE,
    metavar="FILE",
    help="Runs from a CSV file: a column for each path, a row for each run.",
)
@click.option(
    "--collect",
    multiple=True,
    metavar="QUANTITY",
    help="What is gathered: final, max, min, mean or rms(CHANNEL), of a part of the run (CHANNEL, "
    "FROM..TO), at(TIME, CHANNEL), frequency, "
    "damping or critical(NUMBER); last values and extremes of all channels without it. "
    "Several may follow.",
)
@click.option(
    "--keep",
    type=click.Choice(["nothing", "histories", "folders"]),  # hfsim.output.sweep.KEPT
    default="nothing",
    show_default=True,
    help="What is kept of each run beside its row.",
)
@workers_options
@click.option(
    "--sensitivity",
    is_flag=True,
    help="Derivatives of what is collected by the entries of --vary PATH, at the deck's own values.",
)
@click.option("--resume", is_flag=True, help="Go on with what was interrupted; do only what is missing.")
@click.option("--yes", is_flag=True, help=f"Do more than {_MANY} runs.")
@click.option("--no-error-estimate", is_flag=True, help="Skip the second integrations that measure errors.")
@click.option("--mesh-error", is_flag=True, help="Measure the error of the mesh too: two more runs each.")
@click.option("--diagnosis", is_flag=True, help="Find out by short experiments why runs fail.")
@time_option("limit", "Time one run may take.")
@output_options
@setting_options("model")
@talk_options
def sweep(
    words: tuple[str, ...],
    vary: tuple[str, ...],
    sample: int | None,
    sampler: str | None,
    seed: int | None,
    table: Path | None,
    collect: tuple[str, ...],
    keep: str,
    workers: Workers,
    sensitivity: bool,
    resume: bool,
    yes: bool,
    no_error_estimate: bool,
    mesh_error: bool,
    diagnosis: bool,
    limit: float | None,
    to: Destination,
    overrides: tuple[str, ...],
    talk: Talk,
) -> None:
    """Run DECK many times with other values of its entries; a row for each run.

    All combinations of the values of --vary are run, or --sample N of them at random, or the rows of a
    --table; without any what the deck says under 'sweep'. Rows go to 'sweep.csv' in '<deck name>.sweep'
    or -o DIR, in the order of the plan, whichever run ends first. A run that fails is a row (exit code
    0). Every run is on disk as soon as it has ended: what was interrupted or killed goes on with
    --resume, and the table is the same as without it.
    """
    import_libraries()
    from hfsim.output.progress import Progress
    from hfsim.output.sweep import into_folder, wanted_of
    from hfsim.studies.sweep.asked import Asked

    not_both(resume, to.force)
    deck, collect = _deck_of(words, collect)
    loaded = load_numbered(deck, overrides, talk)
    estimates = (not no_error_estimate, mesh_error, diagnosis)
    asked = Asked(read_vary(vary), sample, sampler, seed, table, collect, yes, *estimates, limit, sensitivity)
    wanted = wanted_of(asked, loaded, talk.note, keep, deck)
    with (
        workers.executor(loaded.source.texts) as executor,
        Progress(f"{loaded.deck.name}, sweep", sys.stderr, talk.quiet) as progress,
    ):
        result = into_folder(wanted, executor, to, talk, progress, resume)
    if result.status == "interrupted":
        why = executor.lost or "interrupted"
        print_error(f"{why}; what was computed until then is kept, --resume goes on with it")
        raise click.exceptions.Exit(5 if executor.lost else 130)


def _deck_of(words: Sequence[str], collect: Sequence[str]) -> tuple[str, tuple[str, ...]]:
    """Return the deck, and what is collected: words that end as quantities do are of --collect.

    Raises
    ------
    click.UsageError
        If there is not one deck.
    """
    decks = [word for word in words if not word.rstrip().endswith(")")]
    if len(decks) != 1:
        raise click.UsageError("name one deck" if not decks else f"{len(decks)} decks; a sweep is of one")
    return decks[0], (*collect, *(word for word in words if word not in decks))


def read_vary(texts: Sequence[str]) -> dict[str, str]:
    """Return the values of each path, as text; empty where a path stands alone.

    Raises
    ------
    click.UsageError
        If one is named twice.
    """
    found: dict[str, str] = {}
    for text in texts:
        path, _, values = (part.strip() for part in text.partition("="))
        if path in found:
            raise click.UsageError(f"--vary says {path} twice")
        found[path] = values
    return found
