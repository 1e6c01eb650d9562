"""`hfsim sweep`: many runs of one deck, a row for each."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hfsim.commands import import_libraries
from hfsim.commands.decks import load_numbered
from hfsim.commands.options import jobs_option, output_options, setting_options, talk_options, time_option
from hfsim.output.study import Study
from hfsim.output.talk import Destination, Talk, print_error

if TYPE_CHECKING:
    from hfsim.output.sweep import Wanted
    from hfsim.studies.sweep.plan import Plan

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
@click.option("--sampler", default="lhs", show_default=True, help="Latin hypercube, sobol or random.")
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Of the samples.")
@click.option(
    "--table",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Runs from a CSV file: a column for each path, a row for each run.",
)
@click.option(
    "--collect",
    multiple=True,
    metavar="QUANTITY",
    help="What is gathered: final(CHANNEL), at(TIME, CHANNEL), max, min or rms(CHANNEL); last values and "
    "extremes of all channels without it. May be repeated, or several may follow.",
)
@click.option(
    "--keep",
    type=click.Choice(["nothing", "histories", "folders"]),
    default="nothing",
    show_default=True,
    help="What is kept of each run beside its row.",
)
@jobs_option(os.cpu_count() or 1)
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
    sampler: str,
    seed: int,
    table: Path | None,
    collect: tuple[str, ...],
    keep: str,
    jobs: int,
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
    --table. Rows go to 'sweep.csv' in '<deck name>.sweep' or -o DIR, in the order of the plan, whichever
    run ends first. A run that fails is a row (exit code 0). Every run is on disk as soon as it has ended:
    what was interrupted or killed goes on with --resume, and the table is the same as without it.
    """
    import_libraries()
    import math

    from hfsim.studies.sweep.study import read_collected, refuse_hopeless, setting_of
    from hfsim.studies.sweep.work import Setting

    deck, collect = _deck_of(words, collect)
    loaded = load_numbered(deck, overrides, talk)
    plan = plan_of(vary, sample, sampler, seed, table)
    if plan.count > _MANY and not yes:
        raise click.UsageError(f"{plan.count} runs are many: say --yes if you mean it")
    base = Setting("", "", (), (), not no_error_estimate, mesh_error, diagnosis, limit or math.inf)
    setting = setting_of(loaded, read_collected(collect, loaded), base)
    refuse_hopeless(setting, plan, talk.note)
    from hfsim.output.sweep import Wanted

    raise click.exceptions.Exit(do_sweep(Wanted(loaded, plan, setting, keep, deck), jobs, resume, to, talk))


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


def plan_of(
    vary: Sequence[str], sample: int | None, sampler: str, seed: int, table: Path | None
) -> Plan:
    """Return the plan that the options ask for.

    Raises
    ------
    SweepError, click.UsageError
    """
    from hfsim.studies.sweep import plan as plans

    if table is not None:
        if vary or sample is not None:
            raise click.UsageError("--table says all: it takes no --vary and no --sample")
        return plans.table(table)
    pairs = [plans.read_vary(text) for text in vary]
    for k, (path, _) in enumerate(pairs):
        if path in (other for other, _ in pairs[:k]):
            raise click.UsageError(f"--vary says {path} twice")
    return plans.grid(dict(pairs)) if sample is None else plans.sample(dict(pairs), sample, sampler, seed)


def do_sweep(wanted: Wanted, jobs: int, resume: bool, to: Destination, talk: Talk) -> int:
    """Do the runs that are missing, write and tell the sweep; return the exit code."""
    from hfsim.output.progress import Progress
    from hfsim.output.sweep import draw_sweep, keeper, sweep_facts, sweep_text
    from hfsim.output.sweep_folder import KIND, RUNS, SweepFolder, claim_sweep, refuse_changed
    from hfsim.output.writers import Provenance
    from hfsim.studies.farm import Farm
    from hfsim.studies.sweep.result import gathered
    from hfsim.studies.sweep.study import do_runs

    start, plan, name = time.perf_counter(), wanted.plan, wanted.loaded.deck.name
    granted, going_on = claim_sweep(to, name, resume)
    if going_on:
        refuse_changed(granted.path, wanted.identity)
    about = Provenance.of(wanted.loaded, wanted.source, wanted.loaded.overrides).facts()
    folder = SweepFolder(granted, plan, wanted.identity, going_on)
    if going_on:
        talk.note(f"{folder.path}: going on, {folder.there} of {plan.count} runs are there")
    executor, done = Farm(jobs), folder.there
    with Progress(f"{name}, sweep", sys.stderr, talk.quiet) as progress:

        def take(number: int, row: dict[str, object], files: dict[str, bytes]) -> None:
            nonlocal done
            folder.add(number, row, files)
            done += 1
            progress(done / plan.count)

        interrupted = do_runs(wanted.setting, plan, executor, folder.missing, take, keeper(wanted.keep))
    wall = time.perf_counter() - start
    status = "interrupted" if interrupted else "done"
    folder.write_table(wanted.collected)
    result = gathered(name, status, plan, wanted.collected, folder.rows())
    study = Study(KIND, talk, granted, to.plots, about, to.format)
    study.publish(
        {**sweep_facts(result, wall, jobs), **wanted.identity},
        {},
        sweep_text(result, folder.path, wall, folder.there),
        partial(draw_sweep, result),
        also=("sweep.csv", RUNS),
    )
    folder.close()
    if interrupted:
        print_error("interrupted; what was computed until then is kept, --resume goes on with it")
    return 130 if interrupted else 0
