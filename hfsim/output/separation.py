"""What people read of the times of forms of the elastic force, the paper's Table 1, and its files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from hfsim.output.pictures import drawn_by
from hfsim.output.text import as_table, wrapped
from hfsim.studies.agreement import tidy
from hfsim.studies.separation.results import CSV_COLUMNS, PAPER_RATIO, as_facts, as_rows

if TYPE_CHECKING:
    from hfsim.output.study import Study
    from hfsim.studies.separation.results import Cell, FormTimes, SeparationBench


def publish_separation(result: SeparationBench, study: Study) -> None:
    """Write the times and tell them."""
    tables, draw = {"bench": (CSV_COLUMNS, as_rows(result))}, drawn_by("separation:draw_separation", result)
    study.publish(as_facts(result), tables, as_text(result, study.path), draw)


def as_text(result: SeparationBench, folder: Path) -> str:
    """Return the study as people read it: a table for each kind of element, then the goals."""
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
    worst, cells = form.worst_difference, [form.form]
    for name, unit in (("force", 1e6), ("both", 1e6), ("run", 1e3)):
        spread, ratio = getattr(form, name), getattr(form, f"{name}_ratio")
        cells += [f"{unit * spread.median:.3g}", spread.percent, f"{100 * ratio:.3g} %"]
    memory = [f"{size / 1e3:.3g}" for size in (form.tables, form.peak)]
    return [*cells, *memory, tidy(worst) if worst > 0.0 else "-"]
