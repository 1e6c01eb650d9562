"""Everything a bench found, and as plain facts."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

from hfsim.marching.columns import Columns, as_columns
from hfsim.maths.arrays import Array
from hfsim.studies.bench.advice import pareto, recommendations
from hfsim.studies.bench.points import Cell, Point

OF_POINT = (
    "model", "elements", "degree", "method", "tolerance", "step", "status", "reason", "cpu", "cpu_min",
    "cpu_max", "repeats", "steps", "rejected", "newton_iterations", "evaluations", "factorisations",
    "energy_drift", "error", "rms_error", "worst_channel", "below_floor", "total_error", "exact_error",
)  # fmt: skip
"""What tables have of a point."""


@dataclass(frozen=True)
class Bench(Columns):
    """Everything a study found; ``found["error"]`` is a column of its points.

    Attributes
    ----------
    name : str
        Name of the deck.
    status : str
        ``done``, ``failed`` (no model had a reference), ``limit`` (the budget did not suffice for a single
        point) or ``interrupted``.
    duration : float
        Span of the scene [s].
    budget, used : float
        CPU time allowed and used [s].
    """

    name: str
    status: str
    duration: float
    budget: float
    used: float
    cells: tuple[Cell, ...]
    points: tuple[Point, ...]

    def __repr__(self) -> str:
        """Return what it is in a line: its points would fill the screen."""
        done = sum(point.status == "done" for point in self.points)
        best = next(iter(self.recommendations), "nothing to recommend")
        return f"<Bench {self.name}: {self.status}, {done} of {len(self.points)} points; {best}>"

    @cached_property
    def columns(self) -> dict[str, Array]:  # type: ignore[override]
        """A row for each point, as columns: an array each by name."""
        return as_columns([{name: getattr(p, name) for name in OF_POINT} for p in self.points], OF_POINT)

    def points_of(self, cell: Cell) -> list[Point]:
        """Return the points of one cell."""
        return [p for p in self.points if p.place == cell.place]

    def degrees(self, model: str) -> list[int]:
        """Return the degrees of the meshes of a model."""
        return sorted({cell.degree for cell in self.cells if cell.model == model})

    def meshed(self, model: str, degree: int | None = None) -> list[Cell]:
        """Return the cells of a model (with elements of a degree) whose mesh error is known."""
        mine = [c for c in self.cells if c.model == model and c.mesh_error is not None]
        return [c for c in mine if degree in (None, c.degree)]

    def points_of_degree(self, model: str, degree: int) -> list[Point]:
        """Return the points of all meshes of a model with elements of a degree."""
        return [p for p in self.points if (p.model, p.degree) == (model, degree)]

    @property
    def recommendations(self) -> list[str]:
        """One sentence for each model and each target, then those on models."""
        return recommendations(self.cells, self.points)


def as_facts(result: Bench) -> dict[str, Any]:
    """Return the study as JSON-ready facts (``bench.json``)."""
    keys = ("method", "tolerance", "step")
    fronts = [pareto(result.points_of(cell)) for cell in result.cells]
    facts = [[{key: getattr(p, key) for key in keys} for p in front] for front in fronts]
    groups = next((cell.groups for cell in result.cells if cell.groups), ())
    return {**asdict(result), "pareto": facts, "groups": groups, "recommendations": result.recommendations}
