"""Pictures of an equilibrium: the bodies at the start and at rest, and what runs inside each beam."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hfsim.marching.solution import Run
from hfsim.maths.arrays import Array
from hfsim.output.plots.sheet import Sheet
from hfsim.output.plots.snapshots import snapshot_figures
from hfsim.output.plots.space import oblique, oblique_axes, three_views
from hfsim.output.plots.style import SIZE, colour, dress, headline, save
from hfsim.output.plots.tracks import equal_axes

WORDS = {"limits": "limit point", "branches": "branch"}
BEFORE = "0.65"
"""Colour of the bodies at the start."""


def draw_static(run: Run, folder: Path) -> list[str]:
    """Draw ``shapes``, in space ``oblique`` too, and ``along_BODY`` for each beam with strains.

    Parameters
    ----------
    run : Run
        With the outlines of the start and of places of rest.
    folder : Path
        Where the files go.

    Returns
    -------
    list of str
        File names written.
    """
    outlines = {body: points for body, points in run.outlines.items() if points.size}
    figures: dict[str, Figure | None] = {}
    if outlines and run.outline_t is not None and len(run.outline_t) > 1:
        every = np.concatenate([points.reshape(-1, run.dimension) for points in outlines.values()])
        if run.dimension == 3:
            sheet, views = three_views(every)
            for pair, axes in views.items():
                _draw(axes, {body: points[..., pair] for body, points in outlines.items()})
            figures["shapes"] = sheet.finish(headline(run, "at rest"), list(views.values()))
            sheet, axes, _ = oblique_axes(every)
            _draw(axes, {body: oblique(points) for body, points in outlines.items()})
            figures["oblique"] = sheet.finish(headline(run, "at rest"), [axes])
        else:
            sheet, axes = equal_axes(every)
            dress(axes, "x [m]", "y [m]")
            _draw(axes, outlines)
            figures["shapes"] = sheet.finish(headline(run, "at rest"), [axes])
    if len(run.t) > 1:
        figures["path"] = _path(run)
    along = {name: figure for name, figure in snapshot_figures(run) if name != "snapshots"}
    return save(figures | along, folder)


def _draw(axes: Axes, outlines: dict[str, Array]) -> None:
    """Draw projected outlines (n_places, n_points, 2): dashed at the start, in colours at rest."""
    for k, (body, points) in enumerate(outlines.items()):
        axes.plot(*points[0].T, color=BEFORE, linewidth=1.2, linestyle="--", label="start")
        for between in points[1:-1]:
            axes.plot(*between.T, color=colour(k), linewidth=0.8, alpha=0.4)
        axes.plot(
            *points[-1].T, color=colour(k), linewidth=2.0, label=body, marker="o", markersize=3.0,
            markevery=[0, -1],
        )  # fmt: skip


def _path(run: Run) -> Figure | None:
    """Draw the load factor against the largest displacements; None where no channel is one."""
    loads = run.channels[0].values
    moved = [(one, one.values - one.values[0]) for one in run.channels[1:] if one.unit in ("m", "rad")]
    unit = "m" if any(one.unit == "m" for one, _ in moved) else "rad"
    shown = sorted((pair for pair in moved if pair[0].unit == unit), key=lambda pair: -np.ptp(pair[1]))[:4]
    if not shown:
        return None
    sheet = Sheet()
    axes = sheet.add(0.0, 0.0, SIZE[0] - 1.2, SIZE[1] - 0.8)
    for k, (channel, values) in enumerate(shown):
        axes.plot(values, loads, color=colour(k), marker=".", markersize=4.0, label=channel.name)
    for kind, style in (("limits", ":"), ("branches", "--")):
        for load in run.statistics.get(kind) or ():
            axes.axhline(load, color="0.5", linewidth=0.8, linestyle=style, label=WORDS[kind])
    dress(axes, f"displacement [{unit}]", "load factor")
    return sheet.finish(headline(run, "the load along its path"), [axes])
