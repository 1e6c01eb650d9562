"""Pictures of a bench: error against run time, mesh error against elements or unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hfsim.output.plots.style import COLOURS, dress_log, new_figure, outside_legend, save, set_title, slug
from hfsim.studies.bench import Bench, Cell, Point, observed_order, pareto, tidy

_METHOD_STYLES = {
    "gauss": ("#0072B2", "o"),
    "radau": ("#009E73", "s"),
    "energy": ("#56B4E9", "v"),
    "gear": ("#D55E00", "^"),
    "generalized_alpha": ("#CC79A7", "D"),
    "explicit": ("#E69F00", "P"),
}


def draw_bench(result: Bench, folder: Path) -> list[str]:
    """Draw error against CPU time for each model and mesh, and the mesh error against the elements.

    Parameters
    ----------
    result : Bench
        What `hfsim.studies.bench.bench` found.
    folder : Path
        Where the PNG files go.

    Returns
    -------
    list of str
        File names written.
    """
    figures: dict[str, Figure] = {}
    for cell in result.cells:
        figure = _precision_figure(result, cell)
        if figure is not None:
            several = len(result.cells) > 1
            mesh = f"{cell.elements}" if cell.degree == 3 else f"{cell.elements}_degree_{cell.degree}"
            name = f"work_precision_{cell.model}_{mesh}" if several else "work_precision"
            figures[slug(name)] = figure
    for model in dict.fromkeys(cell.model for cell in result.cells if cell.mesh_error):
        degrees = sorted({cell.degree for cell in result.cells if cell.model == model and cell.mesh_error})
        for degree in degrees:
            which = f"mesh_error_{model}" if len(degrees) == 1 else f"mesh_error_{model}_degree_{degree}"
            figures[slug(which)] = _mesh_figure(result, model, degree)
        draw = _total_figure if len(degrees) == 1 else _degree_figure
        figures[slug(f"total_error_{model}")] = draw(result, model)
    return save(figures, folder)


def _precision_figure(result: Bench, cell: Cell) -> Figure | None:
    points = [p for p in result.points_of(cell) if p.cpu and p.error is not None]
    if not points:
        return None
    figure = new_figure((9.0, 5.0))
    axes = figure.subplots()
    axes.set_xscale("log")
    axes.set_yscale("log")
    front = pareto(points)
    axes.plot(
        [p.cpu or 0.0 for p in front], [p.error or 0.0 for p in front],
        color="0.8", linewidth=9, solid_capstyle="round", solid_joinstyle="round", zorder=1,
        label="Pareto front",
    )  # fmt: skip
    failed = [p for p in result.points_of(cell) if p.status in ("failed", "limit")]
    for method in dict.fromkeys(p.method for p in points):
        lost = sum(p.method == method for p in failed)
        label = f"{method} ({lost} failed)" if lost else method
        _draw_method(axes, [p for p in points if p.method == method], method, label)
    _label_levels(axes, front)
    _draw_floor(axes, cell, min(p.error or 1.0 for p in points))
    _dress_precision(axes, "largest time error / range [-]")
    outside_legend(figure, [axes])
    set_title(figure, f"{result.name}, {cell.model}, {cell.mesh}: error against run time")
    return figure


def _draw_method(axes: Axes, points: Sequence[Point], method: str, label: str) -> None:
    colour, marker = _METHOD_STYLES.get(method, ("0.3", "o"))
    cpu = np.array([p.cpu or 0.0 for p in points])
    error = np.array([p.error or 0.0 for p in points])
    spread = [cpu - [p.cpu_min or 0.0 for p in points], [p.cpu_max or 0.0 for p in points] - cpu]
    axes.errorbar(cpu, error, xerr=spread, color=colour, linewidth=1.5, elinewidth=1.0)
    below = np.array([p.below_floor for p in points])
    axes.plot(cpu[~below], error[~below], marker, color=colour, markersize=6)
    axes.plot(cpu[below], error[below], "v", color=colour, markersize=8, markerfacecolor="white", zorder=5)
    axes.plot([], [], color=colour, marker=marker, linewidth=1.5, label=label)


def _label_levels(axes: Axes, front: Sequence[Point]) -> None:
    """Write tolerance or step beside the points of the front that lie well apart."""
    last = np.inf
    for point in front:
        error = point.error or 0.0
        if error > last / 5.0:
            continue
        last = error
        text = point.level.replace("tolerance ", "").replace("step ", "")
        axes.annotate(
            text, (point.cpu or 0.0, error), xytext=(-8, -3), textcoords="offset points",
            ha="right", va="top", fontsize=8, color="0.3",
        )  # fmt: skip


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


def _dress_precision(axes: Axes, y_label: str) -> None:
    dress_log(axes)
    axes.set_ylabel(y_label)
    axes.set_xlabel("CPU time of the integration [s]")


def _mesh_figure(result: Bench, model: str, degree: int) -> Figure:
    """Draw the mesh error of every channel, with the order observed between meshes."""
    figure = new_figure((9.0, 5.0))
    axes = figure.subplots()
    axes.set_xscale("log", base=2)
    axes.set_yscale("log")
    cells = [c for c in result.cells if (c.model, c.degree) == (model, degree) and c.mesh_error]
    counts = [c.elements for c in cells]
    for i, name in enumerate(cells[0].mesh_errors):
        errors = [c.mesh_errors[name] for c in cells]
        orders = [observed_order(left, right, name) for left, right in pairwise(cells)]
        known = ", ".join(f"{order:.1f}" for order in orders if order is not None)
        style = "o-" if i < len(COLOURS) else "s--"
        label = f"{name}\n(order {known})" if known else name
        axes.plot(counts, errors, style, color=COLOURS[i % len(COLOURS)], linewidth=1.6, label=label)
    best = [(c.elements, _least_error(result, c)) for c in cells]
    reached = [(count, error) for count, error in best if error is not None]
    if reached:
        axes.plot(*zip(*reached, strict=True), "v:", color="0.5", label="smallest time error reached")
    _whole_decades(axes)
    axes.set_xlabel("elements of all beams together")
    axes.set_ylabel("mesh error / range [-]")
    axes.set_xticks(counts, [str(count) for count in counts])
    axes.grid(True, color="0.9", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
    outside_legend(figure, [axes])
    against = f"against {cells[0].mesh_reference_words}"
    of = f", degree {degree}" if degree != 3 else ""
    set_title(figure, f"{result.name}, {model}{of}: error against number of elements\n({against})")
    return figure


def _whole_decades(axes: Axes) -> None:
    low, high = axes.get_ylim()
    axes.set_ylim(10 ** np.floor(np.log10(low)), 10 ** np.ceil(np.log10(high)))


def _least_error(result: Bench, cell: Cell) -> float | None:
    return min((p.error for p in result.points_of(cell) if p.error is not None), default=None)


def _total_figure(result: Bench, model: str) -> Figure:
    """Draw the best points of every mesh with the error of the mesh included."""
    figure = new_figure((9.0, 5.0))
    axes = figure.subplots()
    axes.set_xscale("log")
    axes.set_yscale("log")
    cells = [c for c in result.cells if c.model == model]
    for i, cell in enumerate(cells):
        best = pareto(result.points_of(cell))
        cpu, error = [p.cpu or 0.0 for p in best], [p.total_error or np.nan for p in best]
        label = cell.mesh
        axes.plot(cpu, error, "o-", color=COLOURS[i % len(COLOURS)], linewidth=1.6, label=label)
    _dress_precision(axes, "largest error, mesh included / range [-]")
    _whole_decades(axes)
    outside_legend(figure, [axes])
    set_title(figure, f"{result.name}, {model}: total error against run time, best method of each mesh")
    return figure


def _degree_figure(result: Bench, model: str) -> Figure:
    """Draw refinement by elements and by degree: mesh error against unknowns, total error against time."""
    figure = new_figure((11.0, 5.0))
    left, right = figure.subplots(1, 2)
    for i, degree in enumerate(result.degrees(model)):
        style = {"color": COLOURS[i % len(COLOURS)], "linewidth": 1.6, "label": f"degree {degree}"}
        cells = [c for c in result.cells if (c.model, c.degree) == (model, degree) and c.mesh_error]
        left.plot([c.unknowns for c in cells], [c.mesh_error or np.nan for c in cells], "o-", **style)
        for cell in cells:
            left.annotate(
                str(cell.elements), (cell.unknowns, cell.mesh_error or np.nan), xytext=(4, 4),
                textcoords="offset points", fontsize=8, color="0.3",
            )  # fmt: skip
        best = pareto(result.points_of_degree(model, degree), total=True)
        right.plot([p.cpu or 0.0 for p in best], [p.total_error or np.nan for p in best], "o-", **style)
    for axes in (left, right):
        axes.set_xscale("log")
        axes.set_yscale("log")
        _dress_precision(axes, "largest error, mesh included / range [-]")
        _whole_decades(axes)
    left.set_ylabel("mesh error / range [-]")
    left.set_xlabel("unknowns (numbers: elements of all beams)")
    left.legend(frameon=False, fontsize=9)
    set_title(figure, f"{result.name}, {model}: refinement by elements and by degree")
    return figure
