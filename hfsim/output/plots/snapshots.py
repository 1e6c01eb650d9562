"""Pictures of the bodies at chosen times, and of what runs inside them along each beam."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hfsim.marching.solution import Run, Snapshot
from hfsim.output.plots.ink import Colour, Mark, Pen
from hfsim.output.plots.panel import Curve, mark_zero
from hfsim.output.plots.scale import with_unit
from hfsim.output.plots.sheet import Sheet
from hfsim.output.plots.space import views_of
from hfsim.output.plots.style import SIZE, TIME_COLOURS, colour, headline, slug
from hfsim.parts.channels import kind_of

_HEIGHT, _BETWEEN = 1.5, 0.2
"""Of a row, and between two [inch]."""
_UNSEEN = 1e-9
"""Part of the largest of its unit that no row is drawn of: forces are small differences of large numbers."""
_FLAT = 1e-7
"""The same of changes along a beam, of which solvers leave more."""


def snapshot_figures(run: Run) -> Iterator[tuple[str, Sheet]]:
    """Yield ``snapshots``, the bodies at these times, and ``along_BODY`` for each beam with strains."""
    shots = [shot for shot in run.snapshots if any(points.size for points in shot.points.values())]
    if not shots:
        return
    yield "snapshots", _shapes(run, shots)
    for body in dict.fromkeys(name for shot in shots for name in shot.along):
        yield f"along_{slug(body)}", _along(run, body, [shot for shot in shots if body in shot.along])


def _own(shots: list[Snapshot], k: int) -> Colour:
    """Return the colour of a time."""
    return colour(k) if len(shots) <= 6 else TIME_COLOURS(k / (len(shots) - 1))


def _shapes(run: Run, shots: list[Snapshot]) -> Sheet:
    every = np.vstack([points for shot in shots for points in shot.points.values()])
    sheet, views = views_of(every)
    for pair, panel in views.items():
        for k, shot in enumerate(shots):
            own, words = _own(shots, k), f"t = {shot.t:.6g} s"
            mark = Mark("o", 3.0, own, own)
            for points in shot.points.values():
                panel.things.append(Curve(points[:, pair], Pen(own, 1.5), words, mark, ends=True))
    return sheet.finish(headline(run, "shapes of the bodies"), list(views.values()))


def _along(run: Run, body: str, shots: list[Snapshot]) -> Sheet:
    """Draw a row for each quantity that is not zero over the arc length, and a colour for each time."""
    largest, sizes = dict[str, float](), dict[str, float]()
    for shot in shots:
        for kind, values in shot.along[body].items():
            largest[kind] = max(largest.get(kind, 0.0), float(np.abs(values).max()))
            sizes[_unit(kind)] = max(sizes.get(_unit(kind), 0.0), largest[kind])
    rounding = shots[0].rounding[body]
    least = {kind: max(rounding[kind], _UNSEEN * sizes[_unit(kind)]) for kind in largest}
    kinds = [kind for kind, size in largest.items() if size > least[kind]] or [*largest][:1]
    sheet = Sheet()
    for number, kind in enumerate(kinds):
        below = (len(kinds) - 1 - number) * (_HEIGHT + _BETWEEN)
        panel = sheet.add(0.0, below, SIZE[0] - 1.2, _HEIGHT)
        for k, shot in enumerate(shots):
            words = f"t = {shot.t:.6g} s"
            values = shot.along[body][kind]
            if np.abs(values).max() <= rounding[kind]:
                values = np.zeros_like(values)
            elif np.ptp(values) <= max(rounding[kind], _FLAT * sizes[_unit(kind)]):
                values = np.full_like(values, values.mean())
            points = np.column_stack([shot.places[body], values])
            panel.things.append(Curve(points, Pen(_own(shots, k), 1.5), words))
        panel.fit()
        mark_zero(panel)
        panel.dress("distance from the root along the beam [m]", _label(kind))
        if below:
            panel.hide_numbers()
    return sheet.finish(headline(run, f"along {body}"), sheet.panels)


def _label(kind: str) -> str:
    words = kind.replace("_force", "").replace("_moment", "").replace("_", " ")
    return with_unit(words, _unit(kind))


def _unit(kind: str) -> str:
    return kind_of(f"b.{kind}").unit
