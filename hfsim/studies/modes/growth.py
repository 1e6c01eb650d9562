"""Where modes of a scene that turns begin to grow, between two rates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, TypeAlias

from hfsim.maths.arrays import Array
from hfsim.studies.modes.about import About, ModesError
from hfsim.studies.modes.following import at_rate, mode_between
from hfsim.studies.modes.found import Mode

_CLOSE, _TRIES = 1e-3, 16
"""Relative width within which growth begins; rates tried at most."""
_MOST = 24
_End: TypeAlias = tuple[float, Mode]


@dataclass(frozen=True)
class Onset:
    """Where a mode begins to grow by itself, or ceases to.

    Attributes
    ----------
    track : int
        Number of the mode, from one on.
    rate : float
        [rad/s].
    frequency : float
        [Hz].
    above : bool
        Whether it grows above the rate, not below it.
    """

    track: int
    rate: float
    frequency: float
    above: bool

    def facts(self) -> dict[str, Any]:
        """Return its numbers."""
        where = "above" if self.above else "below"
        return {"mode": self.track, "rate": self.rate, "frequency": self.frequency, "grows": where}


def onsets(rates: Array, tracks: Sequence[Sequence[Mode | None]], start: About) -> list[Onset]:
    """Return where modes, each at all rates, begin to grow between two rates, or cease to."""
    found = list[Onset]()
    for number, track in enumerate(tracks, 1):
        for k, (first, last) in enumerate(pairwise(track)):
            if first is None or last is None or first.unstable == last.unstable or len(found) == _MOST:
                continue
            ends = (float(rates[k]), first), (float(rates[k + 1]), last)
            low, high = sorted(ends, key=lambda end: end[0])
            found.append(_interpolated(number, *_closer(low, high, start, len(tracks))))
    return sorted(found, key=lambda one: one.rate)


def _closer(low: _End, high: _End, start: About, count: int) -> tuple[_End, _End]:
    """Return rates next to where growth begins or ceases, by halves: it may set in steeply."""
    for _ in range(_TRIES):  # towards none they would never be close
        rate = 0.5 * (low[0] + high[0])
        if high[0] - low[0] <= _CLOSE * abs(rate):
            break
        try:
            state = at_rate(low[1].about, start, rate)
        except ModesError:
            break
        found = mode_between(state, rate, (low, high), count)
        if found is None:
            break
        here = rate, found[0]
        low, high = (here, high) if found[0].unstable == low[1].unstable else (low, here)
    return low, high


def _interpolated(number: int, low: _End, high: _End) -> Onset:
    a, b = low[1].growth, high[1].growth
    share = a / (a - b) if a * b < 0.0 else 0.5
    ends = zip((low[0], low[1].frequency), (high[0], high[1].frequency), strict=True)
    rate, frequency = (x + share * (y - x) for x, y in ends)
    return Onset(number, rate, frequency, high[1].unstable)
