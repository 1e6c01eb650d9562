"""Pictures of modes over rates: frequencies with the lines of excitations (Campbell)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hfsim.output.plots.figures import dress, new_figure, outside_legend, set_title
from hfsim.output.plots.files import save
from hfsim.output.plots.style import colour, dashes
from hfsim.studies.modes import Campbell
from hfsim.studies.modes.campbell import ORDERS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_UNSTABLE = "x"
_LINES = "0.55"
"""Colour of excitations."""
_GROWS = "mistyrose"
"""Colour of rates at which something grows."""
_ALIKE = 1e-6
"""Relative difference of frequencies up to which one curve stands for several modes."""


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


def _draw_excitations(axes: Axes, low: float, high: float, top: float) -> None:
    """Draw frequencies of excitations over rates from low to high [rad/s], named below a top [Hz]."""
    ends = np.array([low, np.clip(0.0, low, high), high])
    fastest, side, inwards = (high, "right", -6) if high >= -low else (low, "left", 6)
    for order in ORDERS:
        axes.plot(ends, order * abs(ends) / (2.0 * np.pi), color=_LINES, linewidth=0.9, linestyle="--")
        at = min(abs(fastest), 2.0 * np.pi * top / order)
        axes.annotate(
            f"{order} per rev.", (np.copysign(at, fastest), order * at / (2.0 * np.pi)), color="0.4",
            fontsize=8, ha=side, va="bottom", xytext=(inwards, -16 if at < abs(fastest) else 2),
            textcoords="offset points", bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6},
        )  # fmt: skip


def draw_campbell(result: Campbell, folder: Path) -> list[str]:
    """Draw ``campbell``: frequencies against rates, with the lines of excitations; return the file."""
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
    for k, (begin, end) in enumerate(result.unstable_ranges):
        name = "_" if k else "something grows"  # named once
        axes.axvspan(begin, end, facecolor=_GROWS, edgecolor="none", zorder=0, label=name)
    _draw_excitations(axes, low, high, top)
    crossed = np.array([(one.rate, one.frequency) for one in result.crossings]).reshape(-1, 2)
    axes.plot(
        *crossed.T, "o", markerfacecolor="none", markeredgecolor="black", markersize=9,
        label="crossing" if len(crossed) else None,
    )  # fmt: skip
    axes.set_xlim(low, high if high > low else low + 1.0)
    axes.set_ylim(0.0, top or 1.0)
    dress(axes, "rate [rad/s]", "frequency [Hz]")
    outside_legend(figure, [axes])
    about = result.founds[0].about
    set_title(figure, f"{about.scene.deck.name}, {about.scene.model}: frequencies {result.view}")
    return save({"campbell": figure}, folder)
