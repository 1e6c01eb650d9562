"""Where forces change their form: steps end there, for what lies beyond is not in what came before.

What changes them once, for good, are events (`hfsim.mechanics.events`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

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
LOOKED_AT = np.concatenate([[NEAR], PLACES])
"""Shares of a step at which it is held against the edges."""
NOISE, NOISE_OF_FEW = 1e-9, 1e-6
"""Distance from an edge, over the largest coordinate, up to which a step is at it, and does not meet it; and
that inside steps of so few terms as their ends alone determine."""
FEW = 4
"""Number of these."""
ROUNDS = 4
"""Times that the stretch with an edge is looked at more closely."""


class Edges(AlongSteps):
    """The edges of a system's forces."""

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

    def keep(self, t: float, q: Array, v: Array) -> bool:
        """Go on to the end of a step; tell whether an event happens there."""
        return self._events is not None and self._events.keep(t, q, v)

    def along(self, steps: Sequence[Step], end: tuple[float, Array, Array]) -> None:
        """Go on along steps that others have made, up to a state (t, q, v)."""
        if self._events is not None:
            self._events.along([*((step.t, step.q, step.v) for step in steps), end])

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
        return min(happens, self._met_first(step)) if self._parts else happens

    def _met_first(self, step: Step) -> float:
        found = _between(LOOKED_AT, self._look("edges", self.looked, step))
        return step.h * next((at for pair in found if (at := self._closer(step, *pair)) < 1.0), 1.0)

    def _closer(self, step: Step, first: float, last: float) -> float:
        """Return the share of a step at which it meets an edge between two; one if it does not."""
        for _ in range(ROUNDS):
            shares = np.linspace(first, last, len(LOOKED_AT))
            found = _between(shares, self._look("edges at shares", self._closely, step, shares))
            if not found:
                return 1.0
            first, last = found[0]
        return last

    def met(self, kind: Callable[..., Step], t: Any, h: Any, *start: Array) -> Array:
        """Return whether a step meets any: one or zero, shape ()."""
        step = t, h, *start
        found = [] if self._events is None else [self._events.met(kind, *step)]
        found += [meets(self.looked(kind, *step))] if self._parts else []
        return found[0] if len(found) == 1 else np.asarray(np.maximum(*found))

    def looked(self, kind: Callable[..., Step], t: Any, h: Any, *start: Array) -> Array:
        """Return by how much a step is beyond each edge where it is looked at first, (n_shares, n_edges)."""
        noise = _noise(start[-1])
        return self._beyond(noise, t + h * LOOKED_AT, *kind(t, h, *start).inside(LOOKED_AT))

    def _closely(self, kind: Callable[..., Step], t: Array, h: Array, *given: Array) -> Array:
        """Return the same where it is looked at more closely, at shares that are given last."""
        *start, shares = given
        times = t + h * shares
        return self._beyond(_noise(start[-1]), times, *kind(t, h, *start).at(times))

    def _beyond(self, noise: float, times: Array, q: Array, v: Array) -> Array:
        assert self._system is not None
        x, u = self._system.absolute(q), self._system.absolute_velocity(q, v)
        beyond = np.concatenate([part.edges(times, x, u) for part in self._parts], axis=1)
        return np.asarray(np.where(np.abs(beyond) > noise * np.abs(x).max(), beyond, 0.0))


def _events(system: System, through: Through) -> Events | None:
    """Return what follows the events of a system, if it has any."""
    if not any(part.events for part in system.forces):
        return None
    from hfsim.mechanics.events import Events

    return Events(system, through)


def _noise(series: Array) -> float:
    """Return what inside a step with this series is no distance."""
    return NOISE if len(series) > FEW else NOISE_OF_FEW


def meets(beyond: Array) -> Array:
    """Return whether edges are met where they are looked at, or touched between two such places, shape ().

    Parameters
    ----------
    beyond : ndarray, shape (n_shares, n_edges)
    """
    found = [np.where(kind(beyond), 1.0, 0.0).max() for kind in (_crossed, _touched)]
    return np.asarray(np.maximum(*found))


def _between(shares: Array, beyond: Array) -> list[tuple[float, float]]:
    """Return the shares between which edges may be touched, up to those where one is crossed first."""
    places, crossed = shares.tolist(), np.flatnonzero(_crossed(beyond).any(axis=1)).tolist()
    first = crossed[0] if crossed else len(places)
    touched = np.flatnonzero(_touched(beyond).any(axis=1)).tolist()
    found = [(places[k], places[k + 2]) for k in touched if k + 2 <= first]
    return found + ([(places[first], places[first + 1])] if crossed else [])


def _crossed(beyond: Array) -> BoolArray:
    """Tell between which neighbours which edges are crossed, shape (n_shares - 1, n_edges)."""
    side = np.where(beyond > 0.0, 1.0, 0.0)
    return np.asarray(np.abs(side[1:] - side[:-1]) > 0.0)


def _touched(beyond: Array) -> BoolArray:
    """Tell where the parabola through three neighbours is beyond an edge that they are not, or the reverse.

    Shape (n_shares - 2, n_edges).
    """
    first, middle, last = beyond[:-2], beyond[1:-1], beyond[2:]
    slope, bend = 0.5 * (last - first), first - 2.0 * middle + last
    has_vertex = np.abs(slope) < np.abs(bend)
    vertex = middle - np.where(has_vertex, 0.5 * slope**2 / np.where(has_vertex, bend, 1.0), 0.0)
    return np.asarray(_crossed(np.stack([middle, vertex]))[0])
