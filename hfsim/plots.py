"""Runs to pictures (PNG); the only module that imports matplotlib."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FormatStrFormatter, NullFormatter
from matplotlib.transforms import Affine2D

from hfsim.solution import Channel, Run
from hfsim.studies.bench import Bench, Cell, Point, observed_order, pareto, tidy
from hfsim.studies.compare import Comparison, ending, percent
from hfsim.studies.separation import PAPER_RATIO, STEPS, SeparationBench
from hfsim.studies.stability import StabilityMap

_DPI = 110
_SIZE = (8.0, 4.6)
"""Width and height of a plot against time [inch]."""
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Okabe and Ito's colours, which colour-blind readers can tell apart."""
_MODEL_COLOURS = {
    "rigid": "#E69F00",
    "linear": "#D55E00",
    "lowOrder": "#0072B2",
    "exact": "#CC79A7",
    "ancf": "#009E73",
}
_FRAMES = 20
"""Number of shapes in a stroboscopic picture."""
_TIME_COLOURS = ListedColormap(matplotlib.colormaps["viridis_r"](np.linspace(0.1, 1.0, 256)))
"""Early to late, without the palest yellow, which is lost on white."""
_OFF_SCALE = 1e3
"""Relative differences above this are drawn here."""
_CLIP = 3.0
"""Height of an overlay's axis at most, in ranges of the reference."""

_QUANTITIES = {
    "position": (r"\.[xyz]", "position"),
    "deflection": (r"\.deflection", "deflection"),
    "elongation": (r"\.elongation", "elongation"),
    "angle": (r"\.angle", "angle"),
    "angular_velocity": (r"\.angular_velocity", "angular velocity"),
    "energy": (r"energy\.\w+", "energy"),
    "constraint": (r"constraint\.\w+", "constraint violation"),
}
"""File stem: (pattern of the end of a channel's name, words for titles and axes)."""
_UNIT_WORDS = {"m/s": "velocity", "m": "length", "N": "force", "N m": "moment"}
"""Words for channels that only their unit tells apart."""


def draw_run(run: Run, folder: Path) -> list[str]:
    """Draw one run: channels against time, paths of points, shapes of the bodies.

    Parameters
    ----------
    run : Run
        A run with finite values only.
    folder : Path
        Where the PNG files go; made if anything is drawn.

    Returns
    -------
    list of str
        File names written; only plots for which channels or outlines exist, none for an empty run.
    """
    if not len(run.t):
        return []
    figures = {
        **_time_figures(run),
        "path": _path_figure(run),
        "shapes": _shapes_figure(run),
    }
    return _save({name: figure for name, figure in figures.items() if figure is not None}, folder)


def draw_comparison(runs: Sequence[Run], comparison: Comparison, folder: Path) -> list[str]:
    """Draw every channel over all models, and each model's error against its cost.

    Parameters
    ----------
    runs : sequence of Run
        The compared runs with finite values only, the reference among them.
    comparison : Comparison
        What `hfsim.studies.compare.compare` found.
    folder : Path
        Where the PNG files go.

    Returns
    -------
    list of str
        File names written.
    """
    truth = next(run for run in runs if run.model == comparison.reference)
    if not len(truth.t):
        return []
    figures = {_slug(channel.name): _overlay_figure(runs, truth, channel) for channel in truth.channels}
    cost = _cost_figure(comparison)
    if cost is not None:
        figures["error_against_cost"] = cost
    return _save(figures, folder)


def _save(figures: dict[str, Figure], folder: Path) -> list[str]:
    if figures:
        folder.mkdir(parents=True, exist_ok=True)
    for name, figure in figures.items():
        canvas: Any = FigureCanvasAgg(figure)
        canvas.print_png(folder / f"{name}.png")  # savefig would draw everything twice
    return [f"{name}.png" for name in figures]


def _slug(name: str) -> str:
    return re.sub(r"[^\w.+-]", "_", name)


def _figure(size: tuple[float, float] = _SIZE) -> Figure:
    return Figure(figsize=size, dpi=_DPI, layout="constrained")


def _rows(figure: Figure, count: int) -> list[Axes]:
    return list(figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0])


def _dress(axes: Axes, x_label: str, y_label: str) -> None:
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    axes.grid(True, color="0.9", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.ticklabel_format(axis="y", scilimits=(-3, 4))


def _title(figure: Figure, text: str) -> None:
    figure.axes[0].set_title(text, fontsize=12, loc="left", pad=10)


def _headline(run: Run, words: str) -> str:
    title = f"{run.name}, {run.model}: {words}"
    return title if run.status == "done" else f"{title} ({_ended(run)})"


def _ended(run: Run) -> str:
    return f"{ending(run.status)} at {run.stop_time:.3g} s"


def _with_unit(words: str, unit: str) -> str:
    return f"{words} [{unit}]" if unit else words


# --- one run against time ------------------------------------------------------------------------


def _time_figures(run: Run) -> dict[str, Figure | None]:
    figures: dict[str, Figure | None] = {}
    rest = list(run.channels)
    for stem, (pattern, words) in _QUANTITIES.items():
        chosen = [c for c in rest if re.search(rf"{pattern}$", c.name)]
        rest = [c for c in rest if c not in chosen]
        if chosen:
            draw = _position_figure if stem == "position" else _channels_figure
            figures[stem] = draw(run, chosen, words)
    for unit in dict.fromkeys(channel.unit for channel in rest):
        chosen = [c for c in rest if c.unit == unit]
        name = _slug("other_" + (unit or "number").replace("/", "_per_"))
        figures[name] = _channels_figure(run, chosen, _UNIT_WORDS.get(unit, "other outputs"))
    return figures


def _position_figure(run: Run, channels: Sequence[Channel], words: str) -> Figure:
    directions = sorted({channel.name[-1] for channel in channels})
    figure = _figure((_SIZE[0], 1.4 + 2.4 * len(directions)))
    rows = _rows(figure, len(directions))
    points = list(dict.fromkeys(channel.name[:-2] for channel in channels))
    for axes, direction in zip(rows, directions, strict=True):
        for channel in (c for c in channels if c.name.endswith(f".{direction}")):
            colour = _COLOURS[points.index(channel.name[:-2]) % len(_COLOURS)]
            axes.plot(run.t, channel.values, color=colour, label=channel.name[:-2])
        _dress(axes, "", _with_unit(direction, channels[0].unit))
    rows[-1].set_xlabel("time [s]")
    _outside_legend(figure, rows)
    what = f"{words} of {points[0]}" if len(points) == 1 else f"{words} of points"
    _title(figure, _headline(run, what))
    return figure


def _channels_figure(run: Run, channels: Sequence[Channel], words: str) -> Figure:
    units = list(dict.fromkeys(channel.unit for channel in channels))
    figure = _figure((_SIZE[0], 2.2 + 2.4 * len(units)))
    rows = _rows(figure, len(units))
    for axes, unit in zip(rows, units, strict=True):
        for i, channel in enumerate(c for c in channels if c.unit == unit):
            axes.plot(run.t, channel.values, color=_COLOURS[i % len(_COLOURS)], label=channel.name)
        _dress(axes, "", _with_unit(words, unit))
    rows[-1].set_xlabel("time [s]")
    single = len(channels) == 1
    if not single:
        _outside_legend(figure, rows)
    _title(figure, _headline(run, channels[0].name if single else words))
    return figure


def _outside_legend(figure: Figure, rows: Sequence[Axes]) -> None:
    """Put one legend right of the axes, where it cannot cover data; a single label needs none."""
    found = {
        label: handle
        for axes in rows
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    if len(found) > 1:
        figure.legend(list(found.values()), list(found), loc="outside right upper", frameon=False)


# --- one run in the plane ------------------------------------------------------------------------


def _path_figure(run: Run) -> Figure | None:
    columns = {channel.name: channel.values for channel in run.channels}
    points = [name[:-2] for name in columns if name.endswith(".x") and f"{name[:-2]}.y" in columns]
    if not points or len(run.t) < 2:
        return None
    tracks = [np.column_stack([columns[f"{point}.x"], columns[f"{point}.y"]]) for point in points]
    figure, axes = _plane(np.vstack(tracks))
    for i, (point, track) in enumerate(zip(points, tracks, strict=True)):
        colour = _COLOURS[i % len(_COLOURS)]
        axes.plot(*track.T, color=colour, linewidth=1.3, label=point)
        axes.plot(*track[0], "o", color=colour, markerfacecolor="white")
        axes.plot(*track[-1], "s", color=colour)
    axes.plot([], [], "o", color="0.3", markerfacecolor="white", label="start")
    axes.plot([], [], "s", color="0.3", label="end")
    _outside_legend(figure, [axes])
    what = f"path of {points[0]}" if len(points) == 1 else "paths of points"
    _title(figure, _headline(run, what))
    return figure


def _shapes_figure(run: Run) -> Figure | None:
    outlines = {body: points[..., :2] for body, points in run.outlines.items() if points.size}
    if not outlines:
        return None
    frames = np.unique(np.linspace(0, len(run.t) - 1, _FRAMES).round().astype(int))
    figure, axes = _plane(np.vstack([points[frames].reshape(-1, 2) for points in outlines.values()]))
    lines = LineCollection([], cmap=_TIME_COLOURS, linewidths=1.6, capstyle="round")
    lines.set_segments([points[k] for k in frames for points in outlines.values()])
    lines.set_array(np.repeat(run.t[frames], len(outlines)))
    axes.add_collection(lines, autolim=False)
    for points in outlines.values():
        ends = points[frames][:, [0, -1]].reshape(-1, 2)
        axes.scatter(ends[:, 0], ends[:, 1], s=7, c=np.repeat(run.t[frames], 2), cmap=_TIME_COLOURS, zorder=3)
    figure.colorbar(lines, ax=axes, label="time [s]", fraction=0.04, pad=0.02)
    _title(figure, _headline(run, "shapes of the bodies"))
    return figure


def _plane(points: np.ndarray) -> tuple[Figure, Axes]:
    """Return a figure with equal axes, shaped to hold `points`, shape (n, 2) [m]."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = np.maximum(high - low, 0.12 * max(float((high - low).max()), 1e-9))
    middle = 0.5 * (low + high)
    half = 0.55 * size
    ratio = float(size[1] / size[0])
    width = float(np.clip(6.0 / ratio, 4.0, 8.0))
    figure = _figure((width + 1.4, float(np.clip(width * ratio, 2.0, 6.5)) + 1.0))
    axes = figure.subplots()
    _dress(axes, "x [m]", "y [m]")
    axes.set_aspect("equal")
    axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
    axes.set_ylim(middle[1] - half[1], middle[1] + half[1])
    return figure, axes


# --- several models ------------------------------------------------------------------------------


def _overlay_figure(runs: Sequence[Run], truth: Run, channel: Channel) -> Figure:
    figure = _figure((9.0, 4.6))
    axes = figure.subplots()
    curves = [(run, values) for run in runs if (values := _values(run, channel.name)) is not None]
    low, high, clipped = overlay_limits(channel.values, [values for _, values in curves])
    for run, values in curves:
        if run is not truth:
            _draw_model(axes, run, values, (low, high))
    label = f"{truth.model} (reference)" + ("" if truth.status == "done" else f" ({_ended(truth)})")
    axes.plot(truth.t, channel.values, "--", color="black", linewidth=1.5, label=label, zorder=5)
    axes.set_ylim(low, high)
    _dress(axes, "time [s]", _with_unit(channel.name, channel.unit))
    _outside_legend(figure, [axes])
    note = f"\n(axis cut at {_CLIP:.0f} x the reference's range)" if clipped else ""
    _title(figure, f"{truth.name}: {channel.name} by model{note}")
    return figure


def _values(run: Run, name: str) -> np.ndarray | None:
    found = next((channel.values for channel in run.channels if channel.name == name), None)
    return found if found is not None and len(found) else None


def _draw_model(axes: Axes, run: Run, values: np.ndarray, limits: tuple[float, float]) -> None:
    low, high = limits
    room = 2.0 * (high - low)
    shown = np.clip(values, low - room, high + room)  # 1e200 would overflow the drawing library
    colour = _MODEL_COLOURS.get(run.model, _COLOURS[4])
    broke = run.status != "done"
    label = f"{run.model} ({_ended(run)})" if broke else run.model
    axes.plot(run.t, shown, color=colour, linewidth=1.8, label=None if broke else label)
    if not broke:
        return
    axes.plot([], [], color=colour, linewidth=1.8, marker="X", markersize=9, label=label)
    edge = np.clip(values[-1], low, high)
    axes.plot(
        run.t[-1], edge, "X", color=colour, markersize=10, markeredgecolor="white", clip_on=False, zorder=6
    )


def overlay_limits(reference: np.ndarray, curves: Sequence[np.ndarray]) -> tuple[float, float, bool]:
    """Return the limits of an overlay's axis, in which a diverging model cannot squash the others.

    Parameters
    ----------
    reference : ndarray, shape (n,)
        Values of the reference.
    curves : sequence of ndarray
        Values of all models.

    Returns
    -------
    low, high : float
        At most three ranges of the reference around its middle.
    clipped : bool
        Whether some curve leaves them.

    Examples
    --------
    >>> overlay_limits(np.array([0.0, 1.0]), [np.array([0.0, 100.0])])
    (-0.05, 2.0, True)
    """
    low, high = float(reference.min()), float(reference.max())
    span = max(high - low, 1e-9 * max(abs(low), abs(high)), 1e-15)
    middle = 0.5 * (low + high)
    floor, ceiling = middle - 0.5 * _CLIP * span, middle + 0.5 * _CLIP * span
    bottom = min([low, *(float(values.min()) for values in curves)])
    top = max([high, *(float(values.max()) for values in curves)])
    clipped = bottom < floor or top > ceiling
    margin = 0.05 * span
    bottom, top = max(bottom - margin, floor), min(top + margin, ceiling)
    return bottom, top, clipped


def _cost_figure(comparison: Comparison) -> Figure | None:
    shown = [
        m for m in comparison.models if m.model != comparison.reference and m.worst and m.solve_cpu > 0.0
    ]
    if not shown:
        return None
    figure = _figure((8.4, 4.6))
    axes = figure.subplots()
    for m in shown:
        error = float(np.clip(m.worst.max_relative if m.worst else 0.0, 1e-16, _OFF_SCALE))
        marker = "X" if m.broke_down else "o"
        colour = _MODEL_COLOURS.get(m.model, _COLOURS[4])
        label = f"{m.model} ({ending(m.status)} at {m.stop_time:.3g} s)" if m.broke_down else m.model
        if error == _OFF_SCALE:
            label += ", off scale"
        axes.loglog([m.solve_cpu], [error], marker, color=colour, markersize=10, label=label)
    cost = comparison.result(comparison.reference).solve_cpu
    if cost > 0.0:
        axes.axvline(cost, color="black", linestyle="--", label=f"cost of {comparison.reference} (reference)")
    axes.axhline(
        comparison.max_error, color="0.5", linestyle=":", label=f"bound {percent(comparison.max_error)}"
    )
    _dress_log(axes)
    _outside_legend(figure, [axes])
    _title(figure, f"{comparison.name}: error against cost")
    return figure


def _dress_log(axes: Axes) -> None:
    axes.set_xlabel("CPU time of the solution [s]")
    axes.set_ylabel("largest relative difference [-]")
    axes.grid(True, which="major", color="0.9", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.margins(0.15)
    low, high = axes.get_xlim()
    axes.set_xlim(10 ** np.floor(np.log10(low)), 10 ** np.ceil(np.log10(high)))  # whole decades: few ticks
    axes.xaxis.set_minor_formatter(NullFormatter())


# --- error against run time ----------------------------------------------------------------------

_METHOD_STYLES = {
    "gauss": ("#0072B2", "o"),
    "radau": ("#009E73", "s"),
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
            figures[_slug(name)] = figure
    for model in dict.fromkeys(cell.model for cell in result.cells if cell.mesh_error):
        degrees = sorted({cell.degree for cell in result.cells if cell.model == model and cell.mesh_error})
        for degree in degrees:
            which = f"mesh_error_{model}" if len(degrees) == 1 else f"mesh_error_{model}_degree_{degree}"
            figures[_slug(which)] = _mesh_figure(result, model, degree)
        draw = _total_figure if len(degrees) == 1 else _degree_figure
        figures[_slug(f"total_error_{model}")] = draw(result, model)
    return _save(figures, folder)


def _precision_figure(result: Bench, cell: Cell) -> Figure | None:
    points = [p for p in result.points_of(cell) if p.cpu and p.error is not None]
    if not points:
        return None
    figure = _figure((9.0, 5.0))
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
    _outside_legend(figure, [axes])
    _title(figure, f"{result.name}, {cell.model}, {cell.mesh}: error against run time")
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
    _dress_log(axes)
    axes.set_ylabel(y_label)
    axes.set_xlabel("CPU time of the integration [s]")


def _mesh_figure(result: Bench, model: str, degree: int) -> Figure:
    """Draw the mesh error of every channel, with the order observed between meshes."""
    figure = _figure((9.0, 5.0))
    axes = figure.subplots()
    axes.set_xscale("log", base=2)
    axes.set_yscale("log")
    cells = [c for c in result.cells if (c.model, c.degree) == (model, degree) and c.mesh_error]
    counts = [c.elements for c in cells]
    for i, name in enumerate(cells[0].mesh_errors):
        errors = [c.mesh_errors[name] for c in cells]
        orders = [observed_order(left, right, name) for left, right in pairwise(cells)]
        known = ", ".join(f"{order:.1f}" for order in orders if order is not None)
        style = "o-" if i < len(_COLOURS) else "s--"
        label = f"{name}\n(order {known})" if known else name
        axes.plot(counts, errors, style, color=_COLOURS[i % len(_COLOURS)], linewidth=1.6, label=label)
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
    _outside_legend(figure, [axes])
    against = f"against {cells[0].mesh_reference_words}"
    of = f", degree {degree}" if degree != 3 else ""
    _title(figure, f"{result.name}, {model}{of}: error against number of elements ({against})")
    return figure


def _whole_decades(axes: Axes) -> None:
    low, high = axes.get_ylim()
    axes.set_ylim(10 ** np.floor(np.log10(low)), 10 ** np.ceil(np.log10(high)))


def _least_error(result: Bench, cell: Cell) -> float | None:
    return min((p.error for p in result.points_of(cell) if p.error is not None), default=None)


def _total_figure(result: Bench, model: str) -> Figure:
    """Draw the best points of every mesh with the error of the mesh included."""
    figure = _figure((9.0, 5.0))
    axes = figure.subplots()
    axes.set_xscale("log")
    axes.set_yscale("log")
    cells = [c for c in result.cells if c.model == model]
    for i, cell in enumerate(cells):
        best = pareto(result.points_of(cell))
        cpu, error = [p.cpu or 0.0 for p in best], [p.total_error or np.nan for p in best]
        label = cell.mesh
        axes.plot(cpu, error, "o-", color=_COLOURS[i % len(_COLOURS)], linewidth=1.6, label=label)
    _dress_precision(axes, "largest error, mesh included / range [-]")
    _whole_decades(axes)
    _outside_legend(figure, [axes])
    _title(figure, f"{result.name}, {model}: total error against run time, best method of each mesh")
    return figure


def _degree_figure(result: Bench, model: str) -> Figure:
    """Draw refinement by elements and by degree: mesh error against unknowns, total error against time."""
    figure = _figure((11.0, 5.0))
    left, right = figure.subplots(1, 2)
    for i, degree in enumerate(result.degrees(model)):
        style = {"color": _COLOURS[i % len(_COLOURS)], "linewidth": 1.6, "label": f"degree {degree}"}
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
    _title(figure, f"{result.name}, {model}: refinement by elements and by degree")
    return figure


# --- matrix separation ---------------------------------------------------------------------------

_FORM_STYLES = {
    "direct": ("#D55E00", "s"),
    "tabulated": ("#E69F00", "D"),
    "separated": ("#0072B2", "o"),
    "gram": ("#009E73", "^"),
}


def draw_separation(result: SeparationBench, folder: Path) -> list[str]:
    """Draw the time of each form, and its ratio to the direct one, over the number of elements.

    Parameters
    ----------
    result : SeparationBench
        What `hfsim.studies.separation.measure` found.
    folder : Path
        Where the PNG files go.

    Returns
    -------
    list of str
        File names written; none if nothing was measured.
    """
    kinds = dict.fromkeys(cell.element for cell in result.cells if cell.forms)
    return _save({f"separation_{kind}": _separation_figure(result, kind) for kind in kinds}, folder)


def _separation_figure(result: SeparationBench, kind: str) -> Figure:
    cells = [cell for cell in result.cells if cell.element == kind and cell.forms]
    counts = [cell.elements for cell in cells]
    figure = _figure((10.0, 7.0))
    grid = figure.subplots(2, 3, sharex=True, sharey="row")
    for column, (name, words) in enumerate(_SEPARATION_TIMES.items()):
        above, below = grid[:, column]
        for at, form in enumerate(cells[0].forms):
            colour, marker = _FORM_STYLES.get(form.form, ("0.3", "x"))
            style: dict[str, Any] = {"color": colour, "marker": marker, "markersize": 5, "label": form.form}
            forms = [cell.forms[at] for cell in cells]
            spreads = [getattr(one, name) for one in forms]
            middle = 1e6 * np.array([one.median for one in spreads])
            ends = 1e6 * np.array([[one.least for one in spreads], [one.most for one in spreads]])
            above.errorbar(counts, middle / _per_run(name), np.abs(ends - middle) / _per_run(name), **style)
            below.plot(counts, [100.0 * getattr(one, f"{name}_ratio") for one in forms], **style)
        below.axhline(100.0 * PAPER_RATIO, color="0.5", linestyle=":", label="the paper's ratio, 10 %")
        above.text(0.04, 0.96, words, transform=above.transAxes, va="top")
        _dress_counts(above, counts)
        _dress_counts(below, counts)
        below.set_xlabel("elements")
    grid[0, 0].set_ylabel("CPU time [us]")
    grid[1, 0].set_ylabel("CPU time / direct [%]")
    _outside_legend(figure, [grid[1, 0]])
    _title(figure, f"ways to the elastic force, element {kind}")
    return figure


_SEPARATION_TIMES = {"force": "force", "both": "force and tangent", "run": "a step of the whole run"}


def _per_run(name: str) -> int:
    return STEPS if name == "run" else 1


def _dress_counts(axes: Axes, counts: Sequence[int]) -> None:
    axes.set_xscale("log", base=2)
    axes.set_yscale("log")
    axes.set_xticks(counts, [str(count) for count in counts])
    axes.yaxis.set_major_formatter(FormatStrFormatter("%g"))
    axes.grid(True, color="0.9", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)


# --- stability maps ------------------------------------------------------------------------------

_CLASS_STYLES = {
    "accurate": ("#009E73", "A"),
    "wrong": ("#E69F00", "W"),
    "unstable": ("#D55E00", "U"),
    "broken": ("#CC79A7", "B"),
    "physical": ("#56B4E9", "P"),
    "no result": ("0.75", "?"),
    "not computed": ("white", ""),
}
"""Colour (Okabe and Ito) and letter of each class; the letter serves where colours do not."""
_MOST_LETTERS = 24
"""Columns of a panel up to which cells carry their letter."""


def draw_stability(result: StabilityMap, folder: Path) -> list[str]:
    """Draw the classes over the axes, one panel for each model and method.

    Parameters
    ----------
    result : StabilityMap
        What `hfsim.studies.stability.stability_map` found, over one or two axes.
    folder : Path
        Where the PNG files go.

    Returns
    -------
    list of str
        File names written.
    """
    if not result.axes:
        return []
    draw = _map_figure if len(result.axes) == 2 else _strips_figure
    return _save({"stability": draw(result)}, folder)


def _map_figure(result: StabilityMap) -> Figure:
    models = list(dict.fromkeys(model for model, _ in result.rows()))
    methods = list(dict.fromkeys(method for _, method in result.rows()))
    figure = _figure((2.6 + 2.9 * len(methods), 1.2 + 2.3 * len(models)))
    panels = figure.subplots(len(models), len(methods), squeeze=False, sharex=True, sharey=True)
    (y_name, ys, _), (x_name, xs, _) = result.axes
    for i, model in enumerate(models):
        for j, method in enumerate(methods):
            axes: Axes = panels[i, j]
            points = result.points_of(model, method)
            classes = [[points[y, x].outcome if (y, x) in points else "not computed" for x in xs] for y in ys]
            _classes_panel(axes, classes)
            axes.set_title(f"{model}, {method}", fontsize=10)
            _value_ticks(axes, xs, "x")
            _value_ticks(axes, ys, "y")
        panels[i, 0].set_ylabel(y_name)
    for axes in panels[-1]:
        axes.set_xlabel(x_name)
    figure.suptitle(f"{result.name}: where methods and models hold", fontsize=12, x=0.01, ha="left")
    _class_legend(figure, result)
    return figure


def _strips_figure(result: StabilityMap) -> Figure:
    """Draw one strip for each model and method along the one axis."""
    rows, (name, values, _) = result.rows(), result.axes[0]
    figure = _figure((min(14.0, 4.2 + 0.55 * len(values)), 1.6 + 0.42 * len(rows)))
    axes = figure.subplots()
    classes = []
    for model, method in rows:
        points = result.points_of(model, method)
        classes.append([points[v,].outcome if (v,) in points else "not computed" for v in values])
    _classes_panel(axes, classes)
    _value_ticks(axes, values, "x")
    axes.set_yticks(range(len(rows)), [f"{model}, {method}" for model, method in rows])
    axes.invert_yaxis()
    axes.set_xlabel(name)
    _title(figure, f"{result.name}: where methods and models hold")
    _class_legend(figure, result)
    return figure


def _classes_panel(axes: Axes, classes: Sequence[Sequence[str]]) -> None:
    known = list(_CLASS_STYLES)
    numbers = [[known.index(one) for one in row] for row in classes]
    colours = ListedColormap([colour for colour, _ in _CLASS_STYLES.values()])
    axes.pcolormesh(
        numbers, cmap=colours, vmin=-0.5, vmax=len(known) - 0.5, edgecolors="white", linewidth=1.0
    )  # fmt: skip
    axes.set_xticks([])
    axes.spines[:].set_visible(False)
    # cells are centred on whole numbers, where ticks and letters go
    mesh = axes.collections[-1]
    mesh.set_transform(Affine2D().translate(-0.5, -0.5) + axes.transData)
    axes.set_xlim(-0.5, len(classes[0]) - 0.5)
    axes.set_ylim(-0.5, len(classes) - 0.5)
    if len(classes[0]) > _MOST_LETTERS:
        return
    for i, row in enumerate(classes):
        for j, one in enumerate(row):
            axes.text(j, i, _CLASS_STYLES[one][1], ha="center", va="center", fontsize=8, color="black")


def _value_ticks(axes: Axes, values: Sequence[float | str], which: str) -> None:
    every = max(1, -(-len(values) // 8))
    places = list(range(0, len(values), every))
    labels = [values[i] if isinstance(values[i], str) else f"{values[i]:.3g}" for i in places]
    if which == "x":
        axes.set_xticks(places, [str(label) for label in labels], rotation=45, ha="right", fontsize=8)
    else:
        axes.set_yticks(places, [str(label) for label in labels], fontsize=8)


def _class_legend(figure: Figure, result: StabilityMap) -> None:
    shown = [name for name in _CLASS_STYLES if name in result.counts()]
    handles = [
        Patch(facecolor=_CLASS_STYLES[name][0], edgecolor="0.6", label=_class_label(name)) for name in shown
    ]
    figure.legend(handles=handles, loc="outside right upper", frameon=False)


def _class_label(name: str) -> str:
    letter = _CLASS_STYLES[name][1]
    return f"{letter}  {name}" if letter else name
