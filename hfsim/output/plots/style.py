"""What all pictures share: size, colours, titles."""

from __future__ import annotations

import re

import matplotlib
import numpy as np
from matplotlib.colors import ListedColormap

from hfsim.marching.solution import Run

SIZE = (8.0, 4.6)
"""Width and height of a plot against time [inch]."""
WIDE = (9.0, 5.0)
"""Those of a plot of errors."""
BLUE, RED, GREEN, PURPLE, ORANGE, SKY, YELLOW = (
    *("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442"),
)
COLOURS = (BLUE, RED, GREEN, PURPLE, ORANGE, SKY)
"""Okabe and Ito's colours, which colour-blind readers can tell apart; the yellow is too pale for lines."""
DASHES = ((), (4.0, 3.0), (1.2, 2.4), (6.0, 2.0, 1.2, 2.0), (4.0, 1.5, 1.2, 1.5, 1.2, 1.5))
"""Of curves of one colour, in widths of the line; see `hfsim.output.plots.ink.Pen`."""
TIME_COLOURS = ListedColormap(matplotlib.colormaps["viridis_r"](np.linspace(0.1, 1.0, 256)))
"""Early to late, without the palest yellow, which is lost on white."""


def slug(name: str) -> str:
    """Return a name as it may stand in a file name."""
    return re.sub(r"[^\w.+-]", "_", name)


def ended(run: Run) -> str:
    """Return how and when a run ended before its time."""
    from hfsim.studies.compare.result import ending  # of all runs few end before their time

    return ending(run.status, run.stop_time)


def headline(run: Run, words: str) -> str:
    """Return the title of a picture of a run."""
    title = f"{run.name}, {run.model}: {words}"
    return title if run.status == "done" else f"{title} ({ended(run)})"


def colour(index: int) -> str:
    """Return the colour of one of several curves; they begin again where there are no more."""
    return COLOURS[index % len(COLOURS)]


def dashes(index: int) -> tuple[float, ...]:
    """Return the dashes of one of several curves, others each time that the colours begin again."""
    return DASHES[index // len(COLOURS) % len(DASHES)]
