"""Pictures of modes: both extremes of each shape beside the state, and frequencies against rates."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.output.plots.figures import dress, new_figure, outside_legend, set_title, set_title_above
from hfsim.output.plots.files import save
from hfsim.output.plots.space import oblique
from hfsim.output.plots.style import BLUE, RED, colour, dashes
from hfsim.studies.modes import Campbell, Mode, Modes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PANELS = 6
"""Of one picture."""
_COLUMNS = 3
_AMPLITUDE = 0.16
"""Largest displacement drawn, over the size of the scene."""
_STATE = "0.72"
_MARGIN = 0.08
_UNSTABLE = "x"
_ALIKE = 1e-6
"""Relative difference of frequencies up to which one curve stands for several modes."""


def draw_modes(found: Modes, folder: Path) -> list[str]:
    """Draw all modes, six to a picture: ``modes``, or ``modes_1`` and so on; return the files."""
    pages = [found.modes[k : k + _PANELS] for k in range(0, len(found.modes), _PANELS)]
    names = ["modes"] if len(pages) == 1 else [f"modes_{k}" for k in range(1, len(pages) + 1)]
    return save({name: _page(found, page) for name, page in zip(names, pages, strict=True)}, folder)


def _page(found: Modes, modes: Sequence[Mode]) -> Figure:
    outlines = {name: points for name, points in found.outlines.items() if points.size}
    spatial = found.about.scene.deck.dimension == 3
    extremes = [_extremes(found, mode) for mode in modes]
    every = [_seen(points, spatial) for points in outlines.values()]
    every += [_seen(points, spatial) for pair in extremes for shapes in pair for points in shapes.values()]
    low, high = _bounds(np.concatenate(every))
    width, height = high - low
    columns = min(_COLUMNS, len(modes)) if width < 2.5 * height else min(2, len(modes))
    rows = -(-len(modes) // columns)
    size = 3.4 if columns == _COLUMNS else 4.8
    figure = new_figure((columns * size + 0.4, rows * (size * min(2.0, height / width) + 0.75) + 0.7))
    panels = figure.subplots(rows, columns, squeeze=False)
    for axes in panels.flat[len(modes) :]:
        axes.set_axis_off()
    for axes, mode, pair in zip(panels.flat, modes, extremes, strict=False):
        for points in outlines.values():
            axes.plot(*_seen(points, spatial).T, color=_STATE, linewidth=2.2, label="state")
        for shapes, own in zip(pair, (BLUE, RED), strict=True):
            for points in shapes.values():
                axes.plot(*_seen(points, spatial).T, color=own, linewidth=1.4)
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        axes.set_aspect("equal")
        axes.set_title(_title(mode), fontsize=9, loc="left")
        if spatial:
            axes.set_axis_off()
            _ground_axes(axes, low, high)
        else:
            dress(axes, "x [m]", "y [m]")
            axes.tick_params(labelsize=8)
            axes.xaxis.label.set(fontsize=8, visible=axes in panels[-1])
            axes.yaxis.label.set(fontsize=8, visible=axes in panels[:, 0])
    about = found.about
    turning = ", seen from axes that turn" if about.axes_turn else ""
    state = about.state if about.period is None else f"{about.t:.4g} s in a period of {about.period:.4g} s"
    words = f"{about.scene.deck.name}, {about.scene.model}: modes; grey: {state}{turning}; both extremes"
    set_title_above(figure, words)
    return figure


def _ground_axes(axes: Axes, low: Array, high: Array) -> None:
    """Draw the directions of the ground's axes into the lower left corner."""
    size = 0.09 * float((high - low).max())
    corner = low + 0.6 * size
    for name, end in zip("xyz", oblique(size * np.eye(3)), strict=True):
        axes.plot(*np.stack([corner, corner + end]).T, color="0.5", linewidth=0.9)
        x, y = corner + 1.25 * end
        axes.text(x, y, name, color="0.4", fontsize=7, ha="center", va="center")


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


def _together(result: Campbell) -> list[list[int]]:
    """Return the numbers of modes in groups of those with one frequency at all rates, as of equal blades."""
    groups = list[list[int]]()
    for number in range(1, len(result.tracks) + 1):
        own = result.frequencies(number)
        for group in groups:
            if np.allclose(own, result.frequencies(group[0]), rtol=_ALIKE, atol=0.0, equal_nan=True):
                group.append(number)
                break
        else:
            groups.append([number])
    return groups


def draw_campbell(result: Campbell, folder: Path) -> list[str]:
    """Draw ``campbell``: frequencies against rates, with the lines of excitations; return the file."""
    from hfsim.studies.modes.campbell import ORDERS

    figure = new_figure((9.0, 5.2))
    axes: Axes = figure.subplots()
    rates, top = result.rates, 0.0
    for k, numbers in enumerate(_together(result)):
        values = result.frequencies(numbers[0])
        label = f"mode {numbers[0]}" if len(numbers) == 1 else f"modes {', '.join(map(str, numbers))}"
        own = [one for one in result.crossings if one.track == numbers[0]]
        every = np.concatenate([rates, [one.rate for one in own]])
        curve = np.concatenate([values, [one.frequency for one in own]])
        sorted_places = np.argsort(every, kind="stable")
        style = (0.0, dashes(k)) if dashes(k) else "-"
        axes.plot(
            every[sorted_places], curve[sorted_places], color=colour(k), linestyle=style, linewidth=1.5,
            label=label,
        )  # fmt: skip
        axes.plot(rates, values, "o", color=colour(k), markersize=3.0)
        top = max(top, float(np.nanmax(values, initial=0.0)))
        tracks = [result.tracks[number - 1] for number in numbers]
        bad = [j for j, modes in enumerate(zip(*tracks, strict=True)) if any(m and m.unstable for m in modes)]
        axes.plot(
            rates[bad], values[bad], _UNSTABLE, color="black", markersize=8, label="unstable" if bad else None
        )
    low, high = float(rates.min()), float(rates.max())
    top *= 1.06
    for order in ORDERS:
        ends = np.array([low, high])
        axes.plot(ends, order * ends / (2.0 * np.pi), color="0.55", linewidth=0.9, linestyle="--")
        at = min(high, 2.0 * np.pi * top / order)
        axes.annotate(
            f"{order} per rev.", (at, order * at / (2.0 * np.pi)), color="0.4", fontsize=8, ha="right",
            va="bottom", xytext=(-6, -16 if at < high else 2), textcoords="offset points",
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6},
        )  # fmt: skip
    crossed = np.array([(one.rate, one.frequency) for one in result.crossings]).reshape(-1, 2)
    axes.plot(
        *crossed.T, "o", markerfacecolor="none", markeredgecolor="black", markersize=9,
        label="crossing" if len(crossed) else None,
    )  # fmt: skip
    axes.set_xlim(low, high)
    axes.set_ylim(0.0, top or 1.0)
    dress(axes, "rate [rad/s]", "frequency [Hz]")
    outside_legend(figure, [axes])
    about = result.founds[0].about
    set_title(figure, f"{about.scene.deck.name}, {about.scene.model}: frequencies {result.view}")
    return save({"campbell": figure}, folder)
