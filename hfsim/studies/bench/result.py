"""Everything a bench found, and as plain facts."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from hfsim.studies.bench.advice import pareto, recommendations
from hfsim.studies.bench.points import Cell, Point


@dataclass(frozen=True)
class Bench:
    """Everything a study found.

    Attributes
    ----------
    name : str
        Name of the deck.
    status : str
        ``done``, ``failed`` (no model had a reference) or ``interrupted``.
    duration : float
        Span of the scene [s].
    budget, used : float
        Wall time allowed and used [s].
    """

    name: str
    status: str
    duration: float
    budget: float
    used: float
    cells: tuple[Cell, ...]
    points: tuple[Point, ...]

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
