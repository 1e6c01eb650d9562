"""Where forces change their form: steps end there, for what lies beyond is not in what came before.

What changes them once, for good, are events (`hfsim.mechanics.events`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.mechanics.counting import Step
from hfsim.mechanics.crossings import Crossings
from hfsim.mechanics.projection import Through, directly
from hfsim.mechanics.system import System

if TYPE_CHECKING:
    from hfsim.mechanics.events import Events
    from hfsim.mechanics.once import Event

NEAR = 1e-3
"""Share of a step up to which an edge counts as its start."""
NOISE, NOISE_OF_FEW = 1e-9, 1e-6
"""Distance from an edge, over the largest coordinate, up to which a step is at it, and does not meet it; and
that inside steps of so few terms as their ends alone determine."""
FEW = 4
"""Number of these."""
ROUNDS = 4
"""Times that the stretch with an edge is looked at more closely."""


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
