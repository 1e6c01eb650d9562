"""Pictures of modes: both extremes of each shape beside the state."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.output.plots.files import save
from hfsim.output.plots.ink import Pen
from hfsim.output.plots.panel import TITLED, Note, Panel, Strokes
from hfsim.output.plots.sheet import Sheet
from hfsim.output.plots.space import oblique
from hfsim.output.plots.style import BLUE, RED
from hfsim.studies.modes import Mode, Modes

_PANELS = 6
"""Of one picture."""
_COLUMNS = 3
_AMPLITUDE = 0.16
"""Largest displacement drawn, over the size of the scene."""
_STATE = "0.72"
_MARGIN = 0.08
_WIDTHS = {1: 4.8, 2: 4.8, 3: 3.4}
"""Of panels, by their number side by side [inch]."""
_GAP, _ABOVE = 0.25, 0.12
"""Between panels, and above each one's title [inch]."""


def draw_modes(found: Modes, folder: Path) -> list[str]:
    """Draw all modes, six to a picture: ``modes``, or ``modes_1`` and so on; return the files."""
    pages = [found.modes[k : k + _PANELS] for k in range(0, len(found.modes), _PANELS)]
    names = ["modes"] if len(pages) == 1 else [f"modes_{k}" for k in range(1, len(pages) + 1)]
    return save({name: _page(found, page) for name, page in zip(names, pages, strict=True)}, folder)


def _page(found: Modes, modes: Sequence[Mode]) -> Sheet:
    spatial = found.about.scene.deck.dimension == 3
    state = [_seen(points, spatial) for points in found.outlines.values() if points.size]
    extremes = [
        [[_seen(points, spatial) for points in shapes.values()] for shapes in _extremes(found, mode)]
        for mode in modes
    ]
    low, high = _bounds(np.concatenate([*state, *(one for pair in extremes for own in pair for one in own)]))
    sheet = Sheet()
    for panel, mode, pair in zip(_panels(sheet, len(modes), high - low), modes, extremes, strict=True):
        panel.title = _title(mode)
        panel.limit((low[0], high[0]), (low[1], high[1]))
        panel.things.append(Strokes(state, Pen(_STATE, 2.2)))
        panel.things += [Strokes(own, Pen(of, 1.4)) for own, of in zip(pair, (BLUE, RED), strict=True)]
        if spatial:
            _draw_ground_axes(panel, low, high)
        else:
            panel.dress("x [m]", "y [m]")
            below = any(one.x == panel.x and one.y < panel.y for one in sheet.panels)
            panel.hide_numbers(below, beside=bool(panel.x))
    return sheet.finish(_words(found))


def _panels(sheet: Sheet, count: int, size: Array) -> list[Panel]:
    """Return panels that show a part of the plane of a size (2,) [m], row by row from above."""
    columns = min(_COLUMNS if size[0] < 2.5 * size[1] else 2, count)
    rows, wide = -(-count // columns), _WIDTHS[columns]
    width, height = (size * min(wide / size[0], 2.0 * wide / size[1])).tolist()
    step = height + _ABOVE + TITLED
    places = [divmod(k, columns) for k in range(count)]
    return [sheet.add(x * (width + _GAP), (rows - 1 - y) * step, width, height) for y, x in places]


def _words(found: Modes) -> str:
    about = found.about
    turning = ", seen from axes that turn" if about.axes_turn else ""
    state = about.state if about.period is None else f"{about.t:.4g} s in a period of {about.period:.4g} s"
    return f"{about.scene.deck.name}, {about.scene.model}: modes; grey: {state}{turning}; both extremes"


def _draw_ground_axes(panel: Panel, low: Array, high: Array) -> None:
    """Draw the directions of the ground's axes into the lower left corner."""
    size = 0.09 * float((high - low).max())
    corner = low + 0.6 * size
    for name, end in zip("xyz", oblique(size * np.eye(3)), strict=True):
        panel.things.append(Strokes([np.stack([corner, corner + end])], Pen("0.5", 0.9)))
        x, y = (corner + 1.25 * end).tolist()
        panel.things.append(Note(name, x, y, 7.0, "0.4"))


def _title(mode: Mode) -> str:
    told = f"{mode.number}: {mode.frequency:.5g} Hz" if mode.frequency else f"{mode.number}"
    if mode.kind != "vibration":
        told += f", {mode.kind}"
    if mode.turns_only:
        told += ", turns only"
    if mode.value.imag and mode.value.real and mode.about.period is None:
        told += f", damping ratio {mode.damping_ratio:.3g}"
    elif mode.value.real:
        told += f", {mode.growth:+.3g}/s"
    return told


def _extremes(found: Modes, mode: Mode) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return outlines at both extremes of a mode."""
    size = _AMPLITUDE * found.about.size
    largest = max((float(np.abs(shape).max(initial=0.0)) for shape in mode.shapes.values()), default=0.0)
    factor = 0.0 if mode.turns_only else size / largest
    moved = {name: factor * shape.real for name, shape in mode.shapes.items() if shape.size}
    first = {name: found.outlines[name] + one for name, one in moved.items()}
    return first, {name: found.outlines[name] - one for name, one in moved.items()}


def _seen(points: Array, spatial: bool) -> Array:
    return oblique(points) if spatial else points


def _bounds(points: Array) -> tuple[Array, Array]:
    low, high = points.min(axis=0), points.max(axis=0)
    longest = float((high - low).max()) or 1.0
    middle, half = 0.5 * (low + high), 0.5 * np.maximum(high - low, 0.3 * longest) + _MARGIN * longest
    return middle - half, middle + half
