"""The events of a system along the steps of a motion, which end where one happens."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.traced import live
from hfsim.mechanics.counting import PLACES, AlongSteps, Step
from hfsim.mechanics.once import Event, events_of, start
from hfsim.mechanics.projection import Through
from hfsim.mechanics.system import System

ROUNDS = 6
"""Times that the stretch in which one happens is looked at more closely."""
SHARES = np.append(0.0, PLACES)
"""Of that stretch."""
SHORTEST = 1e-9
"""Share of a step after which one happens at the soonest."""


class Events(AlongSteps):
    """The events of a system, which happen from step to step."""

    def __init__(self, system: System, through: Through) -> None:
        super().__init__(system, through)
        self._all = events_of(system.forces)
        self._begun = False

    @property
    def each(self) -> list[Event]:
        """All of them."""
        return [event for event, _ in self._all]

    @property
    def _sides(self) -> Array:
        return np.concatenate([live(event.side) for event in self.each])

    def start(self, t: float, q: Array, v: Array) -> None:
        """Begin to follow a motion in a state (n,)."""
        self._begun = True
        start(self._all, t, *self._absolute(q[None], v[None]))

    def along(self, states: Sequence[tuple[float, Array, Array]]) -> None:
        """Go on along states (t, q, v) at the ends of steps that others have made."""
        if not self._begun:
            self.start(*states[0])
        for state in states[1:]:
            self.keep(*state)

    def first(self, step: Step) -> float:
        """Return after what time the first one happens in a tried step [s]; its length, if none does."""
        if not self._sides.any():
            return step.h
        found = self._between(SHARES, self._look("events", self.looked, step))
        if found is None:
            return step.h
        for _ in range(ROUNDS):
            shares = found[0] + (found[1] - found[0]) * SHARES
            seen = self._look("events at shares", self._closely, step, shares[1:])
            found = self._between(shares, seen) or found
        return step.h * max(found[1], SHORTEST)

    def _between(self, shares: Array, beyond: Array) -> tuple[float, float] | None:
        """Return the shares between which the first one happens, if any, seen at all of them but one."""
        passed = np.flatnonzero((self._sides * beyond < 0.0).any(axis=1))
        return (float(shares[passed[0]]), float(shares[passed[0] + 1])) if len(passed) else None

    def keep(self, t: float, q: Array, v: Array) -> bool:
        """Go on to the end of a step; tell whether any happens there."""
        if not self._sides.any():
            return False
        time, x, u = np.array([t]), *self._absolute(q[None], v[None])
        side = self._sides
        happening = np.flatnonzero((side != 0.0) & (side * self._past(time, x, u)[0] <= 0.0))
        for k in happening:
            event, ties = self._all[k]
            before = sum(float(tie.potential_energy(time, x)[0]) for tie in ties)
            event.take(t, 0.0)
            event.lost[0] = before - sum(float(tie.potential_energy(time, x)[0]) for tie in ties)
        return len(happening) > 0

    def met(self, kind: Callable[..., Step], t: Any, h: Any, *start: Array) -> Array:
        """Return whether any happens in a step: one or zero, shape ()."""
        passed = self._sides * self.looked(kind, t, h, *start) < 0.0
        return np.asarray(np.where(passed, 1.0, 0.0).max())

    def kept(self) -> Callable[[], dict[str, Array]]:
        """Return what tells the memory of now, also when the motion has gone on."""
        now = {"events": np.array([event.memory for event in self.each])}
        return now.copy

    def recall(self, memory: Mapping[str, Array]) -> None:
        """Go on with a motion that was put down."""
        self._begun = True
        for event, known in zip(self.each, memory["events"].tolist(), strict=True):
            event.take(*known)

    def looked(self, kind: Callable[..., Step], t: Any, h: Any, *start: Array) -> Array:
        """Return the quantity of each along a step, (n_places, n_events)."""
        return self._seen(t + h * PLACES, *kind(t, h, *start).inside(PLACES))

    def _closely(self, kind: Callable[..., Step], t: Any, h: Any, *given: Array) -> Array:
        """Return the same at shares that are given last."""
        *start, shares = given
        times = t + h * shares
        return self._seen(times, *kind(t, h, *start).at(times))

    def _seen(self, t: Array, q: Array, v: Array) -> Array:
        return self._past(t, *self._absolute(q, v))

    def _absolute(self, q: Array, v: Array) -> tuple[Array, Array]:
        assert self._system is not None
        return self._system.absolute(q), self._system.absolute_velocity(q, v)

    def _past(self, t: Array, x: Array, u: Array) -> Array:
        return np.stack([event.past(ties, t, x, u) for event, ties in self._all], axis=1)
