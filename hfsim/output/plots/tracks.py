"""What pictures of moving bodies share, whatever they are projected on: tracks, shapes, axes of one scale."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.colors import to_rgba

from hfsim.marching.solution import Run
from hfsim.maths.arrays import Array, IntArray, distinct
from hfsim.output.plots.ink import Mark, Pen
from hfsim.output.plots.panel import Curve, Panel, Strokes, key
from hfsim.output.plots.sheet import Bar, Sheet
from hfsim.output.plots.style import TIME_COLOURS, colour, dashes

OWN = range(2, 7)
"""Numbers of bodies that have colours of their own."""
_PALEST = 0.22
"""Strength of a colour at the start."""
_APART, _TRIED = 0.03, 100
"""How far apart shapes are at least, in sizes of the picture; times and points at most to see it of."""
_SHAPES, _SOLIDS = 20, 9
"""Number of shapes in a stroboscopic picture: of lines, and where some body has edges that meet inside."""


def tracks_of(run: Run) -> dict[str, Array]:
    """Return the positions (n_times, n_dim) of all points with channels for all of their coordinates."""
    columns = {channel.name: channel.values for channel in run.channels}
    axes = ("x", "y", "z")[: run.dimension]
    points = dict.fromkeys(name[:-2] for name in columns if name.endswith(".x"))
    whole = [point for point in points if all(f"{point}.{axis}" in columns for axis in axes)]
    return {point: np.column_stack([columns[f"{point}.{axis}"] for axis in axes]) for point in whole}


def draw_tracks(panel: Panel, tracks: Mapping[str, Array]) -> None:
    """Draw projected tracks, shape (n_times, 2), with their starts and ends."""
    for i, (point, track) in enumerate(tracks.items()):
        own = colour(i)
        panel.things.append(Curve(track, Pen(own, 1.3, dashes(i)), point))
        panel.things.append(Curve(track[:1], mark=_start(own)))
        panel.things.append(Curve(track[-1:], mark=_end(own)))
    panel.things += [key("start", mark=_start("0.3")), key("end", mark=_end("0.3"))]


def _start(own: str) -> Mark:
    return Mark("o", 6.0, "white", own)


def _end(own: str) -> Mark:
    return Mark("s", 6.0, own, own)


def track_words(tracks: Mapping[str, Array]) -> str:
    """Return the title of a picture of tracks."""
    return f"path of {next(iter(tracks))}" if len(tracks) == 1 else "paths of points"


def draw_shapes(panel: Panel, outlines: Mapping[str, Array], times: Array) -> None:
    """Draw projected outlines, shape (n_times, n_points, 2), paler or in other colours the earlier they are.

    One body, or very many, have the colours of time; of several, each has its own.
    """
    shades = (times - times[0]) / (times[-1] - times[0] or 1.0)
    groups: list[tuple[Mapping[str, Array], Array]] = [(outlines, TIME_COLOURS(shades))]
    if len(outlines) in OWN:
        groups = [({one: outlines[one]}, faded(colour(i), shades)) for i, one in enumerate(outlines)]
        panel.things += [key(one, Pen(tuple(own[-1]), 2.0)) for (one,), own in groups]
    for k in range(len(times)):
        for bodies, own in groups:
            pen = Pen(tuple(own[k]), 1.6)
            panel.things.append(Strokes([points[k] for points in bodies.values()], pen, "round"))
    for bodies, own in groups:
        for k in range(len(times)):
            ends = np.concatenate([points[k, [0, -1]] for points in bodies.values()])
            panel.things.append(Curve(ends, mark=Mark("o", 2.6, tuple(own[k]), tuple(own[k]), 1.5)))


def time_bar(outlines: Mapping[str, Array], times: Array) -> Bar | None:
    """Return the bar of colours of `draw_shapes`; grey where bodies have colours of their own.

    None where there is one time.
    """
    if len(times) < 2:
        return None
    shades = np.linspace(0.0, 1.0, 64)
    colours = faded("0.25", shades) if len(outlines) in OWN else TIME_COLOURS(shades)
    return Bar(colours[:, :3].tolist(), float(times[0]), float(times[-1]))


def faded(own: str, shades: Array) -> Array:
    """Return a colour from pale (0) to full (1), shape (n, 4)."""
    full = np.array(to_rgba(own))
    strength = (_PALEST + (1.0 - _PALEST) * np.asarray(shades))[:, None]
    return np.asarray(1.0 - strength * (1.0 - full) * [1, 1, 1, 0])


def shown_outlines(run: Run) -> tuple[Array, dict[str, Array]] | None:
    """Return times and outlines at those that a picture shows; None where there are none."""
    if run.outlined is None:
        return None
    times, outlines = run.outlined
    count = _SOLIDS if any(_solid(points[0]) for points in outlines.values()) else _SHAPES
    frames = apart(np.concatenate([*outlines.values()], axis=1), count)
    return times[frames], {body: points[frames] for body, points in outlines.items()}


def apart(points: Array, most: int) -> IntArray:
    """Return which of the positions (n_times, n_points, n_dim) of all points are drawn, first and last too.

    No two of these are nearer to one another, where they are farthest apart, than a part of the whole
    picture, so that they do not pile up; where more than ``most`` are left, that part is larger.
    """
    some = distinct(np.linspace(0, len(points) - 1, _TRIED).round().astype(int))
    seen = points[some][:, distinct(np.linspace(0, points.shape[1] - 1, _TRIED).round().astype(int))]
    least = _APART * float(np.ptp(points, axis=(0, 1)).max())
    far = [np.sqrt(((seen[:k] - seen[k]) ** 2).sum(axis=-1).max(axis=1)) for k in range(len(some))]
    while True:
        kept = [0]
        for k in range(1, len(some)):
            if far[k][kept].min() > least:
                kept.append(k)
        if kept[-1] != len(some) - 1:
            kept = [*(kept[:-1] if len(kept) > 1 else kept), len(some) - 1]
        if len(kept) <= max(2, most):
            return np.asarray(some[distinct(np.array(kept))])
        least *= 1.2


def _solid(points: Array) -> bool:
    """Return whether a polyline (n_points, n_dim) comes back to some of its points on its way."""
    return len(np.unique(points, axis=0)) < len(points) - 1


def bounds(points: Array, least: float = 0.12) -> Array:
    """Return the smallest and largest coordinates to be shown, shape (2, n_dim).

    No side is shorter than a part ``least`` of the longest.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    longest = max(float((high - low).max()), 1e-9 * float(np.abs(points).max())) or 1.0
    size = np.maximum(high - low, least * longest)
    middle = 0.5 * (low + high)
    return np.array([middle - 0.55 * size, middle + 0.55 * size])


def equal_axes(points: Array) -> tuple[Sheet, Panel]:
    """Return a sheet with axes of one scale, shaped to hold `points`, shape (n, 2) [m]."""
    low, high = bounds(points)
    ratio = float((high[1] - low[1]) / (high[0] - low[0]))
    width = float(np.clip(min(6.0 / ratio, 8.0), 2.0, 8.0))
    sheet = Sheet()
    panel = sheet.add(0.0, 0.0, width, width * ratio)
    panel.limit((float(low[0]), float(high[0])), (float(low[1]), float(high[1])))
    return sheet, panel
