"""Pictures of one run: channels against time, paths of points, shapes of the bodies."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from hfsim.output.plots.style import (
    SIZE,
    colour,
    dress,
    ended,
    finished,
    new_figure,
    save,
    slug,
    stacked,
    with_unit,
)
from hfsim.parts.channels import CHANNELS, kind_of
from hfsim.run.solution import Channel, Run
from hfsim.run.stop import Budget

_FRAMES = 20
"""Number of shapes in a stroboscopic picture."""
_TIME_COLOURS = ListedColormap(matplotlib.colormaps["viridis_r"](np.linspace(0.1, 1.0, 256)))
"""Early to late, without the palest yellow, which is lost on white."""

def draw_run(run: Run, folder: Path, budget: Budget | None = None) -> list[str]:
    """Draw one run: channels against time, paths of points, shapes of the bodies.

    Parameters
    ----------
    run : Run
        A run with finite values only.
    folder : Path
        Where the PNG files go; made if anything is drawn.
    budget : Budget, optional
        Time for it; pictures that it does not suffice for are not drawn.

    Returns
    -------
    list of str
        File names written; only plots for which channels or outlines exist, none for an empty run.
    """
    if not len(run.t):
        return []
    figures = {**_time_figures(run), "path": _path_figure(run), "shapes": _shapes_figure(run)}
    return save(figures, folder, budget)


def _headline(run: Run, words: str) -> str:
    title = f"{run.name}, {run.model}: {words}"
    return title if run.status == "done" else f"{title} ({ended(run)})"


# --- against time ---------------------------------------------------------------------------------


def _time_figures(run: Run) -> dict[str, Figure]:
    """Return a picture for each plot that channels name, then one for each unit of the others."""
    figures: dict[str, Figure] = {}
    kinds = [(channel, kind_of(channel.name).plot) for channel in run.channels]
    for stem in dict.fromkeys(kind.plot.stem for kind in CHANNELS.values() if kind.plot.stem):
        chosen = [channel for channel, plot in kinds if plot.stem == stem]
        if chosen:
            figures[stem] = _time_figure(run, chosen)
    rest = [channel for channel, plot in kinds if not plot.stem]
    for unit in dict.fromkeys(channel.unit for channel in rest):
        name = slug("other_" + (unit or "number").replace("/", "_per_"))
        figures[name] = _time_figure(run, [channel for channel in rest if channel.unit == unit])
    return figures


def _time_figure(run: Run, channels: Sequence[Channel]) -> Figure:
    plot = kind_of(channels[0].name).plot
    return (_quantities_figure if plot.rows else _units_figure)(run, channels, plot.words)


def _quantities_figure(run: Run, channels: Sequence[Channel], words: str) -> Figure:
    """Draw a row for each quantity and a colour for each subject."""
    parts = [(*channel.name.rpartition(".")[::2], channel) for channel in channels]
    quantities = sorted({quantity for _, quantity, _ in parts})
    subjects = list(dict.fromkeys(subject for subject, _, _ in parts))
    figure = new_figure((SIZE[0], 1.4 + 2.4 * len(quantities)))
    rows = stacked(figure, len(quantities))
    for axes, wanted in zip(rows, quantities, strict=True):
        for subject, quantity, channel in parts:
            if quantity == wanted:
                axes.plot(run.t, channel.values, color=colour(subjects.index(subject)), label=subject)
        dress(axes, "", with_unit(wanted, channels[0].unit))
    what = f"{words} of {subjects[0]}" if len(subjects) == 1 else f"{words} of points"
    return _over_time(figure, rows, _headline(run, what))


def _units_figure(run: Run, channels: Sequence[Channel], words: str) -> Figure:
    """Draw a row for each unit and a colour for each channel."""
    units = list(dict.fromkeys(channel.unit for channel in channels))
    figure = new_figure((SIZE[0], 2.2 + 2.4 * len(units)))
    rows = stacked(figure, len(units))
    for axes, unit in zip(rows, units, strict=True):
        for i, channel in enumerate(c for c in channels if c.unit == unit):
            axes.plot(run.t, channel.values, color=colour(i), label=channel.name)
        dress(axes, "", with_unit(words, unit))
    return _over_time(figure, rows, _headline(run, channels[0].name if len(channels) == 1 else words))


def _over_time(figure: Figure, rows: Sequence[Axes], title: str) -> Figure:
    rows[-1].set_xlabel("time [s]")
    return finished(figure, title, rows)


# --- in the plane ---------------------------------------------------------------------------------


def _path_figure(run: Run) -> Figure | None:
    columns = {channel.name: channel.values for channel in run.channels}
    points = [name[:-2] for name in columns if name.endswith(".x") and f"{name[:-2]}.y" in columns]
    if not points or len(run.t) < 2:
        return None
    tracks = [np.column_stack([columns[f"{point}.x"], columns[f"{point}.y"]]) for point in points]
    figure, axes = _plane(np.vstack(tracks))
    for i, (point, track) in enumerate(zip(points, tracks, strict=True)):
        axes.plot(*track.T, color=colour(i), linewidth=1.3, label=point)
        axes.plot(*track[0], "o", color=colour(i), markerfacecolor="white")
        axes.plot(*track[-1], "s", color=colour(i))
    axes.plot([], [], "o", color="0.3", markerfacecolor="white", label="start")
    axes.plot([], [], "s", color="0.3", label="end")
    what = f"path of {points[0]}" if len(points) == 1 else "paths of points"
    return finished(figure, _headline(run, what), [axes])


def _shapes_figure(run: Run) -> Figure | None:
    outlines = {body: points[..., :2] for body, points in run.outlines.items() if points.size}
    times = run.outline_t
    if not outlines or times is None:
        return None
    frames = np.unique(np.linspace(0, len(times) - 1, _FRAMES).round().astype(int))
    figure, axes = _plane(np.vstack([points[frames].reshape(-1, 2) for points in outlines.values()]))
    lines = LineCollection([], cmap=_TIME_COLOURS, linewidths=1.6, capstyle="round")
    lines.set_segments([points[k] for k in frames for points in outlines.values()])
    lines.set_array(np.repeat(times[frames], len(outlines)))
    axes.add_collection(lines, autolim=False)
    for points in outlines.values():
        ends = points[frames][:, [0, -1]].reshape(-1, 2)
        axes.scatter(ends[:, 0], ends[:, 1], s=7, c=np.repeat(times[frames], 2), cmap=_TIME_COLOURS, zorder=3)
    figure.colorbar(lines, ax=axes, label="time [s]", fraction=0.04, pad=0.02)
    return finished(figure, _headline(run, "shapes of the bodies"))


def _plane(points: np.ndarray) -> tuple[Figure, Axes]:
    """Return a figure with equal axes, shaped to hold `points`, shape (n, 2) [m]."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = np.maximum(high - low, 0.12 * max(float((high - low).max()), 1e-9))
    middle = 0.5 * (low + high)
    half = 0.55 * size
    ratio = float(size[1] / size[0])
    width = float(np.clip(6.0 / ratio, 4.0, 8.0))
    figure = new_figure((width + 1.4, float(np.clip(width * ratio, 2.0, 6.5)) + 1.0))
    axes = figure.subplots()
    dress(axes, "x [m]", "y [m]")
    axes.set_aspect("equal")
    axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
    axes.set_ylim(middle[1] - half[1], middle[1] + half[1])
    return figure, axes
