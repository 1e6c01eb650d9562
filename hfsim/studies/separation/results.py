"""What the study of matrix separation found, and its tables."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

from hfsim.marching.columns import Columns, as_columns
from hfsim.maths.arrays import Array
from hfsim.studies.timing import Spread

AGREEMENT = 1e-11
"""Largest difference from the direct form that counts as round-off, for one element; n elements have n^2
times more, since products of positions, which cancel in rigid motions, are so much larger than the rest."""

PAPER_RATIO = 0.1
"""Consumed time of the separated over the unseparated formulation, Table 1 of the paper."""

GOALS = {"separated": 0.1, "gram": 0.03}
"""Ratios of whole runs, to the direct form, that hfsim aims at."""


@dataclass(frozen=True)
class FormTimes:
    """One form with one element kind and number of elements.

    Attributes
    ----------
    force, both : Spread
        CPU time of one evaluation of the force, and of force and tangent, for all elements of all states [s].
    run : Spread
        CPU time of the whole run [s].
    force_ratio, both_ratio, run_ratio : float
        Medians over those of the direct form.
    tables, peak : int
        Memory of constant tables, and the most that one evaluation of force and tangent takes besides [byte].
    difference, run_difference : float
        From the direct form: of the force relative to the largest sum of terms |K| |p| that it is the
        difference of, of the tangent and the whole trajectory relative to the largest entry.
    """

    form: str
    force: Spread
    both: Spread
    run: Spread
    force_ratio: float
    both_ratio: float
    run_ratio: float
    tables: int
    peak: int
    difference: float
    run_difference: float

    @property
    def worst_difference(self) -> float:
        """The larger of the two differences."""
        return max(self.difference, self.run_difference)


@dataclass(frozen=True)
class Cell:
    """All forms of one element kind and number of elements.

    Attributes
    ----------
    elements, states : int
        Of each beam; of beams in the batch.
    status, reason : str
        ``done`` or ``skipped``; why.
    repeats : int
        Rounds in which every form was timed once.
    steps : int
        Of one run.
    share : float
        Part of the direct run's time that is spent in the elastic force.
    """

    element: str
    elements: int
    states: int = 1
    status: str = "skipped"
    reason: str = ""
    repeats: int = 0
    steps: int = 0
    share: float = 0.0
    forms: tuple[FormTimes, ...] = ()

    @property
    def size(self) -> str:
        """Elements and states in words."""
        beams = f" of each of {self.states} beams" if self.states > 1 else ""
        return f"{self.elements} elements{beams}"


@dataclass(frozen=True)
class SeparationBench(Columns):
    """Everything that was measured; ``found["run_ratio"]`` is a column of all forms of all cells.

    Attributes
    ----------
    status : str
        ``done``, ``wrong`` (forms disagree) or ``interrupted``.
    budget, used : float
        CPU time allowed and used [s].
    """

    status: str
    budget: float
    used: float
    cells: tuple[Cell, ...]

    def __repr__(self) -> str:
        """Return what it is in a line: its cells would fill the screen."""
        return f"<SeparationBench: {self.status}, {len(self.cells)} cells; {'; '.join(self.verdicts)}>"

    @cached_property
    def columns(self) -> dict[str, Array]:  # type: ignore[override]
        """A row for each form of each cell, as columns: an array each by name."""
        return as_columns([{key: row.get(key) for key in CSV_COLUMNS} for row in as_rows(self)], CSV_COLUMNS)

    @property
    def disagreements(self) -> list[str]:
        """A sentence for each form that differs from the direct one by more than round-off."""
        return [
            f"{cell.element}, {cell.size}: {form.form} differs from direct by "
            f"{form.worst_difference:.1e}, more than round-off ({AGREEMENT * cell.elements**2:.0e})"
            for cell in self.cells
            for form in cell.forms
            if form.worst_difference > AGREEMENT * cell.elements**2
        ]

    def best(self, name: str) -> tuple[FormTimes, Cell] | None:
        """Return where a form's ratio of whole runs is smallest; None if it was not measured."""
        known = [(form, cell) for cell in self.cells for form in cell.forms if form.form == name]
        return min(known, key=lambda one: one[0].run_ratio, default=None)

    @property
    def verdicts(self) -> list[str]:
        """A sentence for each of `GOALS`."""
        return [self._verdict(form, goal) for form, goal in GOALS.items()]

    def _verdict(self, name: str, goal: float) -> str:
        best = self.best(name)
        if best is None:
            return f"{name}: no run was measured"
        form, cell = best
        ratio = form.run_ratio
        missed = "reached" if ratio <= goal else _missed(ratio / goal)
        return (
            f"{name}: at best {100 * ratio:.3g} % of the direct run ({cell.element}, {cell.size}; "
            f"force alone {100 * form.force_ratio:.3g} %); goal {100 * goal:g} %: {missed}"
        )


_SPREADS = ("force", "both", "run")
_FORM_COLUMNS = (
    "force_ratio", "both_ratio", "run_ratio", "tables", "peak", "difference", "run_difference"
)  # fmt: skip

CSV_COLUMNS = (
    "element", "elements", "states", "form", "status", "reason", "repeats", "steps", "share",
    *(f"{name}_{part}" for name in _SPREADS for part in ("median", "least", "most")), *_FORM_COLUMNS,
)  # fmt: skip
"""Columns of ``bench.csv``."""


def as_rows(result: SeparationBench) -> list[dict[str, object]]:
    """Return one row for each cell and form, with the keys `CSV_COLUMNS`; one for a cell without any."""
    rows: list[dict[str, object]] = []
    for cell in result.cells:
        facts = asdict(cell)
        forms = facts.pop("forms")
        rows += [{**facts, **_form_row(form)} for form in forms] or [facts]
    return rows


def _form_row(form: dict[str, Any]) -> dict[str, object]:
    spreads = {f"{name}_{part}": value for name in _SPREADS for part, value in form[name].items()}
    return {name: form[name] for name in ("form", *_FORM_COLUMNS)} | spreads


def as_facts(result: SeparationBench) -> dict[str, Any]:
    """Return the study as JSON-ready facts (``bench.json``)."""
    return {
        **asdict(result),
        "paper_ratio": PAPER_RATIO,
        "goals": GOALS,
        "best": {name: best[0].run_ratio if (best := result.best(name)) else None for name in GOALS},
        "verdicts": result.verdicts,
        "disagreements": result.disagreements,
    }


def _missed(factor: float) -> str:
    return f"missed by a factor of {factor:.2g}" if factor >= 1.5 else f"missed by {factor - 1.0:.1%}"
