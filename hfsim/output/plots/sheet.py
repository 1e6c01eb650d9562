"""Figures whose axes have stated sizes, with as much room around them as is written there.

The library's own layout draws everything several times; pictures of a run are many.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.ticker import FixedFormatter, FixedLocator

from hfsim.output.plots.style import DPI, labelled

_SMALL, _NORMAL, _TITLE = 10.0, 10.0, 12.0
_EDGE, _GAP = 0.12, 0.08
"""Around all that is drawn, and between parts of it [inch]."""
_LINE = 1.35
"""Height of a line of text over its size."""
_HANDLE = 0.45
"""Of a curve in a legend, with its gaps [inch]."""
_BAR = 0.16
"""Width of a bar of colours [inch]."""


def text_width(text: str, size: float = _NORMAL) -> float:
    """Return the width of the longest line of a text as it is drawn [inch]."""
    font = FontProperties(size=size)
    lines = text.split("\n")
    widths = (_RENDERER.get_text_width_height_descent(one, font, False)[0] for one in lines)
    return float(max(widths)) / DPI


_CANVAS: Any = FigureCanvasAgg(Figure(figsize=(0.2, 0.2), dpi=DPI))
_RENDERER = _CANVAS.get_renderer()


class Box(NamedTuple):
    """Axes and where they are, from the lower left corner of the lowest, leftmost ones [inch]."""

    axes: Axes
    x: float
    y: float
    width: float
    height: float


class Bar(NamedTuple):
    """A bar of colours for times [s].

    Attributes
    ----------
    colours : sequence of colours
        From the first time to the last.
    first, last : float
    """

    colours: Sequence[Any]
    first: float
    last: float


class Sheet:
    """A figure while it is drawn.

    Attributes
    ----------
    figure : Figure
    boxes : list of Box
    """

    def __init__(self) -> None:
        self.figure = Figure(dpi=DPI)
        self.boxes: list[Box] = []

    def add(self, x: float, y: float, width: float, height: float, **options: Any) -> Axes:
        """Return new axes; see `Box`."""
        axes = self.figure.add_axes((0.1, 0.1, 0.8, 0.8), label=str(len(self.boxes)), **options)
        self.boxes.append(Box(axes, x, y, width, height))
        return axes

    def finish(self, title: str, rows: Sequence[Axes] = (), bar: Bar | None = None) -> Figure:
        """Return the figure with a title, a legend of the curves in some axes, and a bar of colours."""
        wide = max(box.x + box.width for box in self.boxes)
        high = max(box.y + box.height for box in self.boxes)
        left, bottom = self._left(), self._bottom()
        found = {label: handle for axes in rows for handle, label in labelled(axes)}
        found = found if len(found) > 1 else {}
        beside = max((text_width(label) + _HANDLE for label in found), default=0.0)
        # a bar stands left of a legend
        ends = (f"{bar.first:.4g}", f"{bar.last:.4g}") if bar is not None else ("",)
        room = _BAR + 4 * _GAP + 0.25 + max(map(text_width, ends)) if bar is not None else 0.0
        right = (2 * _GAP + beside if found else 0.0) + room + _EDGE
        lines = self._lines(title, wide + right - _EDGE)
        right += max(0.0, max(text_width(line, _TITLE) for line in lines) - wide - right + _EDGE)
        top = 2 * _GAP + len(lines) * _TITLE * _LINE / 72.0
        legend = len(found) * _NORMAL * _LINE * 1.1 / 72.0
        top += max(0.0, legend - high - bottom)
        size = left + wide + right, bottom + high + top
        self.figure.set_size_inches(size)
        for box in self.boxes:
            place = (left + box.x) / size[0], (bottom + box.y) / size[1]
            box.axes.set_position((*place, box.width / size[0], box.height / size[1]))
            if box.axes.axison:
                _copy_ticks(box.axes.xaxis)
                _copy_ticks(box.axes.yaxis)
        anchor = left / size[0], (bottom + high + 2 * _GAP) / size[1]
        self.figure.text(*anchor, "\n".join(lines), fontsize=_TITLE, ha="left", va="bottom")
        if bar is not None:
            place = (left + wide + 2 * _GAP) / size[0], bottom / size[1]
            self._draw_bar(bar, (*place, _BAR / size[0], high / size[1]))
        if found:
            corner = (left + wide + room + _GAP) / size[0], (bottom + high) / size[1]
            self.figure.legend(
                list(found.values()), list(found), loc="upper left", bbox_to_anchor=corner,
                frameon=False, borderpad=0.0, borderaxespad=0.0, handlelength=1.6, fontsize=_NORMAL,
            )  # fmt: skip
        return self.figure

    def _left(self) -> float:
        """Return the room left of all axes [inch]."""
        outer = [box.axes for box in self.boxes if not box.x and box.axes.axison]
        room = [_EDGE]
        for axes in outer:
            ticks = max(map(text_width, tick_words(axes.yaxis)), default=0.0)
            label = _LINE * _NORMAL / 72.0 if axes.get_ylabel() else 0.0
            room.append(_EDGE + label + 2 * _GAP + ticks)
        return max(room)

    def _bottom(self) -> float:
        """Return the room below all axes [inch]."""
        outer = [box.axes for box in self.boxes if not box.y]
        if not any(axes.axison for axes in outer):
            return 0.3  # a word on what is seen
        return _EDGE + _GAP + 2 * _LINE * _NORMAL / 72.0

    @staticmethod
    def _lines(title: str, width: float) -> list[str]:
        """Return a title broken into lines no wider than stated [inch], but for single words."""
        lines = [""]
        for word in title.split(" "):
            longer = f"{lines[-1]} {word}" if lines[-1] else word
            if lines[-1] and text_width(longer, _TITLE) > width:
                lines.append(word)
            else:
                lines[-1] = longer
        return lines

    def _draw_bar(self, bar: Bar, place: tuple[float, float, float, float]) -> None:
        axes = self.figure.add_axes(place, label="times")
        axes.imshow([[one] for one in bar.colours], origin="lower", aspect="auto", extent=(0, 1, 0, 1))
        axes.xaxis.set_visible(False)
        axes.yaxis.tick_right()
        axes.yaxis.set_label_position("right")
        axes.yaxis.set_major_locator(FixedLocator([0.0, 1.0]))
        axes.yaxis.set_major_formatter(FixedFormatter([f"{bar.first:.4g}", f"{bar.last:.4g}"]))
        axes.set_ylabel("time [s]", labelpad=-6.0)


def _copy_ticks(axis: Axis) -> None:
    """Make the ticks of an axis from its first: the library would build each anew, ten times as slowly."""
    ticks = axis.majorTicks
    for _ in range(len(axis.get_majorticklocs()) - len(ticks)):
        tick = copy(ticks[0])
        for name in ("tick1line", "tick2line", "gridline", "label1", "label2"):
            setattr(tick, name, copy(getattr(tick, name)))
        ticks.append(tick)


def tick_words(axis: Any) -> list[str]:
    """Return what is written along an axis."""
    places = axis.get_major_locator()()
    low, high = sorted(axis.get_view_interval())
    seen = [one for one in places if low <= one <= high]
    return [str(one) for one in axis.get_major_formatter().format_ticks(seen)]
