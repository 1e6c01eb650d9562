"""Pictures of the bodies at chosen times, and of what runs inside them along each beam."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hfsim.marching.solution import Run, Snapshot
from hfsim.maths.arrays import Array
from hfsim.output.plots.sheet import Sheet
from hfsim.output.plots.space import three_views
from hfsim.output.plots.style import SIZE, TIME_COLOURS, colour, dress, headline, mark_zero, slug, with_unit
from hfsim.output.plots.tracks import equal_axes
from hfsim.parts.channels import kind_of

_HEIGHT, _BETWEEN = 1.5, 0.2
"""Of a row, and between two [inch]."""
_UNSEEN = 1e-9
"""Part of the largest of its unit that no row is drawn of: forces are small differences of large numbers."""


def snapshot_figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """Yield ``snapshots``, the bodies at these times, and ``along_BODY`` for each beam with strains."""
    shots = [shot for shot in run.snapshots if any(points.size for points in shot.points.values())]
    if not shots:
        return
    yield "snapshots", _shapes(run, shots)
    for body in dict.fromkeys(name for shot in shots for name in shot.along):
        yield f"along_{slug(body)}", _along(run, body, [shot for shot in shots if body in shot.along])


def _own(shots: list[Snapshot], k: int) -> object:
    """Return the colour of a time."""
    return colour(k) if len(shots) <= 6 else TIME_COLOURS(k / (len(shots) - 1))


def _shapes(run: Run, shots: list[Snapshot]) -> Figure:
    every = np.vstack([points for shot in shots for points in shot.points.values()])
    if every.shape[1] == 3:
        sheet, views = three_views(every)
    else:
        sheet, axes = equal_axes(every)
        dress(axes, "x [m]", "y [m]")
        views = {(0, 1): axes}
    for pair, axes in views.items():
        for k, shot in enumerate(shots):
            for points in shot.points.values():
                _draw_body(axes, points[:, pair], _own(shots, k), f"t = {shot.t:.6g} s")
    return sheet.finish(headline(run, "shapes of the bodies"), list(views.values()))


def _draw_body(axes: Axes, points: Array, own: object, label: str) -> None:
    axes.plot(*points.T, color=own, label=label, marker="o", markersize=3.0, markevery=[0, -1])


def _along(run: Run, body: str, shots: list[Snapshot]) -> Figure:
    """Draw a row for each quantity that is not zero over the arc length, and a colour for each time."""
    largest, sizes = dict[str, float](), dict[str, float]()
    for shot in shots:
        for kind, values in shot.along[body].items():
            largest[kind] = max(largest.get(kind, 0.0), float(np.abs(values).max()))
            sizes[_unit(kind)] = max(sizes.get(_unit(kind), 0.0), largest[kind])
    kinds = [kind for kind, size in largest.items() if size > _UNSEEN * sizes[_unit(kind)]] or [*largest][:1]
    sheet, rows = Sheet(), list[Axes]()
    for number, kind in enumerate(kinds):
        below = (len(kinds) - 1 - number) * (_HEIGHT + _BETWEEN)
        axes = sheet.add(0.0, below, SIZE[0] - 1.2, _HEIGHT, sharex=rows[0] if rows else None)
        for k, shot in enumerate(shots):
            words = f"t = {shot.t:.6g} s"
            values = shot.along[body][kind]
            axes.plot(shot.places[body], values, color=_own(shots, k), label=words)
        mark_zero(axes)
        dress(axes, "" if below else "distance from the root along the beam [m]", _label(kind))
        axes.tick_params(labelbottom=not below)
        rows.append(axes)
    return sheet.finish(headline(run, f"along {body}"), rows)


def _label(kind: str) -> str:
    words = kind.replace("_force", "").replace("_moment", "").replace("_", " ")
    return with_unit(words, _unit(kind))


def _unit(kind: str) -> str:
    return kind_of(f"b.{kind}").unit
