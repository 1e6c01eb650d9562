"""Pictures of motion: in space three views that share their scales, and an oblique one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, Self

import numpy as np

from hfsim.marching.solution import Run
from hfsim.maths.arrays import Array
from hfsim.output.plots.ink import Pen
from hfsim.output.plots.panel import Arrow, Note, Panel, Strokes
from hfsim.output.plots.scale import Axis, ticks
from hfsim.output.plots.sheet import Sheet
from hfsim.output.plots.style import headline
from hfsim.output.plots.tracks import (
    bounds,
    draw_shapes,
    draw_tracks,
    equal_axes,
    shown_outlines,
    time_bar,
    track_words,
    tracks_of,
)

_VIEWS = {(0, 0): (0, 1), (1, 0): (0, 2), (1, 1): (1, 2)}
"""Row and column of each view, and the axes it shows: from above, below it from the front, then the right."""
_WIDTH, _HEIGHT = 7.2, 6.4
"""Of all views together [inch]."""
_BETWEEN = (0.95, 0.75)
"""Width and height between views [inch]."""
_THINNEST = 0.3
"""Shortest side of a view over the longest."""
_STEPS = (1, 2, 5, 10)
"""Between two lines of a grid, but for a power of ten."""
_AZIMUTH, _ELEVATION = np.radians(-60.0), np.radians(24.0)
"""From where the oblique picture is seen: from the right in front, and above."""
_ACROSS = np.array([-np.sin(_AZIMUTH), np.cos(_AZIMUTH), 0.0])
_UP = np.sin(_ELEVATION) * np.array([-np.cos(_AZIMUTH), -np.sin(_AZIMUTH), 1.0 / np.tan(_ELEVATION)])
_PLOTTED = np.array([_ACROSS, _UP])
"""Its horizontal and its vertical axis, in ground axes."""
SHADOW = "0.87"
"""Colour of what lies straight below the bodies."""


def track_figure(run: Run) -> Sheet | None:
    """Draw the paths of points in all views; None where there are none."""
    tracks = tracks_of(run)
    if not tracks or len(run.t) < 2:
        return None
    sheet, views = views_of(np.vstack(list(tracks.values())))
    for pair, panel in views.items():
        draw_tracks(panel, _seen(tracks, pair))
    return sheet.finish(headline(run, track_words(tracks)), list(views.values()))


def shapes_figure(run: Run) -> Sheet | None:
    """Draw the bodies at some times in all views; None where there are none."""
    shown = shown_outlines(run)
    if shown is None:
        return None
    times, outlines = shown
    sheet, views = views_of(_all_points(outlines))
    for pair, panel in views.items():
        draw_shapes(panel, _seen(outlines, pair), times)
    words = headline(run, "shapes of the bodies")
    return sheet.finish(words, list(views.values()), time_bar(outlines, times))


def oblique_shapes(run: Run) -> Sheet | None:
    """Draw the bodies at some times as seen from above in front; None where there are none."""
    shown = shown_outlines(run)
    if shown is None:
        return None
    times, outlines = shown
    sheet, panel, floor = oblique_axes(_all_points(outlines))
    shadows = [one for points in outlines.values() for one in oblique(floor.below(points))]
    panel.things.append(Strokes(shadows, Pen(SHADOW, 1.0)))
    draw_shapes(panel, {body: oblique(points) for body, points in outlines.items()}, times)
    words = headline(run, "shapes of the bodies")
    return sheet.finish(words, [panel], time_bar(outlines, times))


def _all_points(outlines: Mapping[str, Array]) -> Array:
    return np.vstack([points.reshape(-1, points.shape[-1]) for points in outlines.values()])


def _seen(curves: Mapping[str, Array], pair: tuple[int, int]) -> dict[str, Array]:
    return {name: points[..., pair] for name, points in curves.items()}


def views_of(points: Array) -> tuple[Sheet, dict[tuple[int, int], Panel]]:
    """Return a sheet and, by the two coordinates it shows, each view of points (n, n_dim) [m].

    One of the plane, three of space.
    """
    if points.shape[1] == 2:
        sheet, panel = equal_axes(points)
        panel.dress("x [m]", "y [m]")
        return sheet, {(0, 1): panel}
    low, high = bounds(points, _THINNEST)
    sizes = high - low
    x, y, z = sizes
    scale = min(_WIDTH / (x + y), _HEIGHT / (y + z))
    sheet, views = Sheet(), {}
    for (row, column), pair in _VIEWS.items():
        horizontal, vertical = pair
        place = column * (scale * x + _BETWEEN[0]), (1 - row) * (scale * z + _BETWEEN[1])
        panel = sheet.add(*place, *(scale * sizes[[horizontal, vertical]]).tolist())
        panel.across, panel.upward = (
            Axis(float(low[one]), float(high[one])).told(
                f"{'xyz'[one]} [m]", max(least, int(1.5 * scale * sizes[one])), _STEPS, least
            )
            for one, least in ((horizontal, 1), (vertical, 2))
        )
        panel.framed = True
        views[pair] = panel
    return sheet, views


# --- oblique ----------------------------------------------------------------------------------------


class Floor(NamedTuple):
    """A level grid below all that is drawn.

    Attributes
    ----------
    x, y : ndarray
        Where its lines are [m].
    z : float
        Its height [m].
    """

    x: Array
    y: Array
    z: float

    @classmethod
    def below_all(cls, points: Array) -> Self:
        """Return that of points, shape (n, 3) [m]."""
        low, high = bounds(points, _THINNEST)
        places = ticks(0.0, float((high - low).max()), 9, _STEPS)
        step = float(places[1] - places[0])
        first, last = np.floor(low / step), np.ceil(high / step)
        x, y = (step * np.arange(first[k], last[k] + 1.0) for k in range(2))
        return cls(x, y, float(np.floor(low[2] / (0.2 * step)) * 0.2 * step))

    @property
    def step(self) -> float:
        """Between two lines [m]."""
        return float(self.x[1] - self.x[0])

    @property
    def corner(self) -> Array:
        """The one with the smallest coordinates [m]."""
        return np.array([self.x[0], self.y[0], self.z])

    def lines(self) -> list[Array]:
        """Return its lines, each of shape (2, 3) [m]."""
        ends = (self.x[0], self.x[-1]), (self.y[0], self.y[-1])
        along_y = [np.array([(x, y, self.z) for y in ends[1]]) for x in self.x]
        return along_y + [np.array([(x, y, self.z) for x in ends[0]]) for y in self.y]

    def below(self, points: Array) -> Array:
        """Return points of it straight below others, (..., 3) [m]."""
        return np.concatenate([points[..., :2], np.full_like(points[..., 2:], self.z)], axis=-1)


def oblique(points: Array) -> Array:
    """Return where points (..., 3) are in the oblique picture, shape (..., 2) [m]."""
    return np.asarray(points @ _PLOTTED.T)


def oblique_axes(points: Array) -> tuple[Sheet, Panel, Floor]:
    """Return a sheet of the oblique view of points (n, 3) [m] with its floor and the ground's axes."""
    floor = Floor.below_all(points)
    lines = floor.lines()
    sheet, panel = equal_axes(oblique(np.vstack([points, *lines])))
    panel.things.append(Strokes([oblique(line) for line in lines], Pen("0.9")))
    corner = oblique(floor.corner)
    for name, along in zip("xyz", floor.step * _PLOTTED.T, strict=True):
        x, y = (corner + 1.15 * along).tolist()
        panel.things += [Arrow(corner, corner + along), Note(name, x, y)]
    words = ", ".join(f"{one:.4g}" for one in floor.corner)
    told = f"grid {floor.step:.4g} m, from ({words}) m"
    panel.things.append(Note(told, 0.0, 0.0, 9.0, across="left", up="top", inside=True))
    return sheet, panel, floor
