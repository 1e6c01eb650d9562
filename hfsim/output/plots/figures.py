"""Figures and axes of the library, for what is more than curves on linear axes; and pictures as figures."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import Collection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullFormatter

from hfsim.output.plots import import_library
from hfsim.output.plots.ink import DPI, fitted
from hfsim.output.plots.letters import unwarned
from hfsim.output.plots.png import write_png
from hfsim.output.plots.scale import Scale
from hfsim.output.plots.sheet import Sheet
from hfsim.output.plots.style import SIZE, WIDE

import_library("matplotlib.figure")

from matplotlib.axes import Axes  # noqa: E402
from matplotlib.axis import Axis  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402

_UNDATED: dict[str, dict[str, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
"""What makes files of one picture the same, whenever it is drawn."""
_BESIDE = 1.0
"""What there is left and right of the title above axes, about [inch]."""
_NO_LABEL = re.compile(r"|_child\d+|_nolegend_")
"""Labels that the library gives to what has none."""


def write_figure(figure: Figure, path: Path, kind: str) -> None:
    """Write a figure in a format."""
    with as_they_are(figure):
        if kind == "png":
            canvas: Any = FigureCanvasAgg(figure)
            canvas.draw()  # savefig would draw everything twice
            write_png(path, np.asarray(canvas.buffer_rgba()), figure.dpi)
        else:
            with matplotlib.rc_context({"svg.hashsalt": "hfsim"}):
                figure.savefig(path, format=kind, metadata=_UNDATED[kind])


def as_figure(sheet: Sheet) -> Figure:
    """Return a figure that shows a picture."""
    figure = Figure(figsize=sheet.size, dpi=DPI)
    figure.add_artist(_Shown(sheet))
    return figure


class _Shown(Artist):
    """A picture on a figure of its size."""

    def __init__(self, sheet: Sheet) -> None:
        super().__init__()
        self._sheet = sheet

    def draw(self, renderer: Any) -> None:
        self._sheet.draw(renderer)


def new_figure(size: tuple[float, float] = SIZE) -> Figure:
    """Return an empty figure of a size [inch]."""
    return Figure(figsize=size, dpi=DPI, layout="constrained")


def log_figure(size: tuple[float, float] = WIDE, columns: int = 1) -> tuple[Figure, list[Axes]]:
    """Return a figure of a size [inch] with logarithmic axes beside one another."""
    figure = new_figure(size)
    logarithmic = {"xscale": "log", "yscale": "log"}
    return figure, list(figure.subplots(1, columns, squeeze=False, subplot_kw=logarithmic)[0])


def bare(axes: Axes, **grid: Any) -> None:
    """Give axes a grid and no frame; ``grid`` goes to `Axes.grid`."""
    axes.grid(True, color="0.9", linewidth=0.8, **grid)
    axes.spines[["top", "right"]].set_visible(False)


def dress(axes: Axes, x_label: str, y_label: str) -> None:
    """Give linear axes, of which the limits are known, their labels, ticks and grid."""
    for axis, label in ((axes.xaxis, x_label), (axes.yaxis, y_label)):
        axis.set_major_locator(MaxNLocator(8 if axis is axes.xaxis else 6, steps=[1, 2, 2.5, 5, 10]))
        scaled(axis, label)
    bare(axes)
    axes.set_axisbelow(True)


def scaled(axis: Axis, label: str) -> None:
    """Label an axis of which the limits are known, and its ticks; see `Scale`."""
    low, high = sorted(map(float, axis.get_view_interval()))
    scale = Scale.of(low, high, label)
    axis.set_label_text(scale.label)
    axis.set_major_formatter(FuncFormatter(lambda value, _: scale.word(value)))


def dress_log(axes: Axes, x_label: str, y_label: str) -> None:
    """Give logarithmic axes their labels, grid, and whole decades of x."""
    axes.set(xlabel=x_label, ylabel=y_label)
    bare(axes, which="major")
    axes.margins(0.15)
    axes.set_xlim(decades(axes.get_xlim()))  # few ticks
    axes.xaxis.set_minor_formatter(NullFormatter())


def dress_counts(axes: Axes, counts: Sequence[int], x_label: str, y_label: str) -> None:
    """Give axes over numbers of elements, doubled from one to the next, their labels, ticks and grid."""
    axes.set_xscale("log", base=2)
    axes.set(yscale="log", xlabel=x_label, ylabel=y_label)
    axes.set_xticks(counts, [str(count) for count in counts])
    bare(axes)


def decades(limits: tuple[float, float]) -> tuple[float, float]:
    """Return the powers of ten around the limits of an axis, a decade apart at least.

    Examples
    --------
    >>> decades((0.02, 3.0))
    (0.01, 10.0)
    """
    low, high = np.floor(np.log10(limits[0])), np.ceil(np.log10(limits[1]))
    return float(10.0**low), float(10.0 ** max(high, low + 1.0))


def finished(figure: Figure, title: str, rows: Sequence[Axes] = ()) -> Figure:
    """Return a figure with its title, and a legend of the curves in some of its axes."""
    outside_legend(figure, rows)
    set_title(figure, title)
    return figure


def set_title(figure: Figure, text: str) -> None:
    """Write a title above the first axes, in as many lines as the width of the figure makes it."""
    title = fitted(text, figure.get_figwidth() - _BESIDE, 12.0)
    figure.axes[0].set_title("\n".join(title.lines), fontsize=title.size, loc="left", pad=10)


def set_title_above(figure: Figure, text: str, beside: float = 0.0) -> None:
    """Write a title above all axes of a figure, in as many lines as its width makes it.

    Parameters
    ----------
    beside : float
        Width right of it that something else takes [inch].
    """
    title = fitted(text, 0.97 * figure.get_figwidth() - beside, 12.0)
    figure.suptitle("\n".join(title.lines), fontsize=title.size, x=0.01, ha="left")


def outside_legend(figure: Figure, rows: Sequence[Axes]) -> None:
    """Put one legend right of the axes, where it cannot cover data; a single label needs none."""
    found = {label: handle for axes in rows for handle, label in labelled(axes)}
    if len(found) > 1:
        figure.legend(list(found.values()), list(found), loc="outside right upper", frameon=False)


def labelled(axes: Axes) -> Iterator[tuple[Artist, str]]:
    """Yield what has a label; the library's own list leaves out names that begin with an underscore."""
    handles, labels = axes.get_legend_handles_labels()
    known: dict[str, Artist] = dict(zip(labels, handles, strict=True))
    for artist in axes.get_children():
        label = str(artist.get_label())
        if isinstance(artist, Line2D | Patch | Collection) and not _NO_LABEL.fullmatch(label):
            known.setdefault(label, artist)
    yield from ((artist, label) for label, artist in known.items())


@contextmanager
def as_they_are(figure: Figure) -> Iterator[None]:
    """Draw names as they are inside the block: no formulae for dollars, no word on signs the font lacks."""
    for text in _texts(figure):
        if "$" in text.get_text():
            text.set_parse_math(False)
    with unwarned():
        yield


def _texts(figure: Figure) -> Iterator[Text]:
    """Yield all that may hold names; ticks that show numbers are not made for it."""
    yield from figure.texts
    for legend in figure.legends:
        yield from legend.get_texts()
    for axes in figure.axes:
        locators = (axis.get_major_locator() for axis in (axes.xaxis, axes.yaxis))
        named = any(isinstance(one, FixedLocator) for one in locators)
        yield from axes.findobj(Text) if named else _own(axes)


def _own(axes: Axes) -> Iterator[Text]:
    yield from (axes.xaxis.label, axes.yaxis.label)
    yield from (one for one in axes.get_children() if isinstance(one, Text))
    legend = axes.get_legend()
    yield from legend.get_texts() if legend is not None else ()
