"""`hfsim extreme`: run the extreme set and hold every deck against what is expected of it."""

from __future__ import annotations

import sys
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hfsim.commands import (
    CASES,
    Talk,
    as_table,
    brief,
    claim_study,
    jobs_option,
    plural,
    print_error,
    refuse_unknown,
    talk_options,
    time_option,
)

if TYPE_CHECKING:
    from hfsim.output.runfolder import RunFolder
    from hfsim.studies.extreme import Extreme

FOLDER = CASES / "extreme"
"""Decks of the set shipped with hfsim."""
MARKER = "extreme.json"
"""File whose presence means that the results in a folder are whole."""


@click.command()
@click.argument("names", metavar="[NAME...]", nargs=-1)
@click.option(
    "--decks",
    type=click.Path(path_type=Path, exists=True, file_okay=False),
    default=FOLDER,
    metavar="DIR",
    help="Folder with decks and their expected.yaml; the shipped set without it.",
)
@time_option("budget", "Time all may take.", "5min")
@time_option("limit", "Time one deck may take with its references.", "100s")
@jobs_option
@click.option("-o", "--output", type=click.Path(path_type=Path), metavar="DIR", help="Write tables there.")
@click.option("--force", is_flag=True, help="Replace the results of a finished study.")
@talk_options
def extreme(
    names: tuple[str, ...],
    decks: Path,
    budget: float,
    limit: float,
    jobs: int,
    output: Path | None,
    force: bool,
    quiet: bool,
    verbose: bool,
    as_json: bool,
) -> None:
    """Run the decks at the edge of what can be solved, or those NAMEd, and print what came of them.

    Every deck runs as it states and is held against a tighter run, against closed forms where there are
    any, and against the class expected of it (those of 'hfsim stability') and what is to be blamed. Exit code
    4: some are not as expected.
    """  # fmt: skip
    from hfsim.output.progress import Progress
    from hfsim.studies.extreme import extreme_set, read_expectations

    talk = Talk(quiet, verbose, as_json)
    expectations = read_expectations(decks)
    refuse_unknown("deck", names, [one.name for one in expectations])
    chosen = [one for one in expectations if not names or one.name in names]
    folder = claim_study(output, "extreme", "", MARKER, force) if output else None
    with Progress("extreme set", sys.stderr, talk.quiet) as progress:
        result = extreme_set(decks, chosen, budget, limit, jobs, progress)
    talk.facts(_facts(result, folder))
    talk.result(as_text(result))
    raise click.exceptions.Exit(_exit_code(result))


def _exit_code(result: Extreme) -> int:
    if result.interrupted:
        print_error("interrupted")
        return 130
    return 0 if result.held == len(result.cases) else 4


def _facts(result: Extreme, folder: RunFolder | None) -> dict[str, Any]:
    """Return the study as facts; write them with a table if there is a folder."""
    from hfsim.output.runfolder import disk
    from hfsim.output.writers import json_ready, versions, write_json, write_table
    from hfsim.studies.extreme import CSV_COLUMNS, as_facts, as_rows

    files = ["extreme.csv", MARKER]
    facts, _ = json_ready({**as_facts(result), "versions": versions(), "files": files})
    if folder is not None:
        folder.prepare()
        with disk(folder.path):
            write_table(folder.path / files[0], as_rows(result), CSV_COLUMNS)
            write_json(folder.path / MARKER, facts)
    return dict(facts)


def as_text(result: Extreme) -> str:
    """Return the table of all decks and what is not as expected."""
    rows = [["deck", "expected", "class", "blamed", "error", "drift", "values", "steps", "CPU [s]", ""]]
    for c in result.cases:
        v = c.verdict
        values = (
            f"{sum(f.holds for f in c.found)}/{len(c.expectation.values)}" if c.expectation.values else "-"
        )
        numbers = [brief(v.time_error), brief(v.energy_drift), values, str(c.steps or "-"), f"{c.cpu:.2g}"]
        rows.append(
            [
                c.name,
                c.expectation.outcome,
                v.outcome,
                v.item or "-",
                *numbers,
                "MISSED" if c.misses else "ok",
            ]
        )
    completed, sound = result.sound
    blocks = [as_table(rows)]
    misses = [
        textwrap.fill(f"{c.name}: {miss}", 110, initial_indent="  ", subsequent_indent="    ")
        for c in result.cases
        for miss in c.misses
    ]
    blocks += ["\n".join(misses)] if misses else []
    blocks.append(
        f"{result.held} of {plural(len(result.cases), 'deck')} as expected; {completed} of {sound} "
        f"physically sound ones completed; {result.used:.3g} s used"
    )
    return "\n\n".join(blocks)
