"""Pictures of one run: channels against time, paths of points, shapes of the bodies."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from hfsim.output.plots.style import (
    COLOURS,
    SIZE,
    dress,
    ended,
    new_figure,
    outside_legend,
    save,
    set_title,
    slug,
    stacked,
    with_unit,
)
from hfsim.run.solution import Channel, Run

_FRAMES = 20
"""Number of shapes in a stroboscopic picture."""
_TIME_COLOURS = ListedColormap(matplotlib.colormaps["viridis_r"](np.linspace(0.1, 1.0, 256)))
"""Early to late, without the palest yellow, which is lost on white."""
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
    return save({name: figure for name, figure in figures.items() if figure is not None}, folder)


def _headline(run: Run, words: str) -> str:
    title = f"{run.name}, {run.model}: {words}"
    return title if run.status == "done" else f"{title} ({ended(run)})"


# --- against time ---------------------------------------------------------------------------------


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
        name = slug("other_" + (unit or "number").replace("/", "_per_"))
        figures[name] = _channels_figure(run, chosen, _UNIT_WORDS.get(unit, "other outputs"))
    return figures


def _position_figure(run: Run, channels: Sequence[Channel], words: str) -> Figure:
    directions = sorted({channel.name[-1] for channel in channels})
    figure = new_figure((SIZE[0], 1.4 + 2.4 * len(directions)))
    rows = stacked(figure, len(directions))
    points = list(dict.fromkeys(channel.name[:-2] for channel in channels))
    for axes, direction in zip(rows, directions, strict=True):
        for channel in (c for c in channels if c.name.endswith(f".{direction}")):
            colour = COLOURS[points.index(channel.name[:-2]) % len(COLOURS)]
            axes.plot(run.t, channel.values, color=colour, label=channel.name[:-2])
        dress(axes, "", with_unit(direction, channels[0].unit))
    rows[-1].set_xlabel("time [s]")
    outside_legend(figure, rows)
    what = f"{words} of {points[0]}" if len(points) == 1 else f"{words} of points"
    set_title(figure, _headline(run, what))
    return figure


def _channels_figure(run: Run, channels: Sequence[Channel], words: str) -> Figure:
    units = list(dict.fromkeys(channel.unit for channel in channels))
    figure = new_figure((SIZE[0], 2.2 + 2.4 * len(units)))
    rows = stacked(figure, len(units))
    for axes, unit in zip(rows, units, strict=True):
        for i, channel in enumerate(c for c in channels if c.unit == unit):
            axes.plot(run.t, channel.values, color=COLOURS[i % len(COLOURS)], label=channel.name)
        dress(axes, "", with_unit(words, unit))
    rows[-1].set_xlabel("time [s]")
    single = len(channels) == 1
    if not single:
        outside_legend(figure, rows)
    set_title(figure, _headline(run, channels[0].name if single else words))
    return figure


# --- in the plane ---------------------------------------------------------------------------------


def _path_figure(run: Run) -> Figure | None:
    columns = {channel.name: channel.values for channel in run.channels}
    points = [name[:-2] for name in columns if name.endswith(".x") and f"{name[:-2]}.y" in columns]
    if not points or len(run.t) < 2:
        return None
    tracks = [np.column_stack([columns[f"{point}.x"], columns[f"{point}.y"]]) for point in points]
    figure, axes = _plane(np.vstack(tracks))
    for i, (point, track) in enumerate(zip(points, tracks, strict=True)):
        colour = COLOURS[i % len(COLOURS)]
        axes.plot(*track.T, color=colour, linewidth=1.3, label=point)
        axes.plot(*track[0], "o", color=colour, markerfacecolor="white")
        axes.plot(*track[-1], "s", color=colour)
    axes.plot([], [], "o", color="0.3", markerfacecolor="white", label="start")
    axes.plot([], [], "s", color="0.3", label="end")
    outside_legend(figure, [axes])
    what = f"path of {points[0]}" if len(points) == 1 else "paths of points"
    set_title(figure, _headline(run, what))
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
    set_title(figure, _headline(run, "shapes of the bodies"))
    return figure


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
