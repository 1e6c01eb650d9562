"""Pictures of a sweep: a response over one variable, maps over two, a matrix and main effects over more."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from hfsim.maths.arrays import Array, IntArray
from hfsim.output.plots.figures import bare, new_figure, scaled, set_title, set_title_above
from hfsim.output.plots.files import save
from hfsim.output.plots.history import covering
from hfsim.output.plots.ink import fitted
from hfsim.output.plots.scale import with_unit
from hfsim.output.plots.style import BLUE, DASHES, RED, TIME_COLOURS, colour, slug
from hfsim.studies.sweep.effects import groups, main_effects, mean_curve
from hfsim.studies.sweep.result import Sweep
from hfsim.studies.sweep.sensitivity import Sensitivity

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

_MOST = 12
"""Quantities that are drawn."""
_CURVES = 6
"""Values of a second variable up to which each has a curve of its own, not a row of a map."""
_POINTS = 4000
"""Points of one panel."""
_PANELS = 6
"""Rows and columns of a matrix."""
_COLUMN, _ROW = 2.3, 1.7
"""Width and height of what is in one [inch]."""


def draw(sweep: Sweep, folder: Path) -> list[str]:
    """Draw the pictures of a sweep; return their names."""
    drawn = [name for name in sweep.collected if not np.isnan(sweep[name]).all()]
    figures: dict[str, Figure | None] = {}
    varied = [path for path in sweep.paths if len(set(sweep[path].tolist())) > 1]
    if len(varied) == 1 and drawn:
        for name in drawn[:_MOST]:
            figures[f"response_{_slug(name)}"] = _response(sweep, varied[0], name)
    if len(varied) == 2 and sweep.plan.kind == "grid":
        figures |= {f"map_{_slug(name)}": _over_two(sweep, varied, name) for name in drawn[:_MOST]}
    elif len(varied) > 1 and drawn:
        figures["scatter"] = _matrix(sweep, varied[:_PANELS], drawn[:_PANELS])
        figures["effects"] = _effects(sweep, varied[:_PANELS], drawn[:_PANELS])
    return save(figures, folder)


def _slug(name: str) -> str:
    """Return what is collected as it may stand in the name of a file."""
    return slug(name.replace("(", "_").replace(")", "").replace(", ", "_"))


def _label(sweep: Sweep, name: str) -> str:
    """Return what is varied or collected, with the unit of its numbers."""
    return name if sweep[name].dtype == object else with_unit(name, sweep.units.get(name, ""))


def _title(sweep: Sweep, words: str) -> str:
    done = sweep.counts.get("done", 0)
    some = "" if done == len(sweep) else f" ({done} of {len(sweep)} runs)"
    return f"{sweep.name}: {words}{some}"


def _response(sweep: Sweep, path: str, name: str) -> Figure:
    """Draw what is collected over the one entry that is varied."""
    figure = new_figure()
    axes = figure.subplots()
    places, ticks = _placed(sweep, path)
    values = sweep[name]
    order = _ordered(np.arange(len(sweep)), places)
    known = order[~np.isnan(values[order])]
    line = "" if ticks or (sweep.plan.kind == "sample" and len(sweep) > 50) else "-"
    axes.plot(places[known], values[known], f"o{line}", color=BLUE, markersize=4.5, linewidth=1.4)
    if _mark_failed(axes, places[np.isnan(values)]):
        axes.legend(frameon=False)
    _dress(axes, sweep, path, ticks)
    scaled(axes.yaxis, _label(sweep, name))
    set_title(figure, _title(sweep, f"{name} over {path}"))
    return figure


def _mark_failed(axes: Axes, places: Array, size: float = 6.0, at: float = 0.02, **style: Any) -> bool:
    """Mark near the lower edge, at this part of the height, if runs gave nothing; tell whether some did."""
    if len(places):
        style = {"color": RED, "markersize": size, "label": "no value", **style}
        axes.plot(places, np.full(len(places), at), "x", transform=axes.get_xaxis_transform(), **style)
    return bool(len(places))


def _ordered(runs: IntArray, places: Array) -> IntArray:
    """Return runs as they follow on an axis."""
    return runs[np.argsort(places[runs], kind="stable")]


def _placed(sweep: Sweep, path: str) -> tuple[Array, list[str]]:
    """Return where the values of an entry stand on an axis, and the words there if they are no numbers."""
    values = sweep[path]
    if values.dtype != object:
        return values, []
    words = list(dict.fromkeys(values.tolist()))
    return np.array([float(words.index(value)) for value in values.tolist()]), [str(word) for word in words]


def _is_logarithmic(sweep: Sweep, path: str) -> bool:
    values = sweep.plan.values[sweep.paths.index(path)]
    return values.logarithmic or values.kind in ("loguniform", "lognormal")


def _dress(axes: Axes, sweep: Sweep, path: str, ticks: list[str]) -> None:
    bare(axes)
    axes.set_axisbelow(True)
    if ticks:
        axes.set_xticks(range(len(ticks)), ticks)
        axes.set_xlim(-0.5, len(ticks) - 0.5)
        axes.set_xlabel(path)
    elif _is_logarithmic(sweep, path):
        axes.set(xscale="log", xlabel=_label(sweep, path))
        _tick_log(axes.xaxis)
    else:
        axes.xaxis.set_major_locator(MaxNLocator(8, steps=[1, 2, 2.5, 5, 10]))
        scaled(axes.xaxis, _label(sweep, path))


def _tick_log(axis: Axis) -> None:
    """Give a logarithmic axis few ticks: powers of ten, or 1, 2 and 5 where it has less than two of them."""
    low, high = axis.get_data_interval()
    short = high < 50.0 * low
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if short else (1.0,), numticks=8))
    axis.set_minor_formatter(NullFormatter())
    if short:
        axis.set_major_formatter(FuncFormatter(_tick))


# --- two entries ---------------------------------------------------------------------------------


def _over_two(sweep: Sweep, paths: list[str], name: str) -> Figure:
    """Draw a map over two entries, or curves over one where the other has few values or words."""
    counts = [len(set(sweep[path].tolist())) for path in paths]
    words = [sweep[path].dtype == object for path in paths]
    if not any(words) and min(counts) > _CURVES:
        return _heat_map(sweep, paths, name)
    other = 0 if words[0] and not words[1] else 1 if words[1] and not words[0] else int(counts[1] < counts[0])
    return _curves(sweep, paths[1 - other], paths[other], name)


def _curves(sweep: Sweep, path: str, other: str, name: str) -> Figure:
    """Draw what is collected over one entry, a curve for each value of the other."""
    figure = new_figure()
    axes = figure.subplots()
    places, ticks = _placed(sweep, path)
    _draw_each(axes, places, sweep[name], sweep[other])
    _dress(axes, sweep, path, ticks)
    scaled(axes.yaxis, _label(sweep, name))
    set_title(figure, _title(sweep, f"{name} over {path}"))
    figure.legend(loc="outside right upper", frameon=False, title=_label(sweep, other).split(".")[-1])
    return figure


def _draw_each(axes: Axes, places: Array, values: Array, kinds: Array) -> None:
    """Draw a curve for each kind of runs, dashed where it covers others, with crosses for no value."""
    distinct = list(dict.fromkeys(kinds.tolist()))
    shades = TIME_COLOURS(np.linspace(0.0, 1.0, len(distinct)))
    runs = [_ordered(np.flatnonzero(kinds == kind), places) for kind in distinct]
    over = covering([values[mine] for mine in runs], float(np.nanmax(values) - np.nanmin(values)))
    lost, step = 0, min(0.04, 0.3 / len(distinct))
    for k, (kind, mine) in enumerate(zip(distinct, runs, strict=True)):
        own = colour(k) if len(distinct) <= _CURVES else shades[k]
        known, missing = (mine[np.isnan(values[mine]) == nan] for nan in (False, True))
        shown = kind if isinstance(kind, str) else f"{kind:.4g}"
        shown = shown if len(known) else f"{shown}: no value"
        dash = DASHES[over[k] % len(DASHES)]
        size = 6.0 * 0.6 ** min(over[k], 3) if any(over) else 4.5  # so that marks below are seen
        style: dict[str, Any] = {"linestyle": (0.0, dash) if dash else "-", "linewidth": 1.4, "color": own}
        axes.plot(places[known], values[known], "o", markersize=size, label=shown, **style)
        lost += _mark_failed(axes, places[missing], at=0.02 + step * lost, color=own, label=None)
    if lost:
        _mark_failed(axes, np.array([math.nan]), color="0.3")


def _heat_map(sweep: Sweep, paths: list[str], name: str) -> Figure:
    """Draw what is collected as colours over two entries; what gave no value is grey."""
    figure = new_figure()
    axes = figure.subplots()
    x, y = (np.unique(sweep[path]) for path in paths)
    table = np.full((len(y), len(x)), math.nan)
    rows = np.searchsorted(y, sweep[paths[1]]), np.searchsorted(x, sweep[paths[0]])
    table[rows] = sweep[name]
    axes.set_facecolor("0.8")
    edges = [_edges(one, _is_logarithmic(sweep, path)) for one, path in zip((x, y), paths, strict=True)]
    mesh = axes.pcolormesh(*edges, np.ma.masked_invalid(table), cmap="viridis", rasterized=True)
    for axis, path in ((axes.xaxis, paths[0]), (axes.yaxis, paths[1])):
        if _is_logarithmic(sweep, path):
            (axes.set_xscale if axis is axes.xaxis else axes.set_yscale)("log")
            axis.set_label_text(_label(sweep, path))
            _tick_log(axis)
        else:
            scaled(axis, _label(sweep, path))
    bar = figure.colorbar(mesh, ax=axes, pad=0.02)
    scaled(bar.ax.yaxis, _label(sweep, name))
    set_title(figure, _title(sweep, name))
    return figure


def _edges(values: Array, logarithmic: bool) -> Array:
    """Return the borders of the cells around values, shape (n + 1,)."""
    at = np.log(values) if logarithmic else values
    middle = 0.5 * (at[1:] + at[:-1])
    edges = np.concatenate([[2.0 * at[0] - middle[0]], middle, [2.0 * at[-1] - middle[-1]]])
    return np.exp(edges) if logarithmic else edges


# --- more entries, and samples -------------------------------------------------------------------


def _panels(
    sweep: Sweep, paths: list[str], names: list[str], words: str, fill: Callable[[Axes, str, str], None]
) -> Figure:
    """Return a figure of what is collected, in rows, over each entry that is varied, in columns."""
    size = (1.2 + _COLUMN * len(paths), 0.9 + _ROW * len(names))
    figure = new_figure((max(6.0, size[0]), max(3.2, size[1])))
    panels = figure.subplots(len(names), len(paths), squeeze=False, sharex="col", sharey="row")
    for (j, path), (i, name) in product(enumerate(paths), enumerate(names)):
        axes: Axes = panels[i, j]
        fill(axes, path, name)
        _dress_panel(axes, sweep, path)
        if i == len(names) - 1:
            _write(axes.xaxis, _label(sweep, path), _COLUMN - 0.2)
        if j == 0:
            _write(axes.yaxis, _label(sweep, name), _ROW - 0.2)
    set_title_above(figure, _title(sweep, words))
    return figure


def _matrix(sweep: Sweep, paths: list[str], names: list[str]) -> Figure:
    """Draw all runs."""
    some = np.linspace(0, len(sweep) - 1, min(len(sweep), _POINTS)).astype(int)
    dot = 5.0 if len(some) < 500 else 3.0

    def fill(axes: Axes, path: str, name: str) -> None:
        places, ticks = _placed(sweep, path)
        if ticks:
            places = places + np.random.default_rng(1).uniform(-0.15, 0.15, len(places))
        values = sweep[name][some]
        axes.plot(places[some], values, "o", color=BLUE, markersize=dot, alpha=0.5, markeredgewidth=0.0)
        _mark_failed(axes, places[some][np.isnan(values)], 4.0)

    return _panels(sweep, paths, names, "all runs", fill)


def _write(axis: Axis, label: str, room: float) -> None:
    """Label an axis in small letters, no longer than stated [inch]."""
    words = fitted(label, room, 9.0)
    axis.set_label_text("\n".join(words.lines), fontsize=words.size)


def _dress_panel(axes: Axes, sweep: Sweep, path: str) -> None:
    _, ticks = _placed(sweep, path)
    _dress(axes, sweep, path, ticks)
    axes.set_xlabel("")
    axes.tick_params(labelsize=8)
    if not ticks and not _is_logarithmic(sweep, path):
        axes.xaxis.set_major_locator(MaxNLocator(4))
        axes.xaxis.set_major_formatter(FuncFormatter(_tick))
    axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.yaxis.set_major_formatter(FuncFormatter(_tick))


def _tick(value: float, _: Any) -> str:
    return f"{value:.4g}".replace("e+0", "e").replace("e-0", "e-").replace("-", "\N{MINUS SIGN}")


def _effects(sweep: Sweep, paths: list[str], names: list[str]) -> Figure:
    """Draw the mean of what is collected over each entry, with the share of the variance that explains."""
    shares = main_effects(sweep)

    def fill(axes: Axes, path: str, name: str) -> None:
        place, centres = groups(sweep[path])
        at = np.arange(len(centres), dtype=float) if _placed(sweep, path)[1] else np.array(centres)
        own = colour(paths.index(path))
        axes.plot(at, mean_curve(sweep[name], place, len(centres)), "o-", color=own, markersize=4.0)
        share = shares[name][path]
        if share is not None:
            axes.set_title(f"{100 * share:.0f} %", loc="left", fontsize=8, color="0.35")

    return _panels(sweep, paths, names, "means, and shares of the variance", fill)


def draw_elasticities(name: str, found: Sequence[Sensitivity], folder: Path) -> list[str]:
    """Draw how much per cent of each quantity one per cent of each entry changes; return the files."""
    known = [one for one in found if one.elasticity is not None]
    if not known:
        return []
    quantities = list(dict.fromkeys(one.quantity for one in known))[:_MOST]
    paths = list(dict.fromkeys(one.path for one in known))
    figure = new_figure((8.0, 1.6 + 0.3 * len(quantities) * (len(paths) + 0.6)))
    axes = figure.subplots()
    high = 0.8 / len(paths)
    for k, path in enumerate(paths):
        mine = [one for one in known if one.path == path and one.quantity in quantities]
        at = [quantities.index(one.quantity) + (k - 0.5 * (len(paths) - 1)) * high for one in mine]
        scale = [abs(one.at / one.value) if one.value else 0.0 for one in mine]
        errors = [(one.error or 0.0) * factor for one, factor in zip(mine, scale, strict=True)]
        long = [one.elasticity or 0.0 for one in mine]
        axes.barh(at, long, 0.9 * high, xerr=errors, color=colour(k), label=path, error_kw={"capsize": 2.5})
    axes.axvline(0.0, color="0.3", linewidth=0.8)
    axes.set_yticks(range(len(quantities)), quantities)
    axes.invert_yaxis()
    scaled(axes.xaxis, "% of the quantity for 1 % of the entry")
    bare(axes, axis="x")
    axes.set_axisbelow(True)
    if len(paths) > 1:
        figure.legend(loc="outside lower center", frameon=False, ncols=2)
    set_title(figure, f"{name}: what entries change")
    return save({"sensitivity": figure}, folder)
