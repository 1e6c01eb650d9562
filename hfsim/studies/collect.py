"""Numbers of a run: quantities such as ``final(arm.tip.x)``, read from its rows and from its steps."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from hfsim.deck.quantities import Quantity
from hfsim.errors import HfsimError
from hfsim.marching.solution import Run
from hfsim.maths.arrays import Array, cumulative
from hfsim.maths.shapes import gauss_legendre

_SAME = 1e-9
"""Share of the time between two rows, from one of which a time counts as that row's."""
_CLOSER = 33
"""Times that are looked at around an extreme, ..."""
_ROUNDS = 4
"""... and how often."""
_INSIDE = 4
"""Gauss points between two times."""


class CollectError(HfsimError):
    """A run does not have a quantity."""

    exit_code = 3


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
    try:
        values = run[quantity.channel]
    except KeyError as error:
        raise CollectError(str(error.args[0])) from None
    if not len(values):
        raise CollectError(f"{quantity}: the run has no rows")
    if quantity.kind == "final":
        return float(values[-1])
    if quantity.time is not None:
        return _at(quantity, run, quantity.time)
    return _over_time(quantity, run)


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
    column = [one.name for one in run.channels].index(quantity.channel)
    return np.asarray(run.fine.at(times)[:, column])


def _over_time(quantity: Quantity, run: Run) -> float:
    """Return the largest or smallest value, or the root of the mean square."""
    seen = run.drawn
    t, values = seen.t, seen[quantity.channel]
    if quantity.kind == "rms":
        return _root_of_mean_square(quantity, run, t, values)
    sign = 1.0 if quantity.kind == "max" else -1.0
    best = int(np.argmax(sign * values))
    left, right, most = float(t[max(0, best - 1)]), float(t[min(len(t) - 1, best + 1)]), float(values[best])
    for _ in range(_ROUNDS if run.fine is not None and right > left else 0):
        times = np.linspace(left, right, _CLOSER)
        here = _between(quantity, run, times)
        best = int(np.argmax(sign * here))
        most = sign * max(sign * most, sign * float(here[best]))
        left, right = float(times[max(0, best - 1)]), float(times[min(_CLOSER - 1, best + 1)])
    return most


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
