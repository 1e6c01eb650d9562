"""Axes of a stated size, and what is drawn in them, from the first to the last."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.output.plots.ink import LINE, POINT, Colour, Fitted, Frame, Ink, Mark, Pen, fitted, text_width
from hfsim.output.plots.scale import Axis

_TICK, _TO_WORDS, _TO_LABEL = 3.5 * POINT, 7.0 * POINT, 4.0 * POINT
"""Length of a tick; from an axis to its numbers, from these to its label [inch]."""
_NUMBER = 10.0 * POINT
"""Height of the numbers below an axis [inch]."""
_WIDE, _HIGH = 0.8, 0.27
"""From a number along an axis to the next at least, across and upward [inch]."""
TITLED, _TITLE = 0.22, 9.0
"""Room for the title of a panel [inch], and its size [points]."""
_GRID = Pen("0.9")
_MARGIN = 0.05
_NONE = np.zeros((0, 2))
_UNSTATED = Axis(0.0, 1.0)
_HEAD = (4.0 * POINT, 2.0 * POINT)
"""Length and half the width of the head of an arrow [inch]."""


class Curve(NamedTuple):
    """A line through points, with signs at all of them or at some.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        It is broken where they are not finite.
    label : str
        In the legend; none: not there.
    ends : bool
        Whether only the first and the last point are marked.
    clipped : bool
        Whether nothing is drawn outside the axes.
    """

    points: Array
    pen: Pen | None = None
    label: str = ""
    mark: Mark | None = None
    ends: bool = False
    clipped: bool = True

    def draw(self, ink: Ink, panel: Panel) -> None:
        """Draw it in its panel."""
        points, frame = panel.place(self.points), panel.frame if self.clipped else None
        if self.pen is not None and len(points):
            ink.line(points, self.pen, frame)
        if self.mark is not None and len(points):
            ink.marks(points[[0, -1]] if self.ends else points, self.mark, frame)

    def draw_key(self, ink: Ink, x: float, y: float, width: float) -> None:
        """Draw its sign in a legend."""
        ends = np.array([(x, y), (x + width, y)])
        if self.pen is not None:
            ink.line(ends, self.pen)
        if self.mark is not None:
            ink.marks(ends.mean(axis=0)[None], self.mark)


def key(label: str, pen: Pen | None = None, mark: Mark | None = None) -> Curve:
    """Return what stands in a legend alone."""
    return Curve(_NONE, pen, label, mark)


class Strokes(NamedTuple):
    """Lines of one colour, each through points (n, 2)."""

    every: Sequence[Array]
    pen: Pen
    cap: str = "butt"

    def draw(self, ink: Ink, panel: Panel) -> None:
        """Draw them in their panel."""
        ink.lines([panel.place(one) for one in self.every], self.pen, panel.frame, self.cap)


class Note(NamedTuple):
    """Words at a point of the data or, ``inside``, of the axes, whose sides are 1 long.

    Attributes
    ----------
    size : float
        [points]
    across, up : str
        Which side of the words is there; see `Ink.words`.
    move : tuple of float
        How far from there [points].
    """

    text: str
    x: float
    y: float
    size: float = 10.0
    colour: Colour = "0.35"
    across: Any = "center"
    up: Any = "center"
    move: tuple[float, float] = (0.0, 0.0)
    inside: bool = False

    def draw(self, ink: Ink, panel: Panel) -> None:
        """Write it."""
        sides = np.array([panel.width, panel.height])
        corner = np.array([panel.left, panel.bottom])
        there = np.array([self.x, self.y])
        x, y = corner + sides * there if self.inside else panel.place(there[None])[0]
        x, y = x + POINT * self.move[0], y + POINT * self.move[1]
        ink.words(self.text, x, y, self.size, self.colour, self.across, self.up)


class Arrow(NamedTuple):
    """From a point of the data, shape (2,), to another."""

    begin: Array
    end: Array
    colour: Colour = "0.35"

    def draw(self, ink: Ink, panel: Panel) -> None:
        """Draw it."""
        begin, end = panel.place(np.array([self.begin, self.end]))
        along = (end - begin) / (np.linalg.norm(end - begin) or 1.0)
        aside = np.array([-along[1], along[0]])
        back = end - _HEAD[0] * along
        ink.line(np.array([begin, back]), Pen(self.colour, 1.0))
        head = np.array([end, back + _HEAD[1] * aside, back - _HEAD[1] * aside, end])
        ink.area(head, self.colour)
        ink.line(head, Pen(self.colour, 1.0))


class Panel:
    """Axes on a sheet.

    Attributes
    ----------
    x, y, width, height : float
        From the lower left corner of the lowest, leftmost ones [inch].
    left, bottom : float
        From that of the sheet, once it is finished [inch].
    across, upward : Axis
    framed : bool
        Whether axes, ticks and a grid are drawn.
    title : str
        Above it.
    things : list
        What is drawn in it, from the first to the last.
    """

    def __init__(self, x: float, y: float, width: float, height: float) -> None:
        self.x, self.y, self.width, self.height = x, y, width, height
        self.left = self.bottom = 0.0
        self.across = self.upward = _UNSTATED
        self.framed, self.title = False, ""
        self.things: list[Curve | Strokes | Note | Arrow] = []

    @property
    def curves(self) -> list[Curve]:
        """Those with labels."""
        return [one for one in self.things if isinstance(one, Curve) and one.label]

    @property
    def upward_label(self) -> Fitted:
        """What is written beside it, no longer than it is high."""
        return fitted(self.upward.label, self.height)

    @property
    def frame(self) -> Frame:
        """Where it is on the sheet [inch]."""
        return self.left, self.bottom, self.left + self.width, self.bottom + self.height

    def limit(
        self, x: tuple[float, float] | None = None, y: tuple[float, float] | None = None
    ) -> None:
        """State the ends of its axes."""
        if x is not None:
            self.across = Axis(*x)
        if y is not None:
            self.upward = Axis(*y)

    def fit(self) -> None:
        """Set the ends of its axes a little beyond its curves."""
        every = np.concatenate([_NONE, *(one.points for one in self.curves)])
        every = every[np.isfinite(every).all(axis=1)]
        self.limit(_around(every[:, 0]), _around(every[:, 1]))

    def dress(self, x_label: str, y_label: str) -> None:
        """Give it labels, ticks and a grid, for which its ends must be known."""
        self.framed = True
        self.across = self.across.told(x_label, _most(self.width / _WIDE, 8))
        self.upward = self.upward.told(y_label, _most(self.height / _HIGH, 6))

    @property
    def top(self) -> float:
        """Where it ends with its title [inch]."""
        return self.y + self.height + TITLED * bool(self.title)

    def hide_numbers(self, below: bool = True, beside: bool = False) -> None:
        """Write nothing below it, or beside it."""
        if below:
            self.across = self.across._replace(label="", words=())
        if beside:
            self.upward = self.upward._replace(label="", words=())

    def place(self, points: Array) -> Array:
        """Return where points (n, 2) of the data are on the sheet [inch]."""
        low = np.array([self.across.low, self.upward.low])
        size = np.array([self.across.high, self.upward.high]) - low
        scale = np.array([self.width, self.height]) / size
        return np.asarray((points - low) * scale + [self.left, self.bottom])

    def draw(self, ink: Ink) -> None:
        """Draw it and all that is in it."""
        left, bottom, right, top = self.frame
        if self.framed:
            x = self.place(np.column_stack([self.across.ticks, np.zeros(len(self.across.ticks))]))[:, 0]
            y = self.place(np.column_stack([np.zeros(len(self.upward.ticks)), self.upward.ticks]))[:, 1]
            grid = [np.array([(one, bottom), (one, top)]) for one in x]
            ink.lines([*grid, *(np.array([(left, one), (right, one)]) for one in y)], _GRID, self.frame)
            ticks = [np.array([(one, bottom), (one, bottom - _TICK)]) for one in x]
            ink.lines([*ticks, *(np.array([(left, one), (left - _TICK, one)]) for one in y)], Pen())
        for thing in self.things:
            thing.draw(ink, self)
        if self.title:
            size = fitted(self.title, self.width, _TITLE).size
            ink.words(self.title, left, top + 4.0 * POINT, size, up="bottom")
        if self.framed:
            sides = np.array([(left, top), (left, bottom)]), np.array([(left, bottom), (right, bottom)])
            ink.lines(sides, Pen(), cap="projecting")
            self._write(ink, x.tolist(), y.tolist())

    def _write(self, ink: Ink, x: list[float], y: list[float]) -> None:
        left, bottom, right, top = self.frame
        for word, place in zip(self.across.words, x, strict=False):
            ink.words(word, place, bottom - _TO_WORDS, across="center", up="top")
        for word, place in zip(self.upward.words, y, strict=False):
            ink.words(word, left - _TO_WORDS, place, across="right", up="middle")
        below = bottom - _TO_WORDS - _NUMBER - _TO_LABEL
        if self.across.label:
            ink.words(self.across.label, 0.5 * (left + right), below, across="center", up="top")
        beside = left - _TO_WORDS - max(map(text_width, self.upward.words), default=0.0) - _TO_LABEL
        label, middle = self.upward_label, 0.5 * (bottom + top)
        for line in reversed(label.lines):
            ink.words(line, beside, middle, label.size, across="center", up="bottom", turned=True)
            beside -= LINE * label.size * POINT


def _most(room: float, most: int) -> int:
    """Return how many gaps between ticks there is room for."""
    return max(1, min(most, int(room)))


def mark_zero(panel: Panel) -> None:
    """Say of axes in which all curves are zero that they are, on a scale that shows it."""
    if panel.curves and not any(np.nan_to_num(curve.points[:, 1]).any() for curve in panel.curves):
        panel.limit(y=(-1.0, 1.0))
        panel.things.append(Note("zero", 0.5, 0.6, colour="0.4", inside=True))


def _around(values: Array) -> tuple[float, float]:
    """Return limits with a margin around finite values."""
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    margin = _MARGIN * (high - low) or _MARGIN * abs(high) or 1.0
    return low - margin, high + margin
