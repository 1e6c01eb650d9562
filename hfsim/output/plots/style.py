"""What all pictures share: size, colours, labels, legends, files."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from hfsim.run.solution import Run
from hfsim.studies.compare import ending

_DPI = 110
SIZE = (8.0, 4.6)
"""Width and height of a plot against time [inch]."""
BLUE, RED, GREEN, PURPLE, ORANGE, SKY, YELLOW = (
    *("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442"),
)
COLOURS = (BLUE, RED, GREEN, PURPLE, ORANGE, SKY)
"""Okabe and Ito's colours, which colour-blind readers can tell apart; the yellow is too pale for lines."""


def slug(name: str) -> str:
    """Return a name as it may stand in a file name."""
    return re.sub(r"[^\w.+-]", "_", name)


def with_unit(words: str, unit: str) -> str:
    """Return an axis label."""
    return f"{words} [{unit}]" if unit else words


def ended(run: Run) -> str:
    """Return how and when a run ended before its time."""
    return f"{ending(run.status)} at {run.stop_time:.3g} s"


def new_figure(size: tuple[float, float] = SIZE) -> Figure:
    """Return an empty figure of a size [inch]."""
    return Figure(figsize=size, dpi=_DPI, layout="constrained")


def stacked(figure: Figure, count: int) -> list[Axes]:
    """Return axes one below the other that share their time axis."""
    return list(figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0])


def dress(axes: Axes, x_label: str, y_label: str) -> None:
    """Give linear axes their labels and grid."""
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    axes.grid(True, color="0.9", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.ticklabel_format(axis="y", scilimits=(-3, 4))


def dress_log(axes: Axes) -> None:
    """Give axes of relative differences over CPU time their labels and grid."""
    axes.set_xlabel("CPU time of the solution [s]")
    axes.set_ylabel("largest relative difference [-]")
    axes.grid(True, which="major", color="0.9", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.margins(0.15)
    low, high = axes.get_xlim()
    axes.set_xlim(10 ** np.floor(np.log10(low)), 10 ** np.ceil(np.log10(high)))  # whole decades: few ticks
    axes.xaxis.set_minor_formatter(NullFormatter())


def set_title(figure: Figure, text: str) -> None:
    """Write a title above the first axes."""
    figure.axes[0].set_title(text, fontsize=12, loc="left", pad=10)


def outside_legend(figure: Figure, rows: Sequence[Axes]) -> None:
    """Put one legend right of the axes, where it cannot cover data; a single label needs none."""
    found = {
        label: handle
        for axes in rows
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    if len(found) > 1:
        figure.legend(list(found.values()), list(found), loc="outside right upper", frameon=False)


def save(figures: dict[str, Figure], folder: Path) -> list[str]:
    """Write figures as PNG files, the folder made if there are any; return the file names."""
    if figures:
        folder.mkdir(parents=True, exist_ok=True)
    for name, figure in figures.items():
        canvas: Any = FigureCanvasAgg(figure)
        canvas.print_png(folder / f"{name}.png")  # savefig would draw everything twice
    return [f"{name}.png" for name in figures]
