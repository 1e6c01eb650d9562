"""Modes of a scene that turns, against the rate of its rotation: the Campbell diagram."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise, product
from typing import Any

import numpy as np

from hfsim.errors import ArgumentError
from hfsim.marching.stop import Progress, nobody
from hfsim.maths.arrays import Array, BoolArray, ComplexArray
from hfsim.studies.modes.about import About, ModesError, turning_about, turning_at
from hfsim.studies.modes.found import Mode, Modes, check_count, modes_of

ORDERS = (1, 2, 3)
"""Excitations per revolution whose lines are drawn."""
_SAME = 1e-6
"""Difference of frequencies, relative, up to which they are one."""
_ALIKE = 0.3
"""Modal assurance from which two shapes may be those of one mode."""
_NEAR = 0.2
"""Weight of the difference of frequencies, over their size, beside the assurance."""
_SPARE = 6
"""Modes looked at beyond those asked for: some drop out of the slowest."""
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
    """

    founds: tuple[Modes, ...]
    rates: Array
    tracks: tuple[tuple[Mode | None, ...], ...]
    senses: tuple[tuple[int, ...], ...]
    crossings: tuple[Crossing, ...]

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
        founds.append(modes_of(state, count + _SPARE))
        progress((k + 1) / len(wanted))
    tracks, senses = _followed(founds, count)
    steady = [found.steady for found in founds]
    tracks = tuple(
        tuple(mode if told else None for mode, told in zip(track, steady, strict=True)) for track in tracks
    )
    every = Campbell(tuple(founds), np.array(walk, dtype=float), tracks, senses, ())
    return replace(every.at(rates), crossings=tuple(_crossings(every, start)))


def _walk(rates: Sequence[float]) -> list[float]:
    """Return the rates and some that are not told, next to rest, where shapes do not yet tell modes apart."""
    found: list[float] = []
    for before, rate in pairwise((*rates[:1], *rates)):
        found += [_PARTED * before] * (rate == 0.0 != before) + [_PARTED * rate] * (before == 0.0 != rate)
        found.append(rate)
    return found


def at_rate(near: About, start: About, rate: float) -> About:
    """Return the steady rotation at a rate, sought from another one; at none, the equilibrium next to it."""
    seen = replace(near, motions=replace(near.motions, turning=start.turning))
    return turning_at(seen, rate)


def _followed(founds: Sequence[Modes], count: int) -> tuple[Any, Any]:
    """Return each mode of the first rate, and its sense, at all rates."""
    from scipy.optimize import linear_sum_assignment

    tracks: list[list[Mode | None]] = [[mode] for mode in founds[0].modes[:count] if mode.kind != "decay"]
    senses = [[1] for _ in tracks]
    last, every = [track[0] for track in tracks], all(len(one.modes) < count + _SPARE for one in founds)
    for found in founds[1:]:
        here = [mode for mode in found.modes if mode.kind != "decay"]
        unlike, turned = _unlike(found, [mode for mode in last if mode is not None], here)
        chosen = dict(zip(*(one.tolist() for one in linear_sum_assignment(unlike)), strict=True))
        for k, track in enumerate(tracks):
            j = chosen.get(k)
            # where all that a scene has is known, before and after, nothing can have come or gone
            same = j is not None and (unlike[k, j] < 1.0 - _ALIKE or (every and len(here) == len(last)))
            track.append(here[j] if j is not None and same else None)
            senses[k].append(senses[k][-1] * (-1 if j is not None and same and turned[k, j] else 1))
            last[k] = track[-1] or last[k]
    return tuple(map(tuple, tracks)), tuple(map(tuple, senses))


def _unlike(found: Modes, before: Sequence[Mode], after: Sequence[Mode]) -> tuple[Array, BoolArray]:
    """Return how unlike modes are, (n_before, n_after), in shape and a little in frequency.

    Then whether they are alike the other way round.
    """
    momentum = partial(found.about.scene.system.equations.momentum, found.about.motions.x[None])

    def weighed(shapes: ComplexArray) -> ComplexArray:
        return np.asarray(momentum(shapes.real) + 1j * momentum(shapes.imag))

    one, other = (np.array([mode.natural_frequency for mode in modes]) for modes in (before, after))
    (a, alike), (b, others) = (_shapes(modes, w, weighed) for modes, w in ((before, one), (after, other)))
    assured = (np.abs(way @ weighed(b).T) ** 2 for way in (a.conj(), a))
    same, turned = (np.minimum(alike @ way @ others, 1.0) for way in assured)
    # of changes the squares, over one size for all modes of a shape: they keep their order, also through zero
    either = np.maximum(same, turned)
    size = either @ other + either @ (either.T @ one) / either.sum(axis=1) + np.finfo(float).tiny
    apart, through = (
        np.minimum((other + sign * one[:, None]) / size[:, None], 1.0) ** 2 for sign in (-1.0, 1.0)
    )
    # the other way round it has gone through zero
    plain, other_way = (1.0 - way + _NEAR * change for way, change in ((same, apart), (turned, through)))
    way = (other_way < plain) & np.array([mode.kind in ("vibration", "flutter") for mode in after])
    return np.where(way, other_way, plain), way


def _shapes(
    modes: Sequence[Mode], frequencies: Array, weighed: Callable[[ComplexArray], ComplexArray]
) -> tuple[ComplexArray, Array]:
    """Return shapes (n, n_x) of unit size, and which modes (n, n) are of one frequency.

    Of these any mixture is a mode as well: their shapes are made orthogonal, so that assurances add up.
    """
    shapes = np.array([mode.change for mode in modes])
    apart = np.abs(frequencies[:, None] - frequencies)
    one = np.where(apart <= _SAME * np.maximum(frequencies[:, None], frequencies), 1.0, 0.0)
    for k in range(len(shapes)):
        own, before = shapes[k : k + 1], one[k, :k, None] * shapes[:k]
        for _ in range(2):  # again, for what rounding leaves where they are nearly alike
            own -= (weighed(own) @ before.conj().T) @ before
            own /= np.sqrt((own.conj() @ weighed(own).T).real + np.finfo(float).tiny)
    return shapes, one


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
        state = at_rate(near, start, rate)
        most = max(abs(mode.value) for _, mode, _, _ in ends) if turns else np.inf
        every_one = modes_of(state, len(every.tracks) + _SPARE).modes
        modes = [one for one in every_one if one.kind != "decay" and abs(one.value) <= most]
        if not modes:
            break
        unlike, turned = _unlike(Modes(state, tuple(modes), None, False), [first, last], modes)
        j = int(np.argmin([high - rate, rate - low] @ unlike))  # squares of changes: what lies between them
        mode, sense = modes[j], own * (-1 if turned[0, j] else 1)
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
