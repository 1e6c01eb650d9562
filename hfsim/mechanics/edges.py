"""Where forces change their form: steps end there, for what lies beyond is not in what came before.

What changes them once, for good, are events (`hfsim.mechanics.events`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from hfsim.maths.arrays import Array, BoolArray
from hfsim.mechanics.counting import PLACES, AlongSteps, Step
from hfsim.mechanics.projection import Through, directly
from hfsim.mechanics.system import System

if TYPE_CHECKING:
    from hfsim.mechanics.events import Events
    from hfsim.mechanics.once import Event

NEAR = 1e-3
"""Share of a step up to which an edge counts as its start."""
CLOSER = 17
"""Places in a stretch that is looked at more closely."""
NOISE, NOISE_OF_FEW = 1e-9, 1e-6
"""Distance from an edge, over the largest coordinate, up to which a step is at it, and does not meet it; and
that inside steps of so few terms as their ends alone determine."""
FEW = 4
"""Number of these."""
ROUNDS = 4
"""Times that the stretch with an edge is looked at more closely."""


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


class Edges(Crossings):
    """The edges of a system's forces."""

    what, begin = "edges", NEAR

    def __init__(self, system: System | None = None, through: Through = directly) -> None:
        super().__init__(system, through)
        self._parts = () if system is None else tuple(part for part in system.forces if part.has_edges)
        self._events = None if system is None else _events(system, through)

    def __bool__(self) -> bool:
        """Tell whether there are any."""
        return bool(self._parts) or self._events is not None

    @property
    def once(self) -> list[Event]:
        """What changes forces once, for good."""
        return [] if self._events is None else self._events.each

    def start(self, t: float, q: Array, v: Array) -> None:
        """Begin to follow a motion in a state (n,)."""
        if self._events is not None:
            self._events.start(t, q, v)

    def keep(self, t: float, q: Array, v: Array, step: Step | None = None) -> bool:
        """Go on to the end of a step, given if its length is fixed; tell whether an event happens there."""
        return self._events is not None and self._events.keep(t, q, v, step)

    def along(self, steps: Sequence[Step], end: tuple[float, Array, Array]) -> None:
        """Go on along steps that others have made, up to a state (t, q, v)."""
        if self._events is not None:
            self._events.along(steps, end)

    def kept(self) -> Callable[[], dict[str, Array]]:
        """Return what tells the memory of now, also when the motion has gone on."""
        return dict if self._events is None else self._events.kept()

    def recall(self, memory: Mapping[str, Array]) -> None:
        """Go on with a motion that was put down, or has gone back to where it was kept last."""
        if self._events is not None and memory:
            self._events.recall(memory)

    def first(self, step: Step) -> float:
        """Return after what time a tried step meets its first edge [s]; its length, if none is far inside."""
        happens = step.h if self._events is None else self._events.first(step)
        return min(happens, step.h * self._crossing(step, ROUNDS)) if self._parts else happens

    def met(self, kind: Callable[..., Step], t: Any, h: Any, *start: Array) -> Array:
        """Return whether a step meets any: one or zero, shape ()."""
        step = t, h, *start
        found = [] if self._events is None else [self._events.met(kind, *step)]
        found += [self._meets(self.looked(kind, *step))] if self._parts else []
        return found[0] if len(found) == 1 else np.asarray(np.maximum(*found))

    def _beyond(self, series: Array, times: Array, q: Array, v: Array) -> Array:
        assert self._system is not None
        x, u = self._system.absolute(q), self._system.absolute_velocity(q, v)
        beyond = np.concatenate([part.edges(times, x, u) for part in self._parts], axis=1)
        return np.asarray(np.where(np.abs(beyond) > _noise(series) * np.abs(x).max(), beyond, 0.0))


def _events(system: System, through: Through) -> Events | None:
    """Return what follows the events of a system, if it has any."""
    if not any(part.events for part in system.forces):
        return None
    from hfsim.mechanics.events import Events

    return Events(system, through)


def _noise(series: Array) -> float:
    """Return what inside a step with this series is no distance."""
    return NOISE if len(series) > FEW else NOISE_OF_FEW


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
