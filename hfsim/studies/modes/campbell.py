"""Modes of a scene that turns, against the rate of its rotation: the Campbell diagram."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from typing import Any

import numpy as np

from hfsim.errors import ArgumentError
from hfsim.marching.stop import Progress, nobody
from hfsim.maths.arrays import Array
from hfsim.studies.modes.about import About, ModesError, turning_about
from hfsim.studies.modes.following import SPARE, at_rate, followed, mode_between
from hfsim.studies.modes.found import Mode, Modes, check_count, modes_of
from hfsim.studies.modes.growth import Onset, onsets

ORDERS = (1, 2, 3)
"""Excitations per revolution whose lines are drawn."""
_CLOSE, _TRIES = 1e-6, 6
"""Relative width to which crossings are located; rates tried for one at most."""
_AT = 1e-2
"""Difference of a frequency from its excitation, relative to the rate, up to which they meet there."""
_MOST_CROSSINGS = 24
_PARTED = 1e-3
"""Of the next rate: where frequencies that are equal at rest have parted."""


@dataclass(frozen=True)
class Crossing:
    """Where a mode is excited so many times a revolution, or is turned into a divergence.

    Attributes
    ----------
    track : int
        Number of the mode, from one on.
    order : int
        Times per revolution; 0 where the frequency becomes zero.
    rate : float
        [rad/s].
    frequency : float
        [Hz].
    """

    track: int
    order: int
    rate: float
    frequency: float

    def facts(self) -> dict[str, Any]:
        """Return its numbers."""
        return {"mode": self.track, "order": self.order, "rate": self.rate, "frequency": self.frequency}


@dataclass(frozen=True, eq=False)
class Campbell:
    """Modes at several rates.

    Attributes
    ----------
    founds : tuple of Modes
        One at each rate.
    rates : ndarray, shape (n,)
        [rad/s].
    tracks : tuple of tuple of Mode or None
        Each mode at all rates, followed by its shape; None where it was lost, and at `unsteady` rates.
    senses : tuple of tuple of int
        Minus one from where it goes round the other way, its frequency having gone through zero.
    crossings : tuple of Crossing
        From slow to fast.
    onsets : tuple of Onset
        Likewise.
    """

    founds: tuple[Modes, ...]
    rates: Array
    tracks: tuple[tuple[Mode | None, ...], ...]
    senses: tuple[tuple[int, ...], ...]
    crossings: tuple[Crossing, ...]
    onsets: tuple[Onset, ...] = ()

    @property
    def unsteady(self) -> list[float]:
        """Rates at which there is no steady rotation, and no frequencies are those of one [rad/s]."""
        every = zip(self.rates.tolist(), self.founds, strict=True)
        return [rate for rate, found in every if not found.steady]

    @property
    def view(self) -> str:
        """From which axes they are seen, in words."""
        turn = any(found.about.axes_turn for found in self.founds)
        return f"seen from axes {'that turn' if turn else 'at rest'}"

    def at(self, rates: Sequence[float]) -> Campbell:
        """Return what is known at some of the rates."""
        some = [self.rates.tolist().index(rate) for rate in rates]
        tracks, senses = (
            tuple(tuple(one[k] for k in some) for one in every) for every in (self.tracks, self.senses)
        )
        founds = tuple(self.founds[k] for k in some)
        return replace(self, founds=founds, rates=self.rates[some], tracks=tracks, senses=senses)

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each mode at each rate."""
        return [
            {"rate": float(rate), **mode.facts(), "mode": number}
            for number, track in enumerate(self.tracks, 1)
            for rate, mode in zip(self.rates, track, strict=True)
            if mode is not None
        ]

    def frequencies(self, number: int) -> Array:
        """Return those of a mode, by its number from one on, at all rates [Hz]; NaN where it is None."""
        if not 1 <= number <= len(self.tracks):
            raise ArgumentError(f"there is no mode {number}: they are numbered from 1 to {len(self.tracks)}")
        track = self.tracks[number - 1]
        return np.array([np.nan if mode is None else mode.frequency for mode in track])

    def facts(self) -> dict[str, Any]:
        """Return all that is known, as plain data."""
        first = self.founds[0].facts()
        return {
            "status": "done",
            **{key: first[key] for key in ("name", "model", "unknowns", "multipliers")},
            "about": {"state": "steady", "rates": self.rates.tolist()},
            "complete": [found.complete for found in self.founds],
            "unsteady_rates": self.unsteady,
            "crossings": [one.facts() for one in self.crossings],
            "onsets": [one.facts() for one in self.onsets],
            "unstable": [
                {"mode": number, "rate": float(rate), "kind": mode.kind, "growth_rate": mode.growth}
                for number, track in enumerate(self.tracks, 1)
                for rate, mode in zip(self.rates, track, strict=True)
                if mode is not None and mode.unstable
            ],
            "modes": self.rows(),
        }


def campbell(
    start: About, rates: Sequence[float], count: int, progress: Progress = nobody
) -> Campbell:
    """Return the modes about steady rotations at several rates.

    Parameters
    ----------
    start : About
        A state that turns about the axis.
    rates : sequence of float
        [rad/s].
    count : int
        Modes followed.

    Raises
    ------
    ArgumentError
        If no mode or rate is wanted.
    ModesError
        If nothing turns, or at some rate no steady rotation is found.
    """
    check_count(count)
    if not len(rates) or not np.isfinite(rates).all():
        raise ArgumentError(f"rates are {list(rates)}: one at least has to be wanted, and all are numbers")
    walk, founds, wanted = list[float](), list[Modes](), _walk(rates)
    start = state = turning_about(start)
    for k, rate in enumerate(wanted):
        try:
            state = at_rate(state, start, rate)
        except ModesError:
            if rate in rates:
                raise
            continue
        walk.append(rate)
        founds.append(modes_of(state, count + SPARE))
        progress((k + 1) / len(wanted))
    tracks, senses = followed(founds, count)
    steady = [found.steady for found in founds]
    tracks = tuple(
        tuple(mode if told else None for mode, told in zip(track, steady, strict=True)) for track in tracks
    )
    every = Campbell(tuple(founds), np.array(walk, dtype=float), tracks, senses, ())
    crossed, grown = _crossings(every, start), onsets(every.rates, tracks, start)
    return replace(every.at(rates), crossings=tuple(crossed), onsets=tuple(grown))


def _walk(rates: Sequence[float]) -> list[float]:
    """Return the rates and some that are not told, next to rest, where shapes do not yet tell modes apart."""
    found: list[float] = []
    for before, rate in pairwise((*rates[:1], *rates)):
        found += [_PARTED * before] * (rate == 0.0 != before) + [_PARTED * rate] * (before == 0.0 != rate)
        found.append(rate)
    return found


# --- crossings --------------------------------------------------------------------------------------


def _beyond(mode: Mode, order: int, rate: float, sense: int = 0) -> float:
    """Return by how much the square of a frequency is above that of an excitation; below zero after it.

    Where the mode goes round the other way after it, the frequency in its first sense.
    """
    if sense:
        return sense * mode.value.imag
    return float(-(mode.value**2).real - (order * rate) ** 2)


def _powered(rate: float, power: float) -> float:
    """Return a power of a rate, with its sign."""
    return math.copysign(abs(rate) ** power, rate)


def _crossings(every: Campbell, start: About) -> list[Crossing]:
    found: list[Crossing] = []
    for number, track in enumerate(every.tracks, 1):
        for k, order in product(range(len(every.rates) - 1), (0, *ORDERS)):
            pair = track[k], track[k + 1]
            if any(mode is None or mode.free for mode in pair) or len(found) >= _MOST_CROSSINGS:
                continue
            located = _located(every, start, number, order, k)
            if located is not None:
                found.append(located)
    return sorted(found, key=lambda one: one.rate)


def _located(every: Campbell, start: About, number: int, order: int, k: int) -> Crossing | None:
    """Return where a mode crosses between two rates, by false position; None where it does not."""
    track, senses = every.tracks[number - 1], every.senses[number - 1][k : k + 2]
    turns = order == 0 and senses[0] != senses[1]
    ends = [
        (float(every.rates[j]), mode, every.founds[j].about, senses[j - k] if turns else 0)
        for j in (k, k + 1)
        if (mode := track[j]) is not None
    ]
    values = [_beyond(mode, order, rate, sense) for rate, mode, _, sense in ends]
    if len(ends) < 2 or not values[0] * values[1] < 0.0:
        return None
    power, rate, kept, frequency = 1 if turns else 2, ends[0][0], -1, 0.0
    for _ in range(_TRIES):
        (low, first, near, own), (high, last, _, _) = ends
        a, b = values
        between = (_powered(low, power) * b - _powered(high, power) * a) / (b - a)
        before, rate = rate, _powered(between, 1.0 / power)
        most = max(abs(mode.value) for _, mode, _, _ in ends) if turns else np.inf
        state = at_rate(near, start, rate)
        found = mode_between(state, rate, ((low, first), (high, last)), len(every.tracks), most)
        if found is None:
            break
        mode, sense = found[0], own * (-1 if found[1] else 1)
        here, frequency = _beyond(mode, order, rate, sense), mode.frequency
        if abs(rate - before) <= _CLOSE * abs(rate) or not here or not mode.value:
            break
        which = 0 if here * a > 0.0 else 1
        ends[which], values[which] = (rate, mode, state, sense), here
        # an end that stays counts for half, or it would stay for ever
        values[1 - which] *= 0.5 if which == kept else 1.0
        kept = which
    at_all = abs(2.0 * np.pi * frequency - order * abs(rate)) <= _AT * abs(rate)
    return Crossing(number, order, rate, frequency) if at_all else None
