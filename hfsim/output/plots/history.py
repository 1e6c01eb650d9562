"""Pictures of channels against time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hfsim.marching.alike import jumps
from hfsim.marching.rounding import levelled
from hfsim.marching.solution import Channel, Run
from hfsim.maths.arrays import Array, IntArray
from hfsim.output.plots.style import (
    SIZE,
    colour,
    dress,
    finished,
    headline,
    mark_zero,
    new_figure,
    slug,
    stacked,
    with_unit,
)
from hfsim.parts.channels import CHANNELS, kind_of


def time_figures(run: Run) -> dict[str, Figure]:
    """Return a picture for each plot that channels name, then one for each quantity of the others.

    What is zero or constant but for rounding is drawn so.
    """
    figures: dict[str, Figure] = {}
    run = replace(run, channels=levelled(run.channels, run.outlines))
    kinds = [(channel, kind_of(channel.name).plot) for channel in run.channels]
    for stem in dict.fromkeys(kind.plot.stem for kind in CHANNELS.values() if kind.plot.stem):
        chosen = [channel for channel, plot in kinds if plot.stem == stem]
        if chosen:
            figures[stem] = _time_figure(run, chosen)
    rest = [channel for channel, plot in kinds if not plot.stem]
    for quantity in dict.fromkeys(_parts(channel)[1] for channel in rest):
        figures[slug(quantity)] = _time_figure(run, [one for one in rest if _parts(one)[1] == quantity])
    return figures


def _words(channels: Sequence[Channel]) -> str:
    return kind_of(channels[0].name).plot.words or _parts(channels[0])[1]


def _time_figure(run: Run, channels: Sequence[Channel]) -> Figure:
    kinds = [kind_of(channel.name) for channel in channels]
    several = all(len(set(one)) > 1 for one in zip(*map(_parts, channels), strict=True))
    vectors = several and any(kind.dimensions == (3,) for kind in kinds)
    draw = _quantities_figure if kinds[0].plot.rows or vectors else _units_figure
    return draw(run, channels)


def _parts(channel: Channel) -> tuple[str, str]:
    """Return subject and quantity."""
    subject, _, quantity = channel.name.rpartition(".")
    return subject, quantity


def _quantities_figure(run: Run, channels: Sequence[Channel]) -> Figure:
    """Draw a row for each quantity and a colour for each subject."""
    quantities = sorted({_parts(channel)[1] for channel in channels})
    subjects = list(dict.fromkeys(_parts(channel)[0] for channel in channels))
    figure = new_figure((SIZE[0], 1.4 + (2.4 if len(quantities) < 3 else 1.9) * len(quantities)))
    rows = stacked(figure, len(quantities))
    breaks = jumps(channels)
    for axes, wanted in zip(rows, quantities, strict=True):
        for channel in channels:
            subject, quantity = _parts(channel)
            if quantity == wanted:
                own = colour(subjects.index(subject))
                axes.plot(*_curve(run, channel, breaks), color=own, label=subject)
        dress(axes, "", with_unit(wanted, channels[0].unit))
    points = " of points" if kind_of(channels[0].name).plot.rows else ""
    of = f" of {subjects[0]}" if len(subjects) == 1 else points
    return _over_time(figure, rows, headline(run, _words(channels) + of))


def _units_figure(run: Run, channels: Sequence[Channel]) -> Figure:
    """Draw a row for each unit and a colour for each channel."""
    words = _words(channels)
    units = list(dict.fromkeys(channel.unit for channel in channels))
    figure = new_figure((SIZE[0], 2.2 + 2.4 * len(units)))
    rows = stacked(figure, len(units))
    breaks = jumps(channels)
    for axes, unit in zip(rows, units, strict=True):
        for i, channel in enumerate(c for c in channels if c.unit == unit):
            axes.plot(*_curve(run, channel, breaks), color=colour(i), label=channel.name)
        dress(axes, "", with_unit(words, unit))
    return _over_time(figure, rows, headline(run, channels[0].name if len(channels) == 1 else words))


def _curve(run: Run, channel: Channel, breaks: Mapping[str, IntArray]) -> tuple[Array, Array]:
    """Return the points of a curve, with gaps where it is broken."""
    rows = breaks.get(channel.name, ())
    return np.insert(run.t, rows, np.nan), np.insert(channel.values, rows, np.nan)


def _over_time(figure: Figure, rows: Sequence[Axes], title: str) -> Figure:
    rows[-1].set_xlabel("time [s]")
    for axes in rows:
        mark_zero(axes)
    return finished(figure, title, rows)
