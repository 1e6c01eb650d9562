"""Modes of a scene that turns, against the rate of its rotation: the Campbell diagram."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import accumulate, pairwise, product
from typing import Any, TypeAlias, TypeVar

import numpy as np

from hfsim.errors import ArgumentError
from hfsim.marching.stop import Progress, nobody
from hfsim.maths.arrays import Array, ComplexArray
from hfsim.studies.modes.about import turning_about
from hfsim.studies.modes.following import Followed, Steady, mode_between
from hfsim.studies.modes.found import Mode, Modes, check_count
from hfsim.studies.modes.growth import Onset, onsets
from hfsim.studies.modes.state import About, ModesError

ORDERS = (1, 2, 3)
"""Excitations per revolution whose lines are drawn."""
_CLOSE, _TRIES = 1e-6, 12
"""Relative width to which crossings are located; rates tried for one at most."""
_AT = 1e-2
"""Difference of a frequency from its excitation, relative to the rate, up to which they meet there."""
_MOST_CROSSINGS = 24
_ONE = 1e-8
"""Difference of eigenvalues, relative, that is rounding."""
_PARTED = 1e-3
"""Of the next rate: where frequencies that are equal at rest have parted."""

_End: TypeAlias = tuple[float, Mode, int]
_T = TypeVar("_T")


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
        Each mode at all rates, followed by its shape, and what else grows at any; None where it is not known,
        and at `unsteady` rates.
    senses : tuple of tuple of int
        Minus one from where it goes round the other way, its frequency having gone through zero.
    guesses : tuple of tuple of int
        How often so far it could but be guessed what it has become, however close rates were looked at.
    crossings : tuple of Crossing
        From slow to fast.
    onsets : tuple of Onset
        Likewise.
    missed : dict of float to str
        Rates, asked for or between, that are left out as no steady rotation was found there, and why [rad/s].
    """

    founds: tuple[Modes, ...]
    rates: Array
    tracks: tuple[tuple[Mode | None, ...], ...]
    senses: tuple[tuple[int, ...], ...]
    guesses: tuple[tuple[int, ...], ...]
    crossings: tuple[Crossing, ...] = ()
    onsets: tuple[Onset, ...] = ()
    missed: dict[float, str] = field(default_factory=dict)

    @property
    def unsteady(self) -> list[float]:
        """Rates at which there is no steady rotation, and no frequencies are those of one [rad/s]."""
        every = zip(self.rates.tolist(), self.founds, strict=True)
        return [rate for rate, found in every if not found.steady]

    @property
    def unstable_ranges(self) -> list[tuple[float, float]]:
        """Rates from and to which something grows, by the rates told and the onsets between them [rad/s]."""
        ranges = list[tuple[float, float]]()
        for j, k in pairwise(np.argsort(self.rates, kind="stable").tolist()):
            low, high = float(self.rates[j]), float(self.rates[k])
            here = [one for one in self.onsets if low <= one.rate < high]
            number = sum(bool((mode := track[j]) and mode.unstable) for track in self.tracks)
            numbers = accumulate((1 if one.above else -1 for one in here), initial=number)
            ends = pairwise((low, *(one.rate for one in here), high))
            for (begin, end), grow in zip(ends, numbers, strict=True):
                if grow > 0 and ranges and ranges[-1][1] == begin:
                    begin = ranges.pop()[0]
                if grow > 0:
                    ranges.append((begin, end))
        return ranges

    @property
    def view(self) -> str:
        """From which axes they are seen, in words."""
        turn = any(found.about.axes_turn for found in self.founds)
        return f"seen from axes {'that turn' if turn else 'at rest'}"

    def at(self, rates: Sequence[float]) -> Campbell:
        """Return what is known at some of the rates."""
        some = [self.rates.tolist().index(rate) for rate in rates]
        founds, tracks = tuple(self.founds[k] for k in some), _places(self.tracks, some)
        senses, guesses = _places(self.senses, some), _places(self.guesses, some)
        every = founds, self.rates[some], tracks, senses, guesses
        return Campbell(*every, self.crossings, self.onsets)

    @property
    def guessed(self) -> list[dict[str, Any]]:
        """Rates between which it is not sure what a mode has become, and whether it is lost there."""
        rates = self.rates.tolist()
        return [
            {"mode": number, "from": rates[j], "to": rates[j + 1], "lost": track[j + 1] is None}
            for number, (track, often) in enumerate(zip(self.tracks, self.guesses, strict=True), 1)
            for j, (before, after) in enumerate(pairwise(often))
            if before < after
        ]

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
            "missed_rates": sorted(self.missed),
            "guessed": self.guessed,
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
        If nothing turns, or no steady rotation is found at any rate.
    """
    check_count(count)
    if not len(rates) or not np.isfinite(rates).all():
        raise ArgumentError(f"rates are {list(rates)}: one at least has to be wanted, and all are numbers")
    start, wanted = turning_about(start), _walk(rates)
    steady = Steady(start, count)
    follow = Followed(steady)
    for k, rate in enumerate(wanted):
        with suppress(ModesError):  # what is missed is told
            follow.reach(rate, start)
        progress((k + 1) / len(wanted))
    rates = [rate for rate in rates if rate not in steady.missed]
    if not rates:
        raise ModesError(next(iter(steady.missed.values())))
    walk, at = np.array(follow.rates, dtype=float), range(len(follow.rates))
    senses, guesses = _places(follow.senses, at), _places(follow.guesses, at)
    every = Campbell(tuple(follow.founds), walk, _places(follow.tracks, at), senses, guesses)
    every = _told(every, rates)
    crossings = _crossings(every, steady)
    # what grows at a rate at which a crossing was sought is known by now
    grown = onsets(every.rates, every.founds, every.tracks, steady)
    critical = [Crossing(one.track, 0, one.rate, 0.0) for one in grown if one.critical]
    crossed = sorted([*crossings, *critical], key=lambda one: one.rate)
    found, missed = every.at(rates), dict(sorted(steady.missed.items()))
    return replace(found, crossings=tuple(crossed), onsets=tuple(grown), missed=missed)


def _places(every: Sequence[Sequence[_T]], some: Sequence[int]) -> tuple[tuple[_T, ...], ...]:
    """Return what each has at some places."""
    return tuple(tuple(one[k] for k in some) for one in every)


def _told(every: Campbell, rates: Sequence[float]) -> Campbell:
    """Return the same without modes at rates that are not steady, and without those that only decay.

    What decays at first comes after what swings.
    """
    at = [found.steady for found in every.founds]
    tracks = [
        tuple(mode if steady else None for mode, steady in zip(track, at, strict=True))
        for track in every.tracks
    ]
    seen = replace(every, tracks=tuple(tracks)).at(rates).tracks
    kept = [k for k, track in enumerate(seen) if any(mode and mode.kind != "decay" for mode in track)]
    swings = [bool((first := track[0]) and first.kind != "decay") for track in tracks]
    kept.sort(key=lambda k: not swings[k])
    senses, guesses = (tuple(one[k] for k in kept) for one in (every.senses, every.guesses))
    return replace(every, tracks=tuple(tracks[k] for k in kept), senses=senses, guesses=guesses)


def _walk(rates: Sequence[float]) -> list[float]:
    """Return the rates and some that are not told, next to rest, where shapes do not yet tell modes apart."""
    found: list[float] = []
    for before, rate in pairwise((*rates[:1], *rates)):
        turning = [one for one in (before, rate) if one and before * rate <= 0.0]
        found += [math.copysign(_PARTED * min(map(abs, turning)), one) for one in turning]
        found.append(rate)
    return found


# --- crossings --------------------------------------------------------------------------------------


def _beyond(mode: Mode, order: int, rate: float, sense: int = 0) -> float:
    """Return by how much the square of a frequency is above that of an excitation; below zero after it.

    Where the mode goes round the other way after it, the frequency in its first sense.
    """
    return sense * mode.value.imag if sense else float(mode.value.imag**2 - (order * rate) ** 2)


def _powered(rate: float, power: float) -> float:
    """Return a power of a rate, with its sign."""
    return math.copysign(abs(rate) ** power, rate)


def _crossings(every: Campbell, steady: Steady) -> list[Crossing]:
    """Return where modes are excited or go round the other way; where one goes away is not among them."""
    found: list[Crossing] = []
    twins: dict[tuple[int, int], list[tuple[ComplexArray, Crossing | None]]] = {}
    numbers = range(1, len(every.tracks) + 1)
    for number, k, order in product(numbers, range(len(every.rates)), (0, *ORDERS)):
        if len(found) >= _MOST_CROSSINGS:
            break
        located = _met(every, number, order, k)
        ends = () if located else _ends(every, number, order, k)
        if ends:
            # modes that are one at both ends, as of equal blades, are located once
            values = np.array([mode.value for _, mode, _ in ends])
            alike = twins.setdefault((k, order), [])
            known = [one for other, one in alike if np.allclose(values, other, rtol=_ONE, atol=0.0)]
            located = known[0] if known else _located(ends, number, order, steady)
            alike.append((values, located))
        found += [] if located is None else [replace(located, track=number)]
    return found


def _ends(every: Campbell, number: int, order: int, k: int) -> tuple[_End, ...]:
    """Return a mode at two rates between which it crosses, with its senses; nothing where it does not."""
    track, senses = every.tracks[number - 1], every.senses[number - 1]
    ends = tuple(
        (float(every.rates[j]), mode, 0 if order else senses[j])
        for j in range(k, min(k + 2, len(track)))
        if (mode := track[j]) is not None and not mode.free
    )
    values = [_beyond(mode, order, rate, sense) for rate, mode, sense in ends]
    return ends if len(ends) == 2 and values[0] * values[1] < 0.0 else ()


def _met(every: Campbell, number: int, order: int, k: int) -> Crossing | None:
    """Return a crossing at just one of the rates."""
    track, rate = every.tracks[number - 1], float(every.rates[k])
    mode, beside = track[k], [one for one in (*track[max(0, k - 1) : k], *track[k + 1 : k + 2]) if one]
    if mode is None or not rate:
        return None
    lost = mode.free and beside and not any(one.free for one in beside)
    met = not mode.free and not _beyond(mode, order, rate) if order else lost
    return Crossing(number, order, rate, mode.frequency) if met else None


def _located(between: Sequence[_End], number: int, order: int, steady: Steady) -> Crossing | None:
    """Return where a mode crosses between two rates, by false position; None where it does not."""
    ends = list(between)
    values = [_beyond(mode, order, rate, sense) for rate, mode, sense in ends]
    slow = _CLOSE * max(abs(rate) for rate, _, _ in ends)
    power, rate, kept, frequency = 2 if order else 1, ends[0][0], -1, 0.0
    for _ in range(_TRIES):
        (low, first, own), (high, last, _) = ends
        a, b = values
        middle = (_powered(low, power) * b - _powered(high, power) * a) / (b - a)
        before, rate = rate, _powered(middle, 1.0 / power)
        most = np.inf if order else max(abs(first.value), abs(last.value))
        modes = steady.maybe_at(rate, first.about)
        if modes is None:
            return None
        found = mode_between(modes, rate, ((low, first), (high, last)), most)
        if found is None:
            break
        if not order and (found[0].kind == "divergence" or _goes_away(modes, between, steady)):
            return None
        mode, sense = found[0], own * (-1 if found[1] else 1)
        here, frequency = _beyond(mode, order, rate, sense), mode.frequency
        if abs(rate - before) <= _CLOSE * abs(rate) or not here or not mode.value:
            break
        which = 0 if here * a > 0.0 else 1
        ends[which], values[which] = (rate, mode, sense), here
        # an end that stays counts for half, or it would stay for ever
        values[1 - which] *= 0.5 if which == kept else 1.0
        kept = which
    # what only decays at rest goes round with the axes: no frequency is lost there
    at_all = slow < abs(rate) and abs(2.0 * np.pi * frequency - order * abs(rate)) <= _AT * abs(rate)
    return Crossing(number, order, rate, frequency) if at_all else None


def _goes_away(modes: Modes, ends: Sequence[_End], steady: Steady) -> bool:
    """Tell whether more goes away at a rate than at those on either side: that is where it grows."""
    beside = (steady.at(rate, mode.about) for rate, mode, _ in ends)
    here, *others = (sum(mode.kind == "divergence" for mode in one) for one in (modes, *beside))
    return here > max(others)
