"""Pictures of an equilibrium: the bodies at the start and at rest, and what runs inside each beam."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.colors import to_rgba

from hfsim.marching.solution import Run
from hfsim.maths.arrays import Array
from hfsim.output.plots.files import save
from hfsim.output.plots.ink import DASHED, DOTTED, Mark, Pen
from hfsim.output.plots.panel import Curve, Panel, Strokes
from hfsim.output.plots.sheet import Sheet
from hfsim.output.plots.snapshots import snapshot_figures
from hfsim.output.plots.space import oblique, oblique_axes, views_of
from hfsim.output.plots.style import SIZE, colour, dashes, headline

WORDS = {"limits": "limit point", "branches": "branch"}
BEFORE = "0.65"
"""Colour of the bodies at the start."""


def draw_static(run: Run, folder: Path) -> list[str]:
    """Draw ``shapes``, in space ``oblique`` too, and ``along_BODY`` for each beam with strains.

    The run has the outlines of the start and of places of rest. Return the files.
    """
    figures: dict[str, Sheet | None] = {}
    if run.outlined and len(run.outlined[0]) > 1:
        outlines = run.outlined[1]
        every = np.concatenate([points.reshape(-1, run.dimension) for points in outlines.values()])
        sheet, views = views_of(every)
        for pair, panel in views.items():
            _draw(panel, {body: points[..., pair] for body, points in outlines.items()})
        figures["shapes"] = sheet.finish(headline(run, "at rest"), list(views.values()))
        if run.dimension == 3:
            sheet, panel, _ = oblique_axes(every)
            _draw(panel, {body: oblique(points) for body, points in outlines.items()})
            figures["oblique"] = sheet.finish(headline(run, "at rest"), [panel])
    if len(run.t) > 1:
        figures["path"] = _path(run)
    figures |= {name: figure for name, figure in snapshot_figures(run) if name != "snapshots"}
    return save(figures, folder)


def _draw(panel: Panel, outlines: dict[str, Array]) -> None:
    """Draw projected outlines (n_places, n_points, 2): dashed at the start, in colours at rest."""
    for k, (body, points) in enumerate(outlines.items()):
        panel.things.append(Curve(points[0], Pen(BEFORE, 1.2, DASHED), "start"))
        own = colour(k)
        panel.things.append(Strokes([*points[1:-1]], Pen(to_rgba(own, 0.4))))
        pen, mark = Pen(own, 2.0, dashes(k)), Mark("o", 3.0, own, own)
        panel.things.append(Curve(points[-1], pen, body, mark, ends=True))


def _path(run: Run) -> Sheet | None:
    """Draw the load factor against the largest displacements; None where no channel is one."""
    loads = run.channels[0].values
    moved = [(one, one.values - one.values[0]) for one in run.channels[1:] if one.unit in ("m", "rad")]
    unit = "m" if any(one.unit == "m" for one, _ in moved) else "rad"
    shown = sorted((pair for pair in moved if pair[0].unit == unit), key=lambda pair: -np.ptp(pair[1]))[:4]
    if not shown:
        return None
    sheet = Sheet()
    panel = sheet.add(0.0, 0.0, SIZE[0] - 1.2, SIZE[1] - 0.8)
    for k, (channel, values) in enumerate(shown):
        own = colour(k)
        points = np.column_stack([values, loads])
        panel.things.append(Curve(points, Pen(own, 1.5), channel.name, Mark("o", 2.0, own, own)))
    panel.fit()
    ends = panel.across.low, panel.across.high
    for kind, dotted in (("limits", DOTTED), ("branches", DASHED)):
        for load in run.statistics.get(kind) or ():
            line = np.array([(end, load) for end in ends])
            panel.things.append(Curve(line, Pen("0.5", 0.8, dotted), WORDS[kind]))
    panel.dress(f"displacement [{unit}]", "load factor")
    return sheet.finish(headline(run, "the load along its path"), [panel])
