"""The events of a system along the steps of a motion, which end where one happens."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.traced import live
from hfsim.mechanics.counting import Step
from hfsim.mechanics.crossings import Crossings, passed
from hfsim.mechanics.once import Event, events_of, start
from hfsim.mechanics.projection import Through
from hfsim.mechanics.system import System

ROUNDS = 6
"""Times that the stretch in which one happens is looked at more closely."""
SHORTEST = 1e-9
"""Share of a step after which one happens at the soonest."""


class Events(Crossings):
    """The events of a system, which happen from step to step."""

    what, begin = "events", 0.0
    per_term, slack = 2, 0.1  # a step may turn round as often as it has terms

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

    def along(self, steps: Sequence[Step], end: tuple[float, Array, Array]) -> None:
        """Go on along steps that others have made, up to a state (t, q, v)."""
        states = [*((step.t, step.q, step.v) for step in steps), end]
        if not self._begun:
            self.start(*states[0])
        for step, state in zip(steps, states[1:], strict=True):
            self.keep(*state, step)

    def first(self, step: Step) -> float:
        """Return after what time the first one happens in a tried step [s]; its length, if none does."""
        if not self._sides.any():
            return step.h
        return step.h * max(self._crossing(step, ROUNDS), SHORTEST)

    def keep(self, t: float, q: Array, v: Array, step: Step | None = None) -> bool:
        """Go on to the end of a step; tell whether any happens there.

        So does what would have inside the step, if that is given: it was not made shorter for it.
        """
        if not self._sides.any():
            return False
        time, x, u = np.array([t]), *self._absolute(q[None], v[None])
        side = self._sides
        happens = side * self._past(time, x, u)[0] <= 0.0
        if step is not None:
            happens |= passed(self._look(self.what, self.looked, step))
        happening = np.flatnonzero((side != 0.0) & happens)
        for k in happening:
            event, ties = self._all[k]
            before = sum(float(tie.potential_energy(time, x)[0]) for tie in ties)
            event.take(t, 0.0)
            event.lost[0] = before - sum(float(tie.potential_energy(time, x)[0]) for tie in ties)
        return len(happening) > 0

    def met(self, kind: Callable[..., Step], t: Any, h: Any, *start: Array) -> Array:
        """Return whether any happens in a step: one or zero, shape ()."""
        return self._meets(self.looked(kind, t, h, *start))

    def kept(self) -> Callable[[], dict[str, Array]]:
        """Return what tells the memory of now, also when the motion has gone on."""
        now = {"events": np.array([event.memory for event in self.each])}
        return now.copy

    def recall(self, memory: Mapping[str, Array]) -> None:
        """Go on with a motion that was put down."""
        self._begun = True
        for event, known in zip(self.each, memory["events"].tolist(), strict=True):
            event.take(*known)

    def _beyond(self, series: Array, times: Array, q: Array, v: Array) -> Array:
        beyond = -self._sides * self._past(times, *self._absolute(q, v))
        # none has happened where it begins, though by the errors of steps it may be a little beyond
        return np.concatenate([np.minimum(beyond[:1], 0.0), beyond[1:]])

    def _absolute(self, q: Array, v: Array) -> tuple[Array, Array]:
        assert self._system is not None
        return self._system.absolute(q), self._system.absolute_velocity(q, v)

    def _past(self, t: Array, x: Array, u: Array) -> Array:
        return np.stack([event.past(ties, t, x, u) for event, ties in self._all], axis=1)
