"""Pictures whose axes have stated sizes, with as much room around them as is written there.

They are drawn straight on the library's renderers: its own axes take several times as long, and pictures of
a run are many.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.output.plots.ink import LINE, POINT, Ink, Pen, text_width, wrapped
from hfsim.output.plots.panel import Curve, Panel

_NORMAL, _TITLE = 10.0, 12.0
_EDGE, _GAP = 0.12, 0.08
"""Around all that is drawn, and between parts of it [inch]."""
_KEY, _AFTER, _PITCH = 16.0 * POINT, 8.0 * POINT, 15.0 * POINT
"""Of a legend: width of a sign, from there to its words, from a line to the next [inch]."""
_BAR = 0.16
"""Width of a bar of colours [inch]."""


class Bar(NamedTuple):
    """A bar of colours for times [s].

    Attributes
    ----------
    colours : sequence of colours
        From the first time to the last.
    """

    colours: Sequence[Any]
    first: float
    last: float

    @property
    def words(self) -> tuple[str, str]:
        """What is written at its ends."""
        return f"{self.first:.4g}", f"{self.last:.4g}"


class Sheet:
    """A picture.

    Attributes
    ----------
    panels : list of Panel
    size : tuple of float
        Width and height, once it is finished [inch].
    title : list of str
        Its lines.
    legend : dict of str to Curve
    bar : Bar or None
    """

    def __init__(self) -> None:
        self.panels: list[Panel] = []
        self.size = (0.0, 0.0)
        self.title: list[str] = []
        self.legend: dict[str, Curve] = {}
        self.bar: Bar | None = None
        self._columns: list[list[str]] = []
        """Of the legend."""
        self._corner = (0.0, 0.0)
        """Lower left one of the panels [inch]."""

    def add(self, x: float, y: float, width: float, height: float) -> Panel:
        """Return new axes; see `Panel`."""
        panel = Panel(x, y, width, height)
        self.panels.append(panel)
        return panel

    def finish(self, title: str, rows: Sequence[Panel] = (), bar: Bar | None = None) -> Sheet:
        """Give it a title, a legend of the curves in some axes, and a bar of colours; return it."""
        wide, high = self._extent
        left, bottom = self._left(), self._bottom()
        found = {curve.label: curve for panel in rows for curve in panel.curves}
        self.legend, self.bar = found if len(found) > 1 else {}, bar
        self._columns = _columns([*self.legend], int((high + bottom - _EDGE) / _PITCH))
        beside = sum(map(_width, self._columns))
        right = beside + self._bar_room + _EDGE
        self.title = wrapped(title, wide + right - _EDGE, _TITLE)
        room = max(text_width(line, _TITLE) for line in self.title)
        right += max(0.0, room - wide - right + _EDGE)
        top = 2 * _GAP + len(self.title) * _TITLE * LINE * POINT
        self.size = left + wide + right, bottom + high + top
        self._corner = left, bottom
        for panel in self.panels:
            panel.left, panel.bottom = left + panel.x, bottom + panel.y
        return self

    def draw(self, renderer: Any) -> None:
        """Draw it on a renderer of the library."""
        ink = Ink(renderer)
        ink.area(_rectangle(0.0, 0.0, *self.size), "white")
        for panel in self.panels:
            panel.draw(ink)
        (left, bottom), (wide, high) = self._corner, self._extent
        pitch = _TITLE * LINE * POINT
        for k, line in enumerate(reversed(self.title)):
            ink.words(line, left, bottom + high + 2 * _GAP + k * pitch, _TITLE, up="bottom")
        if self.bar is not None:
            self._draw_bar(ink, self.bar, left + wide + 2 * _GAP)
        x = left + wide + self._bar_room + 2 * _GAP
        for column in self._columns:
            for k, label in enumerate(column):
                y = bottom + high - (k + 0.5) * _PITCH
                self.legend[label].draw_key(ink, x, y, _KEY)
                ink.words(label, x + _KEY + _AFTER, y, up="middle")
            x += _width(column)

    @property
    def _extent(self) -> tuple[float, float]:
        """Width and height of all axes together [inch]."""
        return max(one.x + one.width for one in self.panels), max(one.top for one in self.panels)

    @property
    def _bar_room(self) -> float:
        """What a bar of colours takes right of the axes, left of a legend [inch]."""
        return _BAR + 4 * _GAP + 0.25 + max(map(text_width, self.bar.words)) if self.bar is not None else 0.0

    def _left(self) -> float:
        """Return the room left of all axes [inch]."""
        room = [_EDGE]
        for panel in self.panels:
            if panel.framed and not panel.x:
                words = max(map(text_width, panel.upward.words), default=0.0)
                label = LINE * panel.upward_label.size * POINT * len(panel.upward_label.lines)
                room.append(_EDGE + label + 2 * _GAP + words)
        return max(room)

    def _bottom(self) -> float:
        """Return the room below all axes [inch]."""
        if not any(panel.framed for panel in self.panels if not panel.y):
            return 0.3  # a word on what is seen
        return _EDGE + _GAP + 2 * LINE * _NORMAL * POINT

    def _draw_bar(self, ink: Ink, bar: Bar, x: float) -> None:
        low, high = self._corner[1], self._corner[1] + self._extent[1]
        step = (high - low) / len(bar.colours)
        for k, own in enumerate(bar.colours):  # over one another: no seams
            ink.area(_rectangle(x, low + k * step, x + _BAR, min(high, low + (k + 1.5) * step)), own)
        ink.line(_rectangle(x, low, x + _BAR, high), Pen())
        for word, y in zip(bar.words, (low, high), strict=True):
            ink.line(np.array([(x + _BAR, y), (x + _BAR + 3.5 * POINT, y)]), Pen())
            ink.words(word, x + _BAR + 7.0 * POINT, y, up="middle")
        beside = x + _BAR + (8.0 + 0.76 * _NORMAL) * POINT
        ink.words("time [s]", beside, 0.5 * (low + high), across="center", turned=True)


def _columns(labels: Sequence[str], most: int) -> list[list[str]]:
    """Return labels in columns as long as one another, as near as may be, and no longer than ``most``."""
    rows = -(-len(labels) // -(-len(labels) // max(1, most))) if labels else 1
    return [[*labels[k : k + rows]] for k in range(0, len(labels), rows)]


def _width(column: Sequence[str]) -> float:
    """Return the width of a column of a legend, with what separates it from what is left of it [inch]."""
    return 2 * _GAP + _KEY + _AFTER + max(map(text_width, column))


def _rectangle(left: float, bottom: float, right: float, top: float) -> Array:
    return np.array([(left, bottom), (right, bottom), (right, top), (left, top), (left, bottom)])
