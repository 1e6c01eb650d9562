"""Pictures of one run: channels against time, paths of points, shapes of the bodies."""

from __future__ import annotations

from pathlib import Path

from hfsim.marching.solution import Run
from hfsim.marching.stop import Budget
from hfsim.output.plots.files import save
from hfsim.output.plots.history import time_figures
from hfsim.output.plots.sheet import Sheet
from hfsim.output.plots.snapshots import snapshot_figures
from hfsim.output.plots.space import oblique_shapes, shapes_figure, track_figure


def draw_run(run: Run, folder: Path, budget: Budget | None = None) -> list[str]:
    """Draw one run with finite values: channels against time, paths of points, shapes of the bodies.

    Return the files: of plots for which channels or outlines exist, none for an empty run. Nothing is drawn
    against time for a single row, and pictures that the budget does not suffice for are not drawn.
    """
    if not len(run.t):
        return []
    if run.statistics.get("kind") == "static":
        from hfsim.output.plots.static import draw_static

        return draw_static(run, folder)
    run = run.drawn
    figures: dict[str, Sheet | None] = {**(time_figures(run) if len(run.t) > 1 else {})}
    figures |= {"path": track_figure(run), "shapes": shapes_figure(run)}
    if run.dimension == 3:
        figures["oblique"] = oblique_shapes(run)
    return save(figures | dict(snapshot_figures(run)), folder, budget)
