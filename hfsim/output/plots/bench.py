"""Pictures of a bench: error against run time, mesh error against elements or unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.output.plots.figures import decades, dress_counts, dress_log, finished, log_figure
from hfsim.output.plots.files import save
from hfsim.output.plots.style import BLUE, COLOURS, GREEN, ORANGE, PURPLE, RED, SKY, colour, slug
from hfsim.studies.agreement import tidy
from hfsim.studies.bench.advice import pareto
from hfsim.studies.bench.points import Cell, Point, observed_order
from hfsim.studies.bench.result import Bench

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_METHOD_STYLES = {
    "gauss": (BLUE, "o"),
    "radau": (GREEN, "s"),
    "energy": (SKY, "v"),
    "gear": (RED, "^"),
    "generalized_alpha": (PURPLE, "D"),
    "explicit": (ORANGE, "P"),
}
_CPU, _TOTAL = "CPU time of the integration [s]", "largest error, mesh included / range [-]"


def draw_bench(result: Bench, folder: Path) -> list[str]:
    """Draw error against CPU time of each model and mesh, mesh error over elements; return the files."""
    figures: dict[str, Figure | None] = {}
    for cell in result.cells:
        mesh = f"{cell.elements}" if cell.degree == 3 else f"{cell.elements}_degree_{cell.degree}"
        which = f"_{cell.model}_{mesh}" if len(result.cells) > 1 else ""
        figures[slug(f"work_precision{which}")] = _precision_figure(result, cell)
    for model in dict.fromkeys(cell.model for cell in result.cells if cell.mesh_error):
        degrees = sorted({cell.degree for cell in result.meshed(model)})
        several = len(degrees) > 1
        for degree in degrees:
            which = f"_degree_{degree}" if several else ""
            figures[slug(f"mesh_error_{model}{which}")] = _mesh_figure(result, model, degree)
        figures[slug(f"total_error_{model}")] = (_degree_figure if several else _total_figure)(result, model)
    return save(figures, folder)


def _costs(points: Sequence[Point], error: str = "error") -> tuple[Array, Array]:
    """Return CPU times [s] and errors [-] of points."""
    cpu, errors = ([getattr(p, name) for p in points] for name in ("cpu", error))
    return np.array(cpu, float), np.array(errors, float)


def _precision_figure(result: Bench, cell: Cell) -> Figure | None:
    mine = result.points_of(cell)
    points = [p for p in mine if p.cpu and p.error is not None]
    if not points:
        return None
    figure, (axes,) = log_figure()
    _set_limits(axes, points, cell.mesh_error or 0.0)
    front = pareto(points)
    axes.plot(
        *_costs(front), color="0.8", linewidth=9, solid_capstyle="round", solid_joinstyle="round", zorder=1,
        label="Pareto front",
    )  # fmt: skip
    for method in dict.fromkeys(p.method for p in points):
        lost = sum(p.method == method and p.status in ("failed", "limit") for p in mine)
        label = f"{method} ({lost} failed)" if lost else method
        _draw_method(axes, [p for p in points if p.method == method], method, label)
    _label_levels(axes, front)
    _draw_floor(axes, cell, min(p.error or 1.0 for p in points))
    of = f" of {cell.groups[0]}" if cell.groups else ""
    dress_log(axes, _CPU, f"largest time error{of} / range [-]")
    return finished(figure, f"{result.name}, {cell.model}, {cell.mesh}: error against run time", [axes])


def _draw_method(axes: Axes, points: Sequence[Point], method: str, label: str) -> None:
    own, marker = _METHOD_STYLES.get(method, ("0.3", "o"))
    cpu, error = _costs(points)
    spread = [cpu - [p.cpu_min or 0.0 for p in points], [p.cpu_max or 0.0 for p in points] - cpu]
    axes.errorbar(cpu, error, xerr=spread, color=own, linewidth=1.5, elinewidth=1.0)
    below = np.array([p.below_floor for p in points])
    axes.plot(cpu[~below], error[~below], marker, color=own, markersize=6)
    axes.plot(cpu[below], error[below], "v", color=own, markersize=8, markerfacecolor="white", zorder=5)
    axes.plot([], [], color=own, marker=marker, linewidth=1.5, label=label)


def _label_levels(axes: Axes, front: Sequence[Point]) -> None:
    """Write tolerance or step beside the points of the front that lie well apart."""
    last = np.inf
    for point in front:
        error = point.error or 0.0
        if error > last / 5.0:
            continue
        last = error
        axes.annotate(
            point.at, (point.cpu or 0.0, error), xytext=(-8, -3), textcoords="offset points",
            ha="right", va="top", fontsize=8, color="0.3",
        )  # fmt: skip


def _set_limits(axes: Axes, points: Sequence[Point], mesh_error: float) -> None:
    """Show all points, however few, and the mesh error."""
    cpu = [one for p in points for one in (p.cpu, p.cpu_min, p.cpu_max) if one]
    errors = [error for error in (mesh_error, *(p.error for p in points)) if error] or [1.0]
    axes.set_xlim(min(cpu) / 1.4, 1.4 * max(cpu))
    axes.set_ylim(min(errors) / 3.0, 3.0 * max(errors))


def _draw_floor(axes: Axes, cell: Cell, least: float) -> None:
    if cell.mesh_error:
        axes.axhline(
            cell.mesh_error, color="black", linestyle="--", linewidth=1.2, label="mesh error: less is wasted"
        )
    if cell.floor is None:
        return
    bottom = min(cell.floor, least) / 10.0
    axes.axhspan(bottom, cell.floor, color="0.9", zorder=0, label=f"error floor {tidy(cell.floor)}")
    axes.set_ylim(bottom=bottom)


def _mesh_figure(result: Bench, model: str, degree: int) -> Figure:
    """Draw the mesh error of every channel, with the order observed between meshes."""
    figure, (axes,) = log_figure()
    cells = result.meshed(model, degree)
    counts = [c.elements for c in cells]
    for i, name in enumerate(cells[0].mesh_errors):
        errors = [c.mesh_errors[name] for c in cells]
        orders = [observed_order(left, right, name) for left, right in pairwise(cells)]
        known = ", ".join(f"{order:.1f}" for order in orders if order is not None)
        style = "o-" if i < len(COLOURS) else "s--"
        label = f"{name}\n(order {known})" if known else name
        axes.plot(counts, errors, style, color=colour(i), linewidth=1.6, label=label)
    least = {c.elements: [p.error for p in result.points_of(c) if p.error is not None] for c in cells}
    best = {count: min(errors) for count, errors in least.items() if errors}
    if best:
        axes.plot(list(best), list(best.values()), "v:", color="0.5", label="smallest time error reached")
    dress_counts(axes, counts, "elements of each beam", "mesh error / range [-]")
    axes.set_ylim(decades(axes.get_ylim()))
    against = f"against {cells[0].mesh_reference_words}"
    of = f", degree {degree}" if degree != 3 else ""
    title = f"{result.name}, {model}{of}: error against number of elements\n({against})"
    return finished(figure, title, [axes])


def _total_figure(result: Bench, model: str) -> Figure:
    """Draw the best points of every mesh with the error of the mesh included."""
    figure, (axes,) = log_figure()
    for i, cell in enumerate(c for c in result.cells if c.model == model):
        best = _costs(pareto(result.points_of(cell)), "total_error")
        axes.plot(*best, "o-", color=colour(i), linewidth=1.6, label=cell.mesh)
    dress_log(axes, _CPU, _TOTAL)
    axes.set_ylim(decades(axes.get_ylim()))
    title = f"{result.name}, {model}: total error against run time, best method of each mesh"
    return finished(figure, title, [axes])


def _degree_figure(result: Bench, model: str) -> Figure:
    """Draw refinement by elements and by degree: mesh error against unknowns, total error against time."""
    figure, (left, right) = log_figure((11.0, 5.0), 2)
    for i, degree in enumerate(result.degrees(model)):
        style: dict[str, Any] = {"color": colour(i), "linewidth": 1.6, "label": f"degree {degree}"}
        cells = result.meshed(model, degree)
        left.plot([c.unknowns for c in cells], [c.mesh_error or np.nan for c in cells], "o-", **style)
        for cell in cells:
            left.annotate(
                str(cell.elements), (cell.unknowns, cell.mesh_error or np.nan), xytext=(4, 4),
                textcoords="offset points", fontsize=8, color="0.3",
            )  # fmt: skip
        best = pareto(result.points_of_degree(model, degree), total=True)
        right.plot(*_costs(best, "total_error"), "o-", **style)
    for axes in (left, right):
        dress_log(axes, _CPU, _TOTAL)
        axes.set_ylim(decades(axes.get_ylim()))
    left.set(xlabel="unknowns (numbers: elements of all beams)", ylabel="mesh error / range [-]")
    left.legend(frameon=False, fontsize=9)
    return finished(figure, f"{result.name}, {model}: refinement by elements and by degree")
