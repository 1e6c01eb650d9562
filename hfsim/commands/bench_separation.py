"""`hfsim bench --separation`: what the forms of one elastic force cost, the paper's Table 1."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from hfsim.commands.options import refuse_unknown
from hfsim.output.pictures import drawn_by
from hfsim.output.study import Study
from hfsim.output.talk import print_error
from hfsim.output.text import as_table, wrapped

if TYPE_CHECKING:
    from hfsim.studies.separation.results import Cell, FormTimes, SeparationBench

ELEMENTS = (1, 4, 16, 64, 256)
"""Numbers of elements, where the command line names none."""
STATES = (1, 64)
"""Beams in a batch."""


@dataclass(frozen=True)
class Plan:
    """What is to be measured and where the results go."""

    elements: tuple[int, ...]
    states: tuple[int, ...]
    kinds: tuple[str, ...]
    repeats: int
    seconds: float
    started: float
    study: Study


def known_kinds(given: tuple[str, ...]) -> tuple[str, ...]:
    """Return the element kinds asked for; all without any.

    Raises
    ------
    click.UsageError
        If one is unknown.
    """
    from hfsim.studies.separation.beams import KINDS

    refuse_unknown("element", given, KINDS)
    return given or tuple(KINDS)


def do_separation(plan: Plan) -> int:
    """Run the study, write and tell it, and return the exit code: 4 where forms disagree."""
    from hfsim.marching.stop import Budget
    from hfsim.output.progress import Progress
    from hfsim.studies.separation.measure import measure
    from hfsim.studies.separation.results import CSV_COLUMNS, as_facts, as_rows

    study = plan.study
    study.begin()
    with Progress("matrix separation", sys.stderr, study.talk.quiet) as progress:
        budget = Budget(plan.seconds, time.process_time, plan.started, progress)
        result = measure(plan.elements, plan.kinds, plan.repeats, budget, states=plan.states)
    tables, draw = {"bench": (CSV_COLUMNS, as_rows(result))}, drawn_by("separation:draw_separation", result)
    study.publish(as_facts(result), tables, as_text(result, study.path), draw)
    for sentence in result.disagreements:
        print_error(sentence)
    if result.status == "interrupted":
        print_error("interrupted; what was measured until then is kept")
    return {"done": 0, "wrong": 4, "interrupted": 130}[result.status]


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
        *(wrapped(one, "", "  ") for one in result.verdicts),
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
    from hfsim.studies.bench.points import tidy

    worst, cells = form.worst_difference, [form.form]
    for name, unit in (("force", 1e6), ("both", 1e6), ("run", 1e3)):
        spread, ratio = getattr(form, name), getattr(form, f"{name}_ratio")
        cells += [f"{unit * spread.median:.3g}", spread.percent, f"{100 * ratio:.3g} %"]
    memory = [f"{size / 1e3:.3g}" for size in (form.tables, form.peak)]
    return [*cells, *memory, tidy(worst) if worst > 0.0 else "-"]
