"""Pictures of several models of one scene: overlays, error against cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hfsim.marching.alike import jumps
from hfsim.marching.rounding import levelled
from hfsim.marching.solution import Channel, Run
from hfsim.output.plots.figures import dress_log, finished, log_figure
from hfsim.output.plots.files import save
from hfsim.output.plots.history import broken
from hfsim.output.plots.ink import DASHED, Mark, Pen
from hfsim.output.plots.panel import Curve, Panel, key, mark_zero
from hfsim.output.plots.scale import with_unit
from hfsim.output.plots.sheet import Sheet
from hfsim.output.plots.style import BLUE, COLOURS, GREEN, ORANGE, PURPLE, RED, SIZE, ended, slug
from hfsim.studies.compare.result import Comparison, percent

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MODEL_COLOURS = {
    "rigid": ORANGE,
    "linear": RED,
    "lowOrder": BLUE,
    "exact": PURPLE,
    "ancf": GREEN,
}
_OFF_SCALE = 1e3
"""Relative differences above this are drawn here."""
_CLIP = 3.0
"""Height of an overlay's axis at most, in ranges of the reference."""


def draw_comparison(runs: Sequence[Run], comparison: Comparison, folder: Path) -> list[str]:
    """Draw every channel over all models, and each model's error against its cost; return the files.

    The runs are those compared, the reference among them, with finite values only.
    """
    truth = next(run for run in runs if run.model == comparison.reference)
    if not len(truth.t):
        return []
    runs = [_shown(run, truth) for run in runs]
    truth = next(run for run in runs if run.model == comparison.reference)
    figures: dict[str, Sheet | Figure | None] = {
        slug(channel.name): _overlay_figure(runs, truth, channel) for channel in truth.channels
    }
    cost = _cost_figure(comparison)
    if cost is not None:
        figures["error_against_cost"] = cost
    return save(figures, folder)


def _shown(run: Run, truth: Run) -> Run:
    """Return a run as curves are drawn through it; what is rounding in the reference's scene is left out."""
    drawn = run.drawn
    return replace(drawn, channels=levelled(drawn.channels, truth.outlines))


def _overlay_figure(runs: Sequence[Run], truth: Run, channel: Channel) -> Sheet:
    sheet = Sheet()
    panel = sheet.add(0.0, 0.0, SIZE[0] - 1.2, 3.6)
    own = ((run, _channel(run, channel.name)) for run in runs)
    curves = [(run, one) for run, one in own if one is not None]
    low, high, clipped = overlay_limits(channel.values, [one.values for _, one in curves])
    for run, one in curves:
        if run is not truth:
            _draw_model(panel, run, one, (low, high))
    label = f"{truth.model} (reference)" + ("" if truth.status == "done" else f" ({ended(truth)})")
    points = np.column_stack(broken(truth.t, channel, jumps([channel])))
    panel.things.append(Curve(points, Pen("black", 1.5, DASHED), label))
    panel.fit()
    panel.limit(y=(low, high))
    stopped = ((run, one) for run, one in curves if run is not truth and run.status != "done")
    panel.things += [_end(run, one, (low, high)) for run, one in stopped]
    mark_zero(panel)
    panel.dress("time [s]", with_unit(channel.name, channel.unit))
    note = f" (axis cut at {_CLIP:.0f} x the reference's range)" if clipped else ""
    return sheet.finish(f"{truth.name}: {channel.name} by model{note}", [panel])


def _channel(run: Run, name: str) -> Channel | None:
    found = next((channel for channel in run.channels if channel.name == name), None)
    return found if found is not None and len(found.values) else None


def _draw_model(panel: Panel, run: Run, channel: Channel, limits: tuple[float, float]) -> None:
    low, high = limits
    room = 2.0 * (high - low)
    t, values = broken(run.t, channel, jumps([channel]))
    values = np.clip(values, low - room, high + room)  # 1e200 would overflow the drawing library
    shown = np.column_stack([t, values])
    colour = _MODEL_COLOURS.get(run.model, COLOURS[4])
    if run.status == "done":
        panel.things.append(Curve(shown, Pen(colour, 1.8), run.model))
        return
    panel.things.append(Curve(shown, Pen(colour, 1.8)))
    broken_off = Mark("X", 9.0, colour, colour)
    panel.things.append(key(f"{run.model} ({ended(run)})", Pen(colour, 1.8), broken_off))


def _end(run: Run, channel: Channel, limits: tuple[float, float]) -> Curve:
    """Return a cross where a model stopped."""
    there = np.array([(run.t[-1], np.clip(channel.values[-1], *limits))])
    mark = Mark("X", 10.0, _MODEL_COLOURS.get(run.model, COLOURS[4]), "white")
    return Curve(there, mark=mark, clipped=False)


def overlay_limits(reference: np.ndarray, curves: Sequence[np.ndarray]) -> tuple[float, float, bool]:
    """Return the limits of an overlay's axis, in which a diverging model cannot squash the others.

    Parameters
    ----------
    reference : ndarray, shape (n,)
        Values of the reference.
    curves : sequence of ndarray
        Values of all models.

    Returns
    -------
    low, high : float
        At most three ranges of the reference around its middle, unless it is constant.
    clipped : bool
        Whether some curve leaves them.

    Examples
    --------
    >>> overlay_limits(np.array([0.0, 1.0]), [np.array([0.0, 100.0])])
    (-0.05, 2.0, True)
    """
    low, high = float(reference.min()), float(reference.max())
    span = max(high - low, 1e-9 * max(abs(low), abs(high)))
    middle = 0.5 * (low + high)
    floor, ceiling = middle - 0.5 * _CLIP * span, middle + 0.5 * _CLIP * span
    bottom = min([low, *(float(values.min()) for values in curves)])
    top = max([high, *(float(values.max()) for values in curves)])
    if low == high and bottom < top:
        return bottom - 0.05 * (top - bottom), top + 0.05 * (top - bottom), False
    clipped = bottom < floor or top > ceiling
    margin = 0.05 * span
    bottom, top = max(bottom - margin, floor), min(top + margin, ceiling)
    return bottom, top, clipped


def _cost_figure(comparison: Comparison) -> Figure | None:
    others = [m for m in comparison.models if m.model != comparison.reference]
    shown = [m for m in others if m.worst and m.solve_cpu > 0.0]
    if not shown:
        return None
    figure, (axes,) = log_figure((8.4, 4.6))
    for m in shown:
        assert m.worst
        error = float(np.clip(m.worst.max_relative, 1e-16, _OFF_SCALE))
        marker = "X" if m.broke_down else "o"
        colour = _MODEL_COLOURS.get(m.model, COLOURS[4])
        label = f"{m.model} ({m.ended})" if m.broke_down else m.model
        if error == _OFF_SCALE:
            label += ", off scale"
        axes.plot([m.solve_cpu], [error], marker, color=colour, markersize=10, label=label)
    cost = comparison.result(comparison.reference).solve_cpu
    if cost > 0.0:
        axes.axvline(cost, color="black", linestyle="--", label=f"cost of {comparison.reference} (reference)")
    bound = comparison.max_error
    axes.axhline(bound, color="0.5", linestyle=":", label=f"bound {percent(bound)}")
    dress_log(axes, "CPU time of the solution [s]", "largest relative difference [-]")
    return finished(figure, f"{comparison.name}: error against cost", [axes])
