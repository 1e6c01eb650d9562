"""Numbers of a run: quantities such as ``final(arm.tip.x)``, of its rows, and of steps as they are made."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import legvander

from hfsim.deck.quantities import ALONG, Quantity
from hfsim.errors import HfsimError
from hfsim.integrators import Trajectory
from hfsim.marching.between import ROUNDING
from hfsim.marching.sampling import samples_at, table_of
from hfsim.marching.solution import Run
from hfsim.marching.turns import read_states
from hfsim.maths.arrays import Array, BoolArray, distinct, slices
from hfsim.maths.shapes import gauss_lobatto
from hfsim.parts.channels import kind_of
from hfsim.scene.build import Scene

_SAME = 1e-9
"""Share of the time between two rows, from one of which a time counts as that row's."""
_SIGNS = {"max": 1.0, "min": -1.0}
"""Quantities that are extremes."""
_MORE = 3
"""Places in a step, at first, beyond the terms of its accelerations."""
_DENSE = 8
"""Times for each place, at which the polynomial through these is looked at."""
_ROUGH, _CLOSE = 1e-4, 1e-8
"""Part of its range by which that polynomial may miss a channel: anywhere, and where its extreme may be."""
_BESIDE, _NOISE, _ROUNDING = 1e-6, 8.0, 1e-13
"""A channel is known but for some times what it changes by over such a part of a piece, and for rounding."""
_HALVINGS = 12
"""How often a step is halved at most: a jump is not found any closer."""
_NUMBERS = 1e6
"""Numbers that are computed in one go: bounds the memory that takes."""


class CollectError(HfsimError):
    """A run does not have a quantity."""

    exit_code = 3


_UNITS = {"frequency": "Hz"}
"""Units of quantities that are not of channels."""


def unit_of_quantity(quantity: Quantity) -> str:
    """Return the SI unit of a quantity; empty where it has none."""
    return kind_of(quantity.channel).unit if quantity.channel else _UNITS.get(quantity.kind, "")


def channels_of(quantities: Iterable[Quantity]) -> tuple[str, ...]:
    """Return the channels that quantities are of, each once."""
    return tuple(dict.fromkeys(one.channel for one in quantities if one.channel))


class Answer(NamedTuple):
    """What was found of one quantity.

    Attributes
    ----------
    reason : str
        Why there is no value.
    failed : bool
        Whether that is because nothing at all was found.
    """

    value: float | None
    time_error: float | None = None
    reason: str = ""
    failed: bool = False


class Collector:
    """Quantities of one run, which gives it all its steps as they are made; see `hfsim.simulate.simulate`.

    Pieces of steps, at first whole ones, are halved until the polynomial through a channel at some places of
    each is that channel: there are as many places as it needs, however long steps are and however many.
    """

    def __init__(self, quantities: Iterable[Quantity]) -> None:
        self._quantities = tuple(quantities)
        self._at = dict[Quantity, float]()
        self._along: dict[tuple[float, float] | None, _Along] | None = None

    def take(self, scene: Scene, steps: Trajectory, angles: Mapping[str, float]) -> None:
        """Take the next steps; `angles` are those of the bodies where they begin [rad]."""
        own = [one for one in self._quantities if one.channel in scene.deck.channels]
        if self._along is None:
            along = [one for one in own if one.kind in ALONG]
            windows = dict.fromkeys(one.window for one in along)
            self._along = {some: _Along([one for one in along if one.window == some]) for some in windows}
        count = _MORE + max((len(one.series) for one in steps.segments), default=0)
        room = _room(scene, count, channels_of(own))
        for stretch in _stretches(steps, room):
            reading = _Reading(scene, stretch, angles)
            for one in own:
                if one.time is not None and stretch.t_start <= one.time <= stretch.t_end:
                    self._at[one] = float(reading.at(np.array([one.time]), [one.channel])[0, 0])
            for window, part in self._along.items():
                part.follow(reading, count, room, window or (-np.inf, np.inf))
            angles = reading.angles_after()

    def value(self, quantity: Quantity, run: Run) -> float:
        """Return a quantity of the run that has given its steps, in its SI unit.

        Raises
        ------
        CollectError
            If the run has not come so far, or has no such channel.
        """
        try:
            values = run[quantity.channel]
        except KeyError as error:
            raise CollectError(str(error.args[0])) from None
        if not len(values):
            raise CollectError(f"{quantity}: the run has no rows")
        if quantity.kind == "final":
            return float(values[-1])
        if quantity.time is not None:
            return self._at_time(quantity, run, quantity.time)
        if quantity.beyond(run.end_time * (1.0 + _SAME)):
            raise CollectError(f"{quantity}: the run ends at t = {run.end_time:.6g} s")
        along = (self._along or {}).get(quantity.window)
        if along is None or not along.time:
            raise CollectError(f"{quantity}: no step was made")
        return along.value(quantity)

    def answer(self, quantity: Quantity, run: Run) -> Answer:
        """Return the same, or why there is none."""
        try:
            return Answer(self.value(quantity, run))
        except CollectError as error:
            return Answer(None, reason=str(error))

    def _at_time(self, quantity: Quantity, run: Run, time: float) -> float:
        """Return the value at a time: a row's, else what the steps had there."""
        row = int(np.abs(run.t - time).argmin())
        if abs(run.t[row] - time) <= _SAME * max(run.end_time, time) / max(1, len(run.t) - 1):
            return float(run[quantity.channel][row])
        if quantity not in self._at:
            raise CollectError(f"{quantity}: the run ends at t = {run.end_time:.6g} s")
        return self._at[quantity]


class _Along:
    """Channels along the steps so far, or a window of time: their ranges, extremes and integrals."""

    def __init__(self, quantities: Sequence[Quantity]) -> None:
        self.names = channels_of(quantities)
        self._extremes = [one for one in quantities if one.kind in _SIGNS]
        self._columns = [self.names.index(one.channel) for one in self._extremes]
        self._signs = np.array([_SIGNS[one.kind] for one in self._extremes])
        self._most = np.full(len(self._extremes), -np.inf)
        """Extremes, smallest ones upside down."""
        self._range = np.array([[np.inf], [-np.inf]]) * np.ones(len(self.names))
        self._sums, self._squares = np.zeros((2, len(self.names)))
        self.time = 0.0

    def value(self, quantity: Quantity) -> float:
        """Return an extreme, a mean, or the root of a mean square."""
        if quantity.kind in _SIGNS:
            found = self._signs * self._most
            return float(found[self._extremes.index(quantity)])
        k = self.names.index(quantity.channel)
        if quantity.kind == "mean":
            return float(self._sums[k] / self.time)
        return float(np.sqrt(self._squares[k] / self.time))

    def follow(self, reading: _Reading, count: int, room: int, window: tuple[float, float]) -> None:
        """Follow the channels along steps, with `count` places in each piece, `room` pieces at a time."""
        ends = np.unique(np.clip(reading.steps.step_ends(), *window))
        waiting = [(ends[:-1], np.diff(ends), _HALVINGS)] if len(ends) > 1 else []
        while waiting:
            begin, length, left = waiting.pop()
            if len(begin) > room:
                waiting += [(begin[some], length[some], left) for some in slices(len(begin), room)]
                continue
            again = self._look(reading, begin, length, count, last=not left)
            if again.any():
                half = 0.5 * length[again, None]
                both = begin[again, None] + half * [0.0, 1.0]
                waiting.append((both.ravel(), np.repeat(half, 2), left - 1))

    def _look(self, reading: _Reading, begin: Array, length: Array, count: int, last: bool) -> BoolArray:
        """Look at pieces of steps; return which of them tell nothing, as they have to be halved first."""
        places, fit, dense = _polynomials(count)
        values = reading.at((begin[:, None] + length[:, None] * places).ravel(), self.names)
        values = values.reshape(len(begin), len(places), -1)
        series = fit @ values
        missed, curves = np.abs(series[:, -2:]).sum(axis=1), self._upright(dense @ series)
        self._note(values)
        high = curves.max(axis=1, initial=-np.inf) + missed[:, self._columns] > self._most
        again = self._unclear(missed, self._known(values, count // 2), high) & (not last)
        norms = 1.0 / (2.0 * np.arange(count) + 1.0)
        self.time += float(length[~again].sum())
        self._sums += length[~again] @ series[~again, 0]
        self._squares += np.einsum("p,k,pkc->c", length[~again], norms, series[~again] ** 2)
        piece, which = np.nonzero(high & ~again[:, None])
        tops = begin[piece] + length[piece] * _tops(curves[piece, :, which])
        for k in distinct(which).tolist():
            times = np.sort(tops[which == k])
            found = reading.at(times, [self.names[self._columns[k]]])
            self._most[k] = max(self._most[k], float((self._signs[k] * found).max()))
        return again

    def _upright(self, values: Array) -> Array:
        """Return of values (..., n_names) those whose extremes are wanted, upside down for smallest ones."""
        return np.asarray(self._signs * values[..., self._columns])

    def _note(self, values: Array) -> None:
        """Note ranges and extremes of values (n_pieces, n_places, n_names)."""
        self._range[0] = np.minimum(self._range[0], values.min(axis=(0, 1)))
        self._range[1] = np.maximum(self._range[1], values.max(axis=(0, 1)))
        self._most = np.maximum(self._most, self._upright(values).max(axis=(0, 1)))

    def _known(self, values: Array, middle: int) -> Array:
        """Return how well values are known, (n_pieces, n_names): what hardly changes is rounding."""
        beside = np.abs(values[:, middle + 1] - values[:, middle])
        known = np.maximum(_NOISE * beside, _ROUNDING * np.abs(values).max(axis=1))
        still = np.ptp(self._range, axis=0) <= ROUNDING * np.abs(self._range).max(axis=0)
        return np.where(still, np.inf, known)

    def _unclear(self, missed: Array, known: Array, high: BoolArray) -> BoolArray:
        """Return in which pieces polynomials miss too much, (n_pieces,); less is where an extreme may be."""
        size = np.ptp(self._range, axis=0)
        rough, close = (missed > np.maximum(part * size, known) for part in (_ROUGH, _CLOSE))
        return np.asarray(rough.any(axis=1) | (high & close[:, self._columns]).any(axis=1))


class _Reading:
    """Steps, and channels read from them; `angles` of the bodies where they begin [rad]."""

    def __init__(self, scene: Scene, steps: Trajectory, angles: Mapping[str, float]) -> None:
        self.scene, self.steps, self._angles = scene, steps, angles

    def at(self, times: Array, names: Sequence[str]) -> Array:
        """Return some channels at sorted times within the steps, shape (n_times, n_names)."""
        return table_of(samples_at(self.scene, self.steps, times, self._angles), names)[:, 1:]

    def angles_after(self) -> Mapping[str, float]:
        """Return the angles where the steps end [rad]."""
        turns = read_states(self.scene, self.steps, np.array([self.steps.t_end]), self._angles)[2]
        return {**self._angles, **{name: float(angles[-1]) for name, angles in turns.items()}}


def _stretches(steps: Trajectory, most: int) -> Iterator[Trajectory]:
    """Yield so many steps at a time."""
    ends = [*steps.segments, steps]
    t = steps.step_ends().tolist()
    for some in slices(len(steps.segments), most):
        end = ends[some.stop]
        yield steps.part(some, t[some.stop], end.q, end.v)


def _room(scene: Scene, count: int, names: Sequence[str]) -> int:
    """Return how many pieces are looked at in one go."""
    return max(1, int(_NUMBERS / (count * (scene.system.n + _DENSE * len(names)))))


@lru_cache(maxsize=64)
def _polynomials(count: int) -> tuple[Array, Array, Array]:
    """Return places in a piece, 0 to 1, what fits Legendre polynomials to them, and these evenly spaced.

    There are so many places, both ends among them, and one more close to one in the middle.
    """
    places, middle = gauss_lobatto(count)[0], count // 2
    fit = np.linalg.inv(legvander(2.0 * places - 1.0, count - 1))
    beside = np.insert(places, middle + 1, places[middle] + _BESIDE)
    dense = legvander(np.linspace(-1.0, 1.0, _DENSE * count + 1), count - 1)
    return beside, np.insert(fit, middle + 1, 0.0, axis=1), dense


def _tops(curves: Array) -> Array:
    """Return where curves (n_curves, n_times), evenly spaced from 0 to 1, have their tops, (n_curves,)."""
    last = curves.shape[1] - 1
    best = np.clip(curves.argmax(axis=1), 1, last - 1)
    before, top, after = (np.take_along_axis(curves, best[:, None] + k, axis=1)[:, 0] for k in (-1, 0, 1))
    bend = 2.0 * top - before - after
    shift = np.divide(0.5 * (after - before), bend, out=np.zeros(len(bend)), where=bend > 0.0)
    return np.asarray(np.clip((best + shift) / last, 0.0, 1.0))
