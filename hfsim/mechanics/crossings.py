"""Where quantities of a system cross zero along tried steps, also where that is soon undone."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from hfsim.maths.arrays import Array, BoolArray
from hfsim.mechanics.counting import PLACES, AlongSteps, Step

CLOSER = 17
"""Places in a stretch that is looked at more closely."""


class Crossings(AlongSteps):
    """Where quantities of a system cross zero along tried steps, or touch it between two looks.

    Attributes
    ----------
    what : str
        The quantities.
    begin : float
        Share of a step from which it is looked at.
    per_term : int
        Places at which it is, for each term of what is inside, at least.
    slack : float
        How near to zero, over their second difference, a parabola through neighbours is looked at closely.
    """

    what: ClassVar[str]
    begin: ClassVar[float]
    per_term: ClassVar[int] = 0
    slack: ClassVar[float] = 0.0

    def looked(self, kind: Callable[..., Step], t: Any, h: Any, *start: Array) -> Array:
        """Return by how much a step is beyond zero where it is looked at first, (n_shares, n_quantities)."""
        shares = self._looked_at(start[-1])
        return self._beyond(start[-1], t + h * shares, *kind(t, h, *start).inside(shares))

    def _closely(self, kind: Callable[..., Step], t: Array, h: Array, *given: Array) -> Array:
        """Return the same where it is looked at more closely, at shares that are given last."""
        *start, shares = given
        times = t + h * shares
        return self._beyond(start[-1], times, *kind(t, h, *start).at(times))

    def _beyond(self, series: Array, times: Array, q: Array, v: Array) -> Array:
        """Return the same at times in a step with a series."""
        raise NotImplementedError

    def _looked_at(self, series: Array) -> Array:
        return _shares(self.begin, max(len(PLACES), self.per_term * len(series)))

    def _meets(self, beyond: Array) -> Array:
        """Return whether zero is, or may be, crossed in a step that is looked at: one or zero, shape ()."""
        found = [np.where(one, 1.0, 0.0).max() for one in (_crossed(beyond), _touched(beyond, self.slack))]
        return np.asarray(np.maximum(*found))

    def _crossing(self, step: Step, rounds: int) -> float:
        """Return the share of a tried step at which the first is crossed; one if none is."""
        shares = self._looked_at(step.series)
        return self._first(step, shares, self._look(self.what, self.looked, step), rounds)

    def _first(self, step: Step, shares: Array, beyond: Array, rounds: int) -> float:
        """Return the same of a stretch that was looked at, and is so many times more closely."""
        touched, crossed = _between(shares, beyond, self.slack if rounds else 0.0)
        for pair in touched:
            if (at := self._closer(step, *pair, rounds)) < 1.0:
                return at
        at = self._closer(step, *crossed, rounds) if crossed else 1.0
        return crossed[1] if crossed and at == 1.0 else at

    def _closer(self, step: Step, first: float, last: float, rounds: int) -> float:
        if not rounds:
            return last
        shares = np.linspace(first, last, CLOSER)
        beyond = self._look(f"{self.what} at shares", self._closely, step, shares)
        return self._first(step, shares, beyond, rounds - 1)


@lru_cache(maxsize=64)
def _shares(begin: float, count: int) -> Array:
    """Return the first place in a step, and so many others up to its end."""
    return np.concatenate([[begin], np.linspace(0.0, 1.0, count + 1)[1:]])


def passed(beyond: Array) -> BoolArray:
    """Return which edges are crossed where they are looked at, or touched between, shape (n_edges,)."""
    return np.asarray(_crossed(beyond).any(axis=0) | _touched(beyond, 0.0).any(axis=0))


_Pair = tuple[float, float]


def _between(shares: Array, beyond: Array, slack: float) -> tuple[list[_Pair], _Pair | None]:
    """Return the shares between which edges may be touched, up to those where one is crossed first."""
    places, crossed = shares.tolist(), np.flatnonzero(_crossed(beyond).any(axis=1)).tolist()
    first = crossed[0] if crossed else len(places)
    touched = np.flatnonzero(_touched(beyond, slack).any(axis=1)).tolist()
    pairs = [(places[k], places[k + 2]) for k in touched if k + 2 <= first]
    return pairs, (places[first], places[first + 1]) if crossed else None


def _crossed(beyond: Array) -> BoolArray:
    """Tell between which neighbours which edges are crossed, shape (n_shares - 1, n_edges)."""
    side = np.where(beyond > 0.0, 1.0, 0.0)
    return np.asarray(np.abs(side[1:] - side[:-1]) > 0.0)


def _touched(beyond: Array, slack: float) -> BoolArray:
    """Tell where the parabola through three neighbours is beyond an edge that they are not, or the reverse.

    It counts as farther out by a share of their second difference, the slack.  Shape (n_shares - 2, n_edges).
    """
    first, middle, last = beyond[:-2], beyond[1:-1], beyond[2:]
    slope, bend = 0.5 * (last - first), first - 2.0 * middle + last
    has_vertex = np.abs(slope) < np.abs(bend)
    out = 0.5 * slope**2 / np.where(has_vertex, bend, 1.0) + slack * bend
    vertex = middle - np.where(has_vertex, out, 0.0)
    return np.asarray(_crossed(np.stack([middle, vertex]))[0])
