"""What pictures of moving bodies share, whatever they are projected on: tracks, shapes, axes of one scale."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from hfsim.marching.solution import Run
from hfsim.maths.arrays import Array
from hfsim.output.plots.style import TIME_COLOURS, colour, new_figure

_SHAPES, _SOLIDS = 20, 9
"""Number of shapes in a stroboscopic picture: of lines, and where some body has edges that meet inside."""


def tracks_of(run: Run) -> dict[str, Array]:
    """Return the positions (n_times, n_dim) of all points with channels for all of their coordinates."""
    columns = {channel.name: channel.values for channel in run.channels}
    axes = ("x", "y", "z")[: run.dimension]
    points = dict.fromkeys(name[:-2] for name in columns if name.endswith(".x"))
    whole = [point for point in points if all(f"{point}.{axis}" in columns for axis in axes)]
    return {point: np.column_stack([columns[f"{point}.{axis}"] for axis in axes]) for point in whole}


def draw_tracks(axes: Axes, tracks: Mapping[str, Array]) -> None:
    """Draw projected tracks, shape (n_times, 2), with their starts and ends."""
    for i, (point, track) in enumerate(tracks.items()):
        axes.plot(*track.T, color=colour(i), linewidth=1.3, label=point)
        axes.plot(*track[0], "o", color=colour(i), markerfacecolor="white")
        axes.plot(*track[-1], "s", color=colour(i))
    axes.plot([], [], "o", color="0.3", markerfacecolor="white", label="start")
    axes.plot([], [], "s", color="0.3", label="end")


def track_words(tracks: Mapping[str, Array]) -> str:
    """Return the title of a picture of tracks."""
    return f"path of {next(iter(tracks))}" if len(tracks) == 1 else "paths of points"


def draw_shapes(axes: Axes, outlines: Mapping[str, Array], times: Array) -> LineCollection:
    """Draw projected outlines, shape (n_times, n_points, 2), coloured by time; return the lines."""
    lines = LineCollection([], cmap=TIME_COLOURS, linewidths=1.6, capstyle="round", joinstyle="round")
    lines.set_segments([points[k] for k in range(len(times)) for points in outlines.values()])
    lines.set_array(np.repeat(times, len(outlines)))
    axes.add_collection(lines, autolim=False)
    for points in outlines.values():
        ends = points[:, [0, -1]].reshape(-1, 2)
        axes.scatter(ends[:, 0], ends[:, 1], s=7, c=np.repeat(times, 2), cmap=TIME_COLOURS, zorder=3)
    return lines


def shown_outlines(run: Run) -> tuple[Array, dict[str, Array]] | None:
    """Return times and outlines at those that a picture shows; None where there are none."""
    if run.outline_t is None or not len(run.outline_t):
        return None
    outlines = {body: points for body, points in run.outlines.items() if points.size}
    if not outlines:
        return None
    count = _SOLIDS if any(_solid(points[0]) for points in outlines.values()) else _SHAPES
    frames = np.unique(np.linspace(0, len(run.outline_t) - 1, count).round().astype(int))
    return run.outline_t[frames], {body: points[frames] for body, points in outlines.items()}


def _solid(points: Array) -> bool:
    """Return whether a polyline (n_points, n_dim) comes back to some of its points on its way."""
    return len(np.unique(points, axis=0)) < len(points) - 1


def bounds(points: Array, least: float = 0.12) -> Array:
    """Return the smallest and largest coordinates to be shown, shape (2, n_dim).

    No side is shorter than a part ``least`` of the longest.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    size = np.maximum(high - low, least * max(float((high - low).max()), 1e-9))
    middle = 0.5 * (low + high)
    return np.array([middle - 0.55 * size, middle + 0.55 * size])


def equal_axes(points: Array) -> tuple[Figure, Axes]:
    """Return a figure with axes of one scale, shaped to hold `points`, shape (n, 2) [m]."""
    low, high = bounds(points)
    ratio = float((high[1] - low[1]) / (high[0] - low[0]))
    width = float(np.clip(6.0 / ratio, 4.0, 8.0))
    figure = new_figure((width + 1.4, float(np.clip(width * ratio, 2.0, 6.5)) + 1.0))
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    return figure, axes
