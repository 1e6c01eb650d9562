"""Pictures of the ways to the elastic force: time against the number of elements."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import FormatStrFormatter, LogFormatter

from hfsim.output.plots.figures import dress_counts, finished, new_figure
from hfsim.output.plots.files import save
from hfsim.output.plots.style import BLUE, GREEN, ORANGE, RED
from hfsim.studies.separation.beams import STEPS
from hfsim.studies.separation.results import PAPER_RATIO, SeparationBench

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FORM_STYLES = {
    "direct": (RED, "s"),
    "tabulated": (ORANGE, "D"),
    "separated": (BLUE, "o"),
    "gram": (GREEN, "^"),
}


def draw_separation(result: SeparationBench, folder: Path) -> list[str]:
    """Draw the time of each form, and its ratio to the direct one, over the elements; return the files."""
    kinds = dict.fromkeys(cell.element for cell in result.cells if cell.forms)
    return save({f"separation_{kind}": _separation_figure(result, kind) for kind in kinds}, folder)


def _separation_figure(result: SeparationBench, kind: str) -> Figure:
    cells = [cell for cell in result.cells if cell.element == kind and cell.forms]
    counts = sorted({cell.elements for cell in cells})
    batches = sorted({cell.states for cell in cells})
    figure = new_figure((10.0, 7.0))
    grid = figure.subplots(2, 3, sharex=True, sharey="row")
    for column, (name, words) in enumerate(_SEPARATION_TIMES.items()):
        (above, below), per = grid[:, column], STEPS if name == "run" else 1
        for batch, (at, form) in product(batches, enumerate(cells[0].forms)):
            mine = [cell for cell in cells if cell.states == batch]
            colour, marker = _FORM_STYLES.get(form.form, ("0.3", "x"))
            words_of_batch = f", {batch} beams at once" if batch > 1 else ""
            style: dict[str, Any] = {"color": colour, "marker": marker, "markersize": 5}
            style |= {"label": form.form + words_of_batch, "linestyle": "-" if batch == batches[0] else "--"}
            sizes = [cell.elements for cell in mine]
            forms = [cell.forms[at] for cell in mine]
            spreads = [getattr(one, name) for one in forms]
            middle = 1e6 * np.array([one.median for one in spreads])
            ends = 1e6 * np.array([[one.least for one in spreads], [one.most for one in spreads]])
            above.errorbar(sizes, middle / per, np.abs(ends - middle) / per, **style)
            below.plot(sizes, [100.0 * getattr(one, f"{name}_ratio") for one in forms], **style)
        below.axhline(100.0 * PAPER_RATIO, color="0.5", linestyle=":", label="the paper's ratio, 10 %")
        above.text(0.04, 0.96, words, transform=above.transAxes, va="top")
        above.margins(y=0.15)  # room for the words above the data
        for axes, x_label in ((above, ""), (below, "elements")):
            dress_counts(axes, counts, x_label, "")
            axes.yaxis.set_major_formatter(FormatStrFormatter("%g"))
            # within one decade, ticks between its ends are labelled too
            axes.yaxis.set_minor_formatter(LogFormatter(minor_thresholds=(2.0, 0.5)))
    grid[0, 0].set_ylabel("CPU time [us]")
    grid[1, 0].set_ylabel("CPU time / direct [%]")
    return finished(figure, f"ways to the elastic force, element {kind}", [grid[1, 0]])


_SEPARATION_TIMES = {"force": "force", "both": "force and tangent", "run": "a step of the whole run"}
