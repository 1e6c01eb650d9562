"""Lines, marks and words on a renderer of the library: of pixels or of vectors. Places are in inches."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.colors import to_rgba
from matplotlib.markers import MarkerStyle
from matplotlib.path import Path
from matplotlib.transforms import Bbox, IdentityTransform

from hfsim.maths.arrays import Array
from hfsim.output.plots.letters import font, heights, outline, plain, width

DPI = 110
"""Pixels to the inch in pictures of pixels."""
POINT = 1.0 / 72.0
"""Unit of sizes of letters, marks and lines [inch]."""
LINE = 1.35
"""Height of a line of text over its size."""
_HERE: Any = IdentityTransform()
_AFTER_WORDS, _WITHIN_WORDS = re.compile(r"(?<= )(?![^\[]*\])"), re.compile(r"(?<=[._(])")
"""Where a text may be broken, but not inside of a unit; and where a long word may."""

DASHED, DOTTED = (3.7, 1.6), (1.0, 1.65)
"""Lengths of dashes and gaps in widths of the line."""

Colour = str | tuple[float, float, float] | tuple[float, float, float, float]
Frame = tuple[float, float, float, float]
"""Left, bottom, right, top [inch]."""


class Pen(NamedTuple):
    """How a line is drawn.

    Attributes
    ----------
    width : float
        [points]
    dashes : tuple of float
        Lengths of dashes and gaps in widths of the line; none: a whole line.
    """

    colour: Colour = "black"
    width: float = 0.8
    dashes: tuple[float, ...] = ()


class Mark(NamedTuple):
    """A sign at a point.

    Attributes
    ----------
    shape : str
        As the library calls it.
    size : float
        Width [points].
    colour, edge : colour
        Inside; of the line around it, whose width is `line` [points].
    """

    shape: str
    size: float
    colour: Colour
    edge: Colour
    line: float = 1.0


class Ink:
    """Draws on a renderer.

    Parameters
    ----------
    renderer : RendererBase
        Of any format of the library.
    """

    def __init__(self, renderer: Any) -> None:
        self._renderer = renderer
        self._unit = float(renderer.points_to_pixels(1.0)) / POINT
        self._height = float(renderer.get_canvas_width_height()[1])
        self._pixels = isinstance(renderer, RendererAgg)

    def line(self, points: Array, pen: Pen, frame: Frame | None = None) -> None:
        """Draw a line through points (n, 2), broken at those that are not finite, inside a frame."""
        self._stroke(Path(self._unit * points), pen, frame, "butt" if pen.dashes else "projecting")

    def lines(self, every: Sequence[Array], pen: Pen, frame: Frame | None = None, cap: Any = "butt") -> None:
        """Draw lines of one colour, each through points (n, 2)."""
        codes = [Path.MOVETO if k == 0 else Path.LINETO for one in every for k in range(len(one))]
        if codes:
            self._stroke(Path(self._unit * np.concatenate(every), codes), pen, frame, cap)

    def area(self, points: Array, colour: Colour) -> None:
        """Fill what is inside a line through points (n, 2)."""
        context = self._context(Pen(colour, 0.0))
        self._renderer.draw_path(context, Path(self._unit * points), _HERE, to_rgba(colour))
        context.restore()

    def marks(self, points: Array, mark: Mark, frame: Frame | None = None) -> None:
        """Draw a sign at each of points (n, 2)."""
        style, shape, snapped = _sign(mark.shape, mark.size * POINT * self._unit)
        context = self._context(Pen(mark.edge, mark.line), frame)
        context.set_joinstyle(style.get_joinstyle())
        context.set_snap(snapped)
        every = Path(self._unit * np.asarray(points))
        self._renderer.draw_markers(context, style.get_path(), shape, every, _HERE, to_rgba(mark.colour))
        context.restore()

    def words(
        self,
        text: str,
        x: float,
        y: float,
        size: float = 10.0,
        colour: Colour = "black",
        across: Literal["left", "center", "right"] = "left",
        up: Literal["baseline", "bottom", "middle", "center", "top"] = "baseline",
        turned: bool = False,
    ) -> None:
        """Write a line of text, from left to right or, ``turned``, from below upwards.

        Its ``middle`` is that of figures and capitals, its ``center`` that of all letters.
        """
        back = {"left": 0.0, "center": 0.5, "right": 1.0}[across] * width(text, size, self._unit)
        over, under = heights(size, self._unit)
        rise = {"baseline": 0.0, "bottom": under, "middle": -0.5 * over, "center": 0.5 * (under - over)}
        move = rise.get(up, -over)
        x, y = self._unit * x, self._unit * y
        x, y = (x - move, y - back) if turned else (x - back, y + move)
        if self._pixels and plain(text):
            self._fill(text, round(x), round(y), size, colour, turned)
            return
        context = self._renderer.new_gc()
        context.set_foreground(to_rgba(colour), isRGBA=True)
        down = self._height - y if self._renderer.flipy() else y
        self._renderer.draw_text(context, x, down, text, font(size), 90.0 if turned else 0.0)
        context.restore()

    def _fill(self, text: str, x: int, y: int, size: float, colour: Colour, turned: bool) -> None:
        points, codes = outline(text, size, self._unit)
        points = np.column_stack([-points[:, 1], points[:, 0]]) if turned else points
        context = self._context(Pen(colour, 0.0))
        context.set_snap(False)
        self._renderer.draw_path(context, Path(points + np.array([x, y]), codes), _HERE, to_rgba(colour))
        context.restore()

    def _stroke(self, path: Path, pen: Pen, frame: Frame | None, cap: Any) -> None:
        context = self._context(pen, frame)
        if cap != "butt":
            context.set_capstyle(cap)
        self._renderer.draw_path(context, path, _HERE)
        context.restore()

    def _context(self, pen: Pen, frame: Frame | None = None) -> Any:
        context = self._renderer.new_gc()
        context.set_foreground(to_rgba(pen.colour), isRGBA=True)
        context.set_linewidth(pen.width)
        if pen.dashes:
            context.set_dashes(0.0, [one * pen.width for one in pen.dashes])
        if frame is not None:
            context.set_clip_rectangle(Bbox.from_extents(*(self._unit * one for one in frame)))
        return context


@lru_cache(maxsize=64)
def _sign(shape: str, size: float) -> tuple[MarkerStyle, Any, bool]:
    """Return a sign, the transformation to its size [pixels], and whether its sides are put on pixels."""
    style = MarkerStyle(shape)
    own: Any = style.get_transform()
    least = style.get_snap_threshold()
    return style, own.scale(size).frozen(), least is not None and size >= least


def text_width(text: str, size: float = 10.0) -> float:
    """Return the width of the longest line of a text in letters of a size [points] as it is drawn [inch]."""
    return max(width(line, size, DPI) for line in text.split("\n")) / DPI


def wrapped(text: str, wide: float, size: float = 10.0, within: bool = False) -> list[str]:
    """Return a text broken into lines no wider than stated [inch], but for single words.

    Those too are broken where that is ``within`` words: after points, underscores and parentheses.
    """
    lines = list[str]()
    for line in text.split("\n"):
        lines.append("")
        for word in _AFTER_WORDS.split(line):
            parts = within and text_width(word.rstrip(), size) > wide
            for piece in _WITHIN_WORDS.split(word) if parts else [word]:
                if lines[-1] and text_width(f"{lines[-1]}{piece}".rstrip(), size) > wide:
                    lines.append("")
                lines[-1] += piece
    return [line.rstrip() for line in lines]


class Fitted(NamedTuple):
    """A text in lines, and the size of its letters [points]."""

    lines: list[str]
    size: float


def fitted(text: str, wide: float, size: float = 10.0) -> Fitted:
    """Return a text in lines no wider than stated [inch], in smaller letters where it cannot be broken."""
    lines = wrapped(text, wide, size, within=True) if text else []
    widest = max((text_width(line, size) for line in lines), default=0.0)
    return Fitted(lines, size * min(1.0, wide / widest) if widest else size)
