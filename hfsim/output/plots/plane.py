"""Pictures of planar motion: paths of points, shapes of the bodies."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from hfsim.marching.solution import Run
from hfsim.output.plots.style import dress, headline
from hfsim.output.plots.tracks import (
    draw_shapes,
    draw_tracks,
    equal_axes,
    shown_outlines,
    time_bar,
    track_words,
    tracks_of,
)


def planar_path(run: Run) -> Figure | None:
    """Draw the paths of points; None where there are none."""
    tracks = tracks_of(run)
    if not tracks or len(run.t) < 2:
        return None
    sheet, axes = equal_axes(np.vstack(list(tracks.values())))
    dress(axes, "x [m]", "y [m]")
    draw_tracks(axes, tracks)
    return sheet.finish(headline(run, track_words(tracks)), [axes])


def planar_shapes(run: Run) -> Figure | None:
    """Draw the bodies at some times; None where there are none."""
    shown = shown_outlines(run)
    if shown is None:
        return None
    times, outlines = shown
    sheet, axes = equal_axes(np.vstack([points.reshape(-1, 2) for points in outlines.values()]))
    dress(axes, "x [m]", "y [m]")
    draw_shapes(axes, outlines, times)
    return sheet.finish(headline(run, "shapes of the bodies"), [axes], time_bar(outlines, times))
