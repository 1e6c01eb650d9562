"""Pictures of planar motion: paths of points, shapes of the bodies."""

from __future__ import annotations

import numpy as np

from hfsim.marching.solution import Run
from hfsim.output.plots.sheet import Sheet
from hfsim.output.plots.style import headline
from hfsim.output.plots.tracks import (
    draw_shapes,
    draw_tracks,
    equal_axes,
    shown_outlines,
    time_bar,
    track_words,
    tracks_of,
)


def planar_path(run: Run) -> Sheet | None:
    """Draw the paths of points; None where there are none."""
    tracks = tracks_of(run)
    if not tracks or len(run.t) < 2:
        return None
    sheet, panel = equal_axes(np.vstack(list(tracks.values())))
    panel.dress("x [m]", "y [m]")
    draw_tracks(panel, tracks)
    return sheet.finish(headline(run, track_words(tracks)), [panel])


def planar_shapes(run: Run) -> Sheet | None:
    """Draw the bodies at some times; None where there are none."""
    shown = shown_outlines(run)
    if shown is None:
        return None
    times, outlines = shown
    sheet, panel = equal_axes(np.vstack([points.reshape(-1, 2) for points in outlines.values()]))
    panel.dress("x [m]", "y [m]")
    draw_shapes(panel, outlines, times)
    return sheet.finish(headline(run, "shapes of the bodies"), [panel], time_bar(outlines, times))
