"""Numbers of a run: quantities such as ``final(arm.tip.x)``, read from its rows and from its steps."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from hfsim.deck.quantities import Quantity
from hfsim.errors import HfsimError
from hfsim.marching.between import ROUNDING
from hfsim.marching.solution import Run
from hfsim.maths.arrays import Array, cumulative
from hfsim.maths.shapes import gauss_legendre
from hfsim.parts.channels import kind_of

_SAME = 1e-9
"""Share of the time between two rows, from one of which a time counts as that row's."""
_CLOSER = 17
"""Times that are looked at around an extreme; a parabola goes through the last."""
_ROUNDS = 2
"""How often, where it is not where the curve as it is drawn has it."""
_INSIDE = 4
"""Gauss points between two times."""
_SIGNS = {"max": 1.0, "min": -1.0}
"""Quantities that are extremes."""


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


def collect(quantity: Quantity, run: Run) -> float:
    """Return a quantity of a run that has its steps (``run.fine``) or at least its rows, in its SI unit.

    Raises
    ------
    CollectError
        If the run has not come so far, or has no such channel.
    """
    return collect_all([quantity], run)[0]


def collect_all(quantities: Sequence[Quantity], run: Run) -> list[float]:
    """Return several quantities of a run; see `collect`."""
    sought = [one for one in quantities if one.kind in _SIGNS]
    extremes = iter(_extremes(sought, run) if sought else ())
    return [next(extremes) if one.kind in _SIGNS else _plain(one, run) for one in quantities]


def _plain(quantity: Quantity, run: Run) -> float:
    values = _values(quantity, run)
    if quantity.kind == "final":
        return float(values[-1])
    if quantity.time is not None:
        return _at(quantity, run, quantity.time)
    seen = run.drawn
    return _root_of_mean_square(quantity, run, seen.t, seen[quantity.channel])


def _values(quantity: Quantity, run: Run) -> Array:
    """Return the rows of a channel."""
    try:
        values = run[quantity.channel]
    except KeyError as error:
        raise CollectError(str(error.args[0])) from None
    if not len(values):
        raise CollectError(f"{quantity}: the run has no rows")
    return values


def _at(quantity: Quantity, run: Run, time: float) -> float:
    """Return the value at a time: a row's, else what the steps have there."""
    row = int(np.abs(run.t - time).argmin())
    if abs(run.t[row] - time) <= _SAME * max(run.end_time, time) / max(1, len(run.t) - 1):
        return float(run[quantity.channel][row])
    if time > run.end_time:
        raise CollectError(f"{quantity}: the run ends at t = {run.end_time:.6g} s")
    if run.fine is None:
        raise CollectError(f"{quantity}: there is no row at this time")
    return float(_between(quantity, run, np.array([time]))[0])


def _between(quantity: Quantity, run: Run, times: Array) -> Array:
    """Return a channel at sorted times, (n_times,), read from the steps."""
    assert run.fine is not None
    return np.asarray(run.fine.at(times, [quantity.channel])[:, 0])


def _root_of_mean_square(quantity: Quantity, run: Run, t: Array, values: Array) -> float:
    """Return it from Gauss points between the times, where there are steps to read."""
    if len(t) < 2:
        return float(abs(values[0]))
    if run.fine is None:
        return float(np.sqrt(cumulative(values**2, t)[-1] / (t[-1] - t[0])))
    places, weights = gauss_legendre(_INSIDE)
    inside = _between(quantity, run, (t[:-1, None] + np.diff(t)[:, None] * places).ravel())
    squares = (inside**2).reshape(-1, _INSIDE) @ weights
    return float(np.sqrt(squares @ np.diff(t) / (t[-1] - t[0])))


def _extremes(quantities: Sequence[Quantity], run: Run) -> list[float]:
    """Return largest and smallest values: between the steps' curves ever closer, all of them at once."""
    for one in quantities:
        _values(one, run)
    humps = _Humps(quantities, run)
    if run.fine is not None and len(humps.t) > 2:
        first = [(k, int(np.argmax(curve))) for k, curve in enumerate(humps.curves)]
        humps.climb(first)
        humps.climb([one for one in humps.reaching() if one not in first])
    return [sign * value for sign, value in zip(humps.signs, humps.most, strict=True)]


class _Humps:
    """Curves, upside down for smallest values, their tops between the times they are known at, and the most.

    A hump is the number of a curve and that of the time at its top.
    """

    def __init__(self, quantities: Sequence[Quantity], run: Run) -> None:
        self.quantities, self.run = quantities, run
        self.t, channels = (run.t, run.channels) if run.fine is None else run.fine.rough
        seen = {one.name: one.values for one in channels}
        self.signs = [_SIGNS[one.kind] for one in quantities]
        self.curves = [sign * seen[one.channel] for sign, one in zip(self.signs, quantities, strict=True)]
        self.most = [float(curve.max()) for curve in self.curves]

    def reaching(self) -> list[tuple[int, int]]:
        """Return the humps that may rise above the most between the times.

        A parabola rises by an eighth of how far it falls to the farther neighbour, and an edge by half of it.
        """
        found = list[tuple[int, int]]()
        for k, curve in enumerate(self.curves):
            falls = np.diff(curve, prepend=curve[0]), -np.diff(curve, append=curve[-1])
            top = (falls[0] >= 0.0) & (falls[1] >= 0.0)
            fall = np.maximum(*falls)
            high = top & (fall > 0.0) & (curve + 0.5 * fall > self.most[k])
            found += [(k, one) for one in np.flatnonzero(high).tolist()]
        return found

    def climb(self, humps: Sequence[tuple[int, int]]) -> None:
        """Look for the tops of humps ever closer."""
        t, spans = self.t, [_near(self.t, self.curves[k], top) for k, top in humps]
        some = [n for n, (low, high) in enumerate(spans) if low < high]
        times, values, best = self._look([humps[n][0] for n in some], np.array([spans[n] for n in some]))
        ends = float(t[0]), float(t[-1])
        last = [n for n, k in enumerate(best) if k in (0, _CLOSER - 1) and times[n, k] not in ends]
        missed = [humps[some[n]] for n in last if np.ptp(values[n]) > 0.0]  # it climbs where looking ended
        at = np.array([_around(t, top) for _, top in missed])
        for _ in range(_ROUNDS if missed else 0):
            times, _, best = self._look([k for k, _ in missed], at)
            at = np.array([_around(own, place) for own, place in zip(times, best, strict=True)])

    def _look(self, which: Sequence[int], at: Array) -> tuple[Array, Array, list[int]]:
        """Look at curves between some times; return these, the curves there, and where each is largest."""
        if not which:
            return at, at, []
        times = np.linspace(at[:, 0], at[:, 1], _CLOSER, axis=1)
        values = _read_each([self.quantities[k] for k in which], self.run, times)
        values *= np.array([self.signs[k] for k in which])[:, None]
        best: list[int] = values.argmax(axis=1).tolist()
        for k, here, place in zip(which, values, best, strict=True):
            self.most[k] = max(self.most[k], _peak(here, place))
        return times, values, best


def _read_each(quantities: Sequence[Quantity], run: Run, times: Array) -> Array:
    """Return the channel of each quantity at times of its own, (n_quantities, n_times)."""
    assert run.fine is not None
    names = channels_of(quantities)
    every, place = np.unique(times, return_inverse=True)
    columns = np.array([names.index(one.channel) for one in quantities])
    return np.asarray(run.fine.at(every, names)[place.reshape(times.shape), columns[:, None]])


def _near(times: Array, curve: Array, top: int) -> tuple[float, float]:
    """Return times about the top of the parabola through the largest value of a curve and its neighbours.

    They are the same where there is nothing to look for between them: where the curve is constant but for
    rounding, or has its largest value at an end, and the parabola its top well beyond.
    """
    three = slice(k := min(max(top - 1, 0), len(times) - 3), k + 3)
    (before, at, after), (low, middle, high) = times[three].tolist(), curve[three].tolist()
    rise, fall = (middle - low) / (at - before), (high - middle) / (after - at)
    if rise <= fall or np.ptp(curve) <= ROUNDING * np.abs(curve).max():
        return at, at
    peak = 0.5 * (before + at) + 0.5 * (after - before) * rise / (rise - fall)
    width = (after - before) / _CLOSER
    return min(max(before, peak - width), after), max(min(after, peak + width), before)


def _peak(values: Array, best: int) -> float:
    """Return the top of the parabola through the largest of values that are evenly apart."""
    if not 0 < best < len(values) - 1:
        return float(values[best])
    before, top, after = values[best - 1 : best + 2]
    bend = 2.0 * top - before - after
    return float(top + (before - after) ** 2 / (8.0 * bend) if bend > 0.0 else top)


def _around(times: Array, best: int) -> tuple[float, float]:
    """Return the times beside one of some."""
    return float(times[max(0, best - 1)]), float(times[min(len(times) - 1, best + 1)])
