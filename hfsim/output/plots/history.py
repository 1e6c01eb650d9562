"""Pictures of channels against time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain, count
from typing import NamedTuple

import numpy as np

from hfsim.marching.alike import jumps
from hfsim.marching.rounding import levelled
from hfsim.marching.solution import Channel, Run
from hfsim.maths.arrays import Array, IntArray
from hfsim.output.plots.ink import Colour, Mark, Pen
from hfsim.output.plots.panel import Curve, Note, Panel, mark_zero
from hfsim.output.plots.scale import with_unit
from hfsim.output.plots.sheet import Sheet
from hfsim.output.plots.style import COLOURS, DASHES, SIZE, colour, dashes, headline, slug
from hfsim.parts.channels import CHANNELS, kind_of

_BETWEEN = 0.2
"""Between two rows [inch]."""
_LINE = 0.006
"""Height of a line in those of its axes."""
_BEFORE = 0.9
"""Part of the times of a failed run that sets the scale."""


def time_figures(run: Run) -> dict[str, Sheet]:
    """Return a picture for each plot that channels name, then one for each quantity of the others.

    What is zero or constant but for rounding is drawn so.
    """
    figures: dict[str, Sheet] = {}
    run = replace(run, channels=levelled(run.channels, run.outlines))
    kinds = [(channel, kind_of(channel.name).plot) for channel in run.channels]
    for stem in dict.fromkeys(kind.plot.stem for kind in chain(*CHANNELS.values()) if kind.plot.stem):
        chosen = [channel for channel, plot in kinds if plot.stem == stem]
        if chosen:
            figures[stem] = _time_figure(run, chosen)
    rest = [channel for channel, plot in kinds if not plot.stem]
    for quantity in dict.fromkeys(_parts(channel)[1] for channel in rest):
        figures[slug(quantity)] = _time_figure(run, [one for one in rest if _parts(one)[1] == quantity])
    return figures


def _words(channels: Sequence[Channel]) -> str:
    return kind_of(channels[0].name).plot.words or _parts(channels[0])[1]


def _time_figure(run: Run, channels: Sequence[Channel]) -> Sheet:
    kinds = [kind_of(channel.name) for channel in channels]
    several = all(len(set(one)) > 1 for one in zip(*map(_parts, channels), strict=True))
    vectors = several and any(kind.dimensions == (3,) for kind in kinds)
    draw = _quantities_figure if kinds[0].plot.rows or vectors else _units_figure
    return draw(run, channels)


def _parts(channel: Channel) -> tuple[str, str]:
    """Return subject and quantity."""
    subject, _, quantity = channel.name.rpartition(".")
    return subject, quantity


def _quantities_figure(run: Run, channels: Sequence[Channel]) -> Sheet:
    """Draw a row for each quantity and a colour for each subject."""
    quantities = sorted({_parts(channel)[1] for channel in channels})
    subjects = list(dict.fromkeys(_parts(channel)[0] for channel in channels))
    rows = []
    for wanted in quantities:
        own = [channel for channel in channels if _parts(channel)[1] == wanted]
        named = [(channel, _parts(channel)[0]) for channel in own]
        curves = [Shown(channel, subject, subjects.index(subject)) for channel, subject in named]
        rows.append(Row(with_unit(wanted, channels[0].unit), curves))
    points = " of points" if kind_of(channels[0].name).plot.rows else ""
    of = f" of {subjects[0]}" if len(subjects) == 1 else points
    return _over_time(run, rows, 2.1 if len(rows) < 3 else 1.7, headline(run, _words(channels) + of))


def _units_figure(run: Run, channels: Sequence[Channel]) -> Sheet:
    """Draw a row for each unit and a colour for each channel."""
    words, rows, numbers = _words(channels), [], count()
    for unit in dict.fromkeys(channel.unit for channel in channels):
        own = [channel for channel in channels if channel.unit == unit]
        curves = [Shown(channel, channel.name, next(numbers)) for channel in own]
        rows.append(Row(with_unit(words, unit), curves))
    title = headline(run, channels[0].name if len(channels) == 1 else words)
    return _over_time(run, rows, 3.2 if len(rows) == 1 else 2.2, title)


class Shown(NamedTuple):
    """A channel as it is drawn.

    Attributes
    ----------
    number : int
        Of what it is of in the picture, which has a colour; see `colour`.
    """

    channel: Channel
    label: str
    number: int

    @property
    def repeats(self) -> bool:
        """Whether its colour is that of another one too."""
        return self.number >= len(COLOURS)

    def pen(self, over: int, repeated: bool) -> Pen:
        """Return how it is drawn where it covers some others.

        It is dashed, so that they are seen; where colours are ``repeated``, and dashes tell which one of a
        colour it is, it is thin.
        """
        own = colour(self.number)
        if repeated:
            return Pen(own, 1.0 if over else 1.7, dashes(self.number))
        return Pen(own, 1.5 if over else 1.7, DASHES[over % len(DASHES)])


class Row(NamedTuple):
    """Axes of a figure over time."""

    label: str
    curves: Sequence[Shown]


def _over_time(run: Run, rows: Sequence[Row], height: float, title: str) -> Sheet:
    sheet = Sheet()
    curves = [curve for row in rows for curve in row.curves]
    breaks, repeated = jumps([curve.channel for curve in curves]), any(curve.repeats for curve in curves)
    for number, row in enumerate(rows):
        below = (len(rows) - 1 - number) * (height + _BETWEEN)
        panel = sheet.add(0.0, below, SIZE[0] - 1.2, height)
        _draw(panel, run, row, breaks, repeated)
        panel.dress("time [s]", row.label)
        if below:
            panel.hide_numbers()
    return sheet.finish(title, sheet.panels)


def _draw(panel: Panel, run: Run, row: Row, breaks: Mapping[str, IntArray], repeated: bool) -> None:
    """Draw the curves of a row, with marks for what is off scale; see `Shown.pen`."""
    values = [curve.channel.values for curve in row.curves]
    low, high, beyond = limits(values, run.status == "failed")
    marks: list[Curve | Note] = []
    for curve, over in zip(row.curves, covering(values, high - low), strict=True):
        t, drawn = broken(run.t, curve.channel, breaks)
        pen = curve.pen(over, repeated)
        shown = np.clip(drawn, 2.0 * low - high, 2.0 * high - low)
        panel.things.append(Curve(np.column_stack([t, shown]), pen, curve.label))
        if beyond and np.nanmax(drawn) > high:
            marks += _off_scale(t[np.nanargmax(drawn)], high, "^", pen.colour)
        if beyond and np.nanmin(drawn) < low:
            marks += _off_scale(t[np.nanargmin(drawn)], low, "v", pen.colour)
    begin, end = float(run.t[0]), float(run.t[-1])
    panel.limit((begin - 0.02 * (end - begin), end + 0.02 * (end - begin) or 1.0), (low, high))
    panel.things += marks
    mark_zero(panel)


def _off_scale(t: float, edge: float, shape: str, own: Colour) -> tuple[Curve, Note]:
    """Return a mark at the edge of the axes, and what it means."""
    up, down = ("top", -12.0) if shape == "^" else ("bottom", 12.0)
    mark = Curve(np.array([(t, edge)]), mark=Mark(shape, 9.0, own, own), clipped=False)
    return mark, Note("off scale", t, edge, 9.0, across="right", up=up, move=(-6.0, down))


def limits(curves: Sequence[Array], diverged: bool) -> tuple[float, float, bool]:
    """Return the limits of an axis, and whether some curve leaves them.

    Of a run that failed, they are those before its end, where numbers may grow beyond all bounds.

    Examples
    --------
    >>> limits([np.array([0.0, 1.0])], False)
    (-0.05, 1.05, False)
    >>> limits([np.append(np.linspace(0.0, 1.0, 99), 1e9)], True)[2]
    True
    """
    low, high = _ends(curves)
    if diverged:
        calm = _ends([values[: max(2, int(_BEFORE * len(values)))] for values in curves])
        room = 2.0 * (calm[1] - calm[0])
        if room > 0.0 and high - low > 4.0 * room:
            return calm[0] - 0.25 * room, calm[1] + 0.25 * room, True
    margin = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    return low - margin, high + margin, False


def _ends(curves: Sequence[Array]) -> tuple[float, float]:
    every = np.concatenate(curves)
    return float(np.nanmin(every)), float(np.nanmax(every))


def covering(curves: Sequence[Array], height: float) -> list[int]:
    """Return how many earlier curves each covers, at a third of the times or more.

    Examples
    --------
    >>> one, other = np.array([0.0, 1.0, 2.0]), np.array([2.0, 0.0, 1.0])
    >>> covering([one, other, one + 1e-9], 2.0)
    [0, 0, 1]
    """
    near = _LINE * (height or 1.0)
    found = []
    for k, mine in enumerate(curves):
        same = (np.mean(np.abs(mine - other) < near) for other in curves[:k] if len(other) == len(mine))
        found.append(sum(bool(share > 1.0 / 3.0) for share in same))
    return found


def broken(t: Array, channel: Channel, breaks: Mapping[str, IntArray]) -> tuple[Array, Array]:
    """Return the points of a curve, with gaps where it is broken; see `jumps`."""
    rows = breaks.get(channel.name, ())
    return np.insert(t, rows, np.nan), np.insert(channel.values, rows, np.nan)
