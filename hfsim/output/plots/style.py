"""What all pictures share: size, colours, labels, legends, files."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import Collection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullFormatter

from hfsim.marching.solution import Run
from hfsim.marching.stop import Budget
from hfsim.output.pictures import picture_format
from hfsim.output.plots.png import write_png
from hfsim.studies.compare.words import ending

DPI = 110
"""Pixels to the inch in pictures of pixels."""
_UNDATED: dict[str, dict[str, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
"""What makes files of one picture the same, whenever it is drawn."""
_NO_LABEL = re.compile(r"|_child\d+|_nolegend_")
"""Labels that the library gives to what has none."""
_LEVEL = 1e-3
"""Range over the size of values from which down changes are shown alone."""
SIZE = (8.0, 4.6)
"""Width and height of a plot against time [inch]."""
WIDE = (9.0, 5.0)
"""Those of a plot of errors."""
BLUE, RED, GREEN, PURPLE, ORANGE, SKY, YELLOW = (
    *("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442"),
)
COLOURS = (BLUE, RED, GREEN, PURPLE, ORANGE, SKY)
"""Okabe and Ito's colours, which colour-blind readers can tell apart; the yellow is too pale for lines."""
TIME_COLOURS = ListedColormap(matplotlib.colormaps["viridis_r"](np.linspace(0.1, 1.0, 256)))
"""Early to late, without the palest yellow, which is lost on white."""


def slug(name: str) -> str:
    """Return a name as it may stand in a file name."""
    return re.sub(r"[^\w.+-]", "_", name)


def with_unit(words: str, unit: str) -> str:
    """Return an axis label."""
    return f"{words} [{unit}]" if unit else words


def ended(run: Run) -> str:
    """Return how and when a run ended before its time."""
    return f"{ending(run.status)} at {run.stop_time:.3g} s"


def headline(run: Run, words: str) -> str:
    """Return the title of a picture of a run."""
    title = f"{run.name}, {run.model}: {words}"
    return title if run.status == "done" else f"{title} ({ended(run)})"


def new_figure(
    size: tuple[float, float] = SIZE, layout: Literal["constrained", "compressed"] = "constrained"
) -> Figure:
    """Return an empty figure of a size [inch]; ``compressed`` suits several axes of one scale."""
    return Figure(figsize=size, dpi=DPI, layout=layout)


def log_figure(size: tuple[float, float] = WIDE, columns: int = 1) -> tuple[Figure, list[Axes]]:
    """Return a figure of a size [inch] with logarithmic axes beside one another."""
    figure = new_figure(size)
    logarithmic = {"xscale": "log", "yscale": "log"}
    return figure, list(figure.subplots(1, columns, squeeze=False, subplot_kw=logarithmic)[0])


def colour(index: int) -> str:
    """Return the colour of one of several curves; they begin again where there are no more."""
    return COLOURS[index % len(COLOURS)]


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
    """Label an axis; large or small numbers, and small changes of a large one, are told in its label.

    Ticks are then short: of a quantity of 11.25 J that changes by 1e-9 J, ``energy - 11.25 J [1e-9 J]``.
    """
    low, high = sorted(map(float, axis.get_view_interval()))
    base, size = 0.0, max(abs(low), abs(high))
    if high - low < _LEVEL * size:
        digits = math.ceil(math.log10(size / (high - low))) if high > low else 6
        base = float(f"{0.5 * (low + high):.{max(0, digits - 1)}e}")
        size = max(abs(low - base), abs(high - base))
    power = 3 * math.floor(math.log10(size) / 3.0) if size > 0.0 else 0
    power = 0 if -3 <= math.log10(size or 1.0) < 5 else power
    found = re.fullmatch(r"(.*) \[(.*)\]", label)
    words, unit = (found[1], found[2]) if found else (label, "")
    if base:
        sign = "\N{MINUS SIGN}" if base > 0.0 else "+"
        words += f" {sign} {abs(base):.15g} {unit}".rstrip()
    unit = f"1e{power} {unit}".strip() if power else unit
    axis.set_label_text(with_unit(words, unit))
    factor = 10.0**power
    axis.set_major_formatter(FuncFormatter(lambda value, _: _tick((value - base) / factor)))


def _tick(value: float) -> str:
    text = f"{0.0 if abs(value) < 1e-12 else value:.5g}"
    return text.replace("-", "\N{MINUS SIGN}")


def mark_zero(axes: Axes) -> None:
    """Say of axes in which all curves are zero that they are, on a scale that shows it."""
    curves = [np.asarray(line.get_ydata(), dtype=float) for line in axes.lines]
    if curves and not any(np.nan_to_num(values).any() for values in curves):
        axes.set_ylim(-1.0, 1.0)
        axes.text(0.5, 0.6, "zero", ha="center", va="center", color="0.4", transform=axes.transAxes)


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
    """Return the powers of ten around the limits of an axis.

    Examples
    --------
    >>> decades((0.02, 3.0))
    (0.01, 10.0)
    """
    low, high = np.log10(limits)
    return float(10.0 ** np.floor(low)), float(10.0 ** np.ceil(high))


def finished(figure: Figure, title: str, rows: Sequence[Axes] = ()) -> Figure:
    """Return a figure with its title, and a legend of the curves in some of its axes."""
    outside_legend(figure, rows)
    set_title(figure, title)
    return figure


def set_title(figure: Figure, text: str) -> None:
    """Write a title above the first axes."""
    figure.axes[0].set_title(text, fontsize=12, loc="left", pad=10)


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


def save(figures: Mapping[str, Figure | None], folder: Path, budget: Budget | None = None) -> list[str]:
    """Write figures into a folder, made if need be, while a budget lasts; return the names of the files.

    They are of the format that `hfsim.output.pictures.picture_format` tells.
    Names of decks, bodies and channels are drawn as they are, signs that the font lacks as boxes.
    """
    kind = picture_format()
    drawn = {f"{name}.{kind}": figure for name, figure in figures.items() if figure is not None}
    if drawn:
        folder.mkdir(parents=True, exist_ok=True)
    for name, figure in list(drawn.items()):
        if budget is not None and budget.left <= 0.0:
            del drawn[name]
            continue
        with as_they_are(figure):
            if kind == "png":
                canvas: Any = FigureCanvasAgg(figure)
                canvas.draw()  # savefig would draw everything twice
                write_png(folder / name, np.asarray(canvas.buffer_rgba()), figure.dpi)
            else:
                with matplotlib.rc_context({"svg.hashsalt": "hfsim"}):
                    figure.savefig(folder / name, format=kind, metadata=_UNDATED[kind])
    return list(drawn)


@contextmanager
def as_they_are(figure: Figure) -> Iterator[None]:
    """Draw names as they are inside the block: no formulae for dollars, no word on signs the font lacks."""
    for text in _texts(figure):
        if "$" in text.get_text():
            text.set_parse_math(False)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph")
        yield


def _texts(figure: Figure) -> Iterator[Text]:
    """Yield all that may hold names; ticks that show numbers are not made for it."""
    yield from figure.texts
    for legend in figure.legends:
        yield from legend.get_texts()
    for axes in figure.axes:
        yield from axes.findobj(Text) if any(map(_named, (axes.xaxis, axes.yaxis))) else _own(axes)


def _named(axis: Axis) -> bool:
    return isinstance(axis.get_major_locator(), FixedLocator)


def _own(axes: Axes) -> Iterator[Text]:
    yield from (axes.xaxis.label, axes.yaxis.label)
    yield from (one for one in axes.get_children() if isinstance(one, Text))
    legend = axes.get_legend()
    yield from legend.get_texts() if legend is not None else ()
