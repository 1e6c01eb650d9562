"""`hfsim extreme`: run the extreme set and hold every deck against what is expected of it."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hfsim.commands import interrupted
from hfsim.commands.options import PLACE, refuse_unknown, talk_options, time_option, workers_options
from hfsim.output.study import Study
from hfsim.output.talk import Destination, Talk
from hfsim.output.text import Column, brief, plural, table, wrapped
from hfsim.scene.shipped import CASES

if TYPE_CHECKING:
    from hfsim.studies.cluster import Workers
    from hfsim.studies.extreme import Case, Extreme

FOLDER = CASES / "extreme"
"""Decks of the set shipped with hfsim."""


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
@workers_options
@click.option("-o", "--output", type=PLACE, metavar="DIR", help="Write tables there.")
@click.option("--force", is_flag=True, help="Replace the results of a finished study.")
@talk_options
def extreme(
    names: tuple[str, ...],
    decks: Path,
    budget: float,
    limit: float,
    workers: Workers,
    output: Path | None,
    force: bool,
    talk: Talk,
) -> None:
    """Run the decks at the edge of what can be solved, or those NAMEd, and print what came of them.

    Every deck runs as it states and is held against a tighter run, against closed forms where there are
    any, and against the class expected of it (those of 'hfsim stability') and what is to be blamed. Exit code
    4: some are not as expected.
    """  # fmt: skip
    from hfsim.output.progress import Progress
    from hfsim.studies.extreme import extreme_set, read_expectations

    expectations = read_expectations(decks)
    refuse_unknown("deck", names, [one.name for one in expectations])
    chosen = [one for one in expectations if not names or one.name in names]
    study = Study.claim("extreme", Destination(output, force), "", talk) if output else Study("extreme", talk)
    with (
        workers.executor() as executor,
        Progress("extreme set", sys.stderr, talk.quiet) as progress,
    ):
        result = extreme_set(decks, chosen, budget, limit, executor, progress)
    study.publish(as_facts(result), {"extreme": (_CSV, result.cases)}, as_text(result))
    missed = 0 if result.held == len(result.cases) else 4
    raise click.exceptions.Exit(interrupted() if result.interrupted else missed)


_CSV = (
    Column("name"),
    Column("expected", "expectation.outcome"),
    Column("class", "verdict.outcome"),
    Column("cause", "verdict.cause"),
    Column("item", "verdict.item"),
    Column("holds", lambda case: not case.misses),
    *(Column(key, f"trial.{key}") for key in ("status", "end", "steps", "cpu")),
    *(Column(key, f"verdict.{key}") for key in ("time_error", "energy_drift", "growth")),
    Column("misses", lambda case: "; ".join(case.misses)),
    Column("reason", "verdict.reason"),
)
"""Columns of ``extreme.csv``."""
_TEXT = (
    Column("deck", "name"),
    Column("expected", "expectation.outcome"),
    Column("class", "verdict.outcome"),
    Column("blamed", lambda case: case.verdict.item or None),
    Column("error", "verdict.time_error", brief),
    Column("drift", "verdict.energy_drift", brief),
    Column("values", lambda case: _share_that_holds(case)),
    Column("steps", lambda case: case.trial.steps or None),
    Column("CPU [s]", "trial.cpu", ".2g"),
    Column("", lambda case: "MISSED" if case.misses else "ok"),
)


def _share_that_holds(case: Case) -> str | None:
    wanted = case.expectation.values
    return f"{sum(found.holds for found in case.found)}/{len(wanted)}" if wanted else None


def as_facts(result: Extreme) -> dict[str, Any]:
    """Return the study as JSON-ready facts (``extreme.json``)."""
    completed, sound = result.sound
    cases = [
        {column.name: column.value(case) for column in _CSV}
        | {
            "misses": case.misses,
            "sound": case.expectation.sound,
            "values": [asdict(found) for found in case.found],
        }
        for case in result.cases
    ]
    return {
        "status": "interrupted" if result.interrupted else "done",
        "seconds": result.seconds,
        "used": result.used,
        "cases": cases,
        "held": result.held,
        "sound": sound,
        "sound_completed": completed,
    }


def as_text(result: Extreme) -> str:
    """Return the table of all decks and what is not as expected."""
    misses = [wrapped(f"{case.name}: {miss}") for case in result.cases for miss in case.misses]
    completed, sound = result.sound
    last = (
        f"{result.held} of {plural(len(result.cases), 'deck')} as expected; {completed} of {sound} "
        f"physically sound ones completed; {result.used:.3g} s used"
    )
    return "\n\n".join(filter(None, [table(_TEXT, result.cases), "\n".join(misses), last]))
