"""`hfsim bench --separation`: what the forms of one elastic force cost, the paper's Table 1."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hfsim.output.talk import Talk, print_error
from hfsim.output.text import as_table

if TYPE_CHECKING:
    from hfsim.output.runfolder import RunFolder
    from hfsim.studies.separation.results import Cell, FormTimes, SeparationBench
    from hfsim.studies.timing import Spread

ELEMENTS = (1, 4, 16, 64, 256)
"""Numbers of elements, where the command line names none."""
STATES = (1, 64)
"""Beams in a batch."""
MARKER = "bench.json"
"""File whose presence means that the results in a folder are whole."""


@dataclass(frozen=True)
class Plan:
    """What is to be measured and where the results go."""

    elements: tuple[int, ...]
    states: tuple[int, ...]
    kinds: tuple[str, ...]
    repeats: int
    seconds: float
    started: float
    folder: RunFolder
    plots: bool
    talk: Talk


def known_kinds(given: tuple[str, ...]) -> tuple[str, ...]:
    """Return the element kinds asked for; all without any.

    Raises
    ------
    click.UsageError
        If one is unknown.
    """
    from hfsim.parts.elements import ELEMENTS as KINDS

    for name in given:
        if name not in KINDS:
            raise click.UsageError(f"there is no element '{name}'; there are {', '.join(KINDS)}")
    return given or tuple(KINDS)


def do_separation(plan: Plan) -> int:
    """Run the study, write and tell it, and return the exit code: 4 where forms disagree."""
    from hfsim.output.progress import Progress
    from hfsim.run.stop import Budget
    from hfsim.studies.separation.measure import measure

    plan.folder.prepare()
    (plan.folder.path / MARKER).unlink(missing_ok=True)
    with Progress("matrix separation", sys.stderr, plan.talk.quiet) as progress:
        budget = Budget(plan.seconds, start=plan.started, report=progress)
        result = measure(plan.elements, plan.kinds, plan.repeats, budget, states=plan.states)
    facts = _save(plan, result)
    plan.talk.facts(facts)
    plan.talk.result(as_text(result, plan.folder.path))
    for sentence in result.disagreements:
        print_error(sentence)
    if result.status == "interrupted":
        print_error("interrupted; what was measured until then is kept")
    return {"done": 0, "wrong": 4, "interrupted": 130}[result.status]


def _save(plan: Plan, result: SeparationBench) -> dict[str, object]:
    """Write bench.csv, the plot and, last, bench.json; return what is in the latter."""
    from hfsim.output.runfolder import disk
    from hfsim.output.writers import json_ready, versions, write_json, write_table
    from hfsim.studies.separation.results import CSV_COLUMNS, as_facts, as_rows

    path = plan.folder.path
    with disk(path):
        write_table(path / "bench.csv", as_rows(result), CSV_COLUMNS)
        files = ["bench.csv", MARKER]
        if plan.plots:
            from hfsim.output.plots import draw_separation

            files += [f"plots/{name}" for name in draw_separation(result, path / "plots")]
        facts, _ = json_ready({**as_facts(result), "versions": versions(), "files": files})
        write_json(path / MARKER, facts)
    return dict(facts)


# --- text ----------------------------------------------------------------------------------------


def as_text(result: SeparationBench, folder: Path) -> str:
    """Return the study as people read it: a table for each kind of element, then the goals."""
    from hfsim.studies.separation.results import PAPER_RATIO

    head = f"ways to the elastic force: CPU times and ratios to direct, {result.used:.3g} s used"
    blocks = [head]
    for kind in dict.fromkeys(cell.element for cell in result.cells):
        mine = [cell for cell in result.cells if cell.element == kind]
        blocks.append(f"{kind}:\n{_table(mine)}")
        blocks += [f"  {cell.size}: {cell.status}: {cell.reason}" for cell in mine if not cell.forms]
    lines = [
        f"the paper reports {100 * PAPER_RATIO:g} % for separated over direct, in a whole run",
        *result.verdicts,
        f"  results: {folder}/",
    ]
    return "\n\n".join([*blocks, "\n".join(lines)])


def _table(cells: list[Cell]) -> str:
    rows = [["elements", "way", "force [us]", "", "ratio", "force + tangent [us]", "", "ratio",
             "run [ms]", "", "ratio", "tables [kB]", "peak [kB]", "differs by"]]  # fmt: skip
    for cell in cells:
        for at, form in enumerate(cell.forms):
            batch = f" x {cell.states}" if cell.states > 1 else ""
            share = f"{cell.elements}{batch} ({100 * cell.share:.0f} %)"
            rows.append([share if at == 0 else "", *_row(form)])
    return as_table(rows) + "\n  x: beams in the batch; (%): the elastic force's share of the direct run"


def _row(form: FormTimes) -> list[str]:
    from hfsim.studies.bench import tidy

    worst = form.worst_difference
    return [
        form.form,
        *_time(form.force, 1e6), _percent(form.force_ratio),
        *_time(form.both, 1e6), _percent(form.both_ratio),
        *_time(form.run, 1e3), _percent(form.run_ratio),
        f"{form.tables / 1e3:.3g}", f"{form.peak / 1e3:.3g}",
        tidy(worst) if worst > 0.0 else "-",
    ]  # fmt: skip


def _time(spread: Spread, unit: float) -> list[str]:
    return [f"{unit * spread.median:.3g}", spread.percent]


def _percent(ratio: float) -> str:
    return f"{100 * ratio:.3g} %"
