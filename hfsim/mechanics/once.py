"""What happens once along a motion: a latch catches, a spring lets go."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np

from hfsim.maths.arrays import Array


@dataclass(frozen=True)
class Event:
    """What happens when a quantity passes zero.

    Attributes
    ----------
    since, side, lost : ndarray, shape (1,)
        Time from which it has happened [s], infinite until then; the sign of the quantity until then, zero
        afterwards; the energy that is lost by it [J].  All are changed in place.
    """

    told: ClassVar[str] = ""
    """What such events are called, in summaries."""
    since: Array = field(default_factory=lambda: np.array([np.inf]), compare=False, kw_only=True)
    side: Array = field(default_factory=lambda: np.zeros(1), compare=False, kw_only=True)
    lost: Array = field(default_factory=lambda: np.zeros(1), compare=False, kw_only=True)

    @property
    def time(self) -> float:
        """Time at which it happens at the latest [s]."""
        return np.inf

    def item(self, ties: Sequence[Any]) -> str:
        """Return the deck path of what it is an event of."""
        return str(ties[0].item)

    def past(self, ties: Sequence[Any], t: Array, x: Array, u: Array) -> Array:
        """Return the quantity, of the ties that it is about, shape (n_batch,)."""
        raise NotImplementedError

    def happens_at_start(self, t: float, past: float, size: float, moving: bool) -> bool:
        """Tell whether it has happened where a motion starts, or a scene stands; coordinates have a size."""
        raise NotImplementedError

    def side_before(self, past: float) -> float:
        """Return the sign of the quantity until it happens, from what it is at the start."""
        return float(np.sign(past))

    def take(self, since: float, side: float, lost: float = 0.0) -> None:
        """Have it happen at a time, or not yet, with the quantity on a side."""
        self.since[0], self.side[0], self.lost[0] = since, side, lost

    def take_from(self, other: Self) -> None:
        """Have it happen when another one does."""
        self.take(*other.memory)

    @property
    def memory(self) -> tuple[float, float, float]:
        """All that changes along a motion."""
        return float(self.since[0]), float(self.side[0]), float(self.lost[0])


def events_of(forces: Iterable[Any]) -> list[tuple[Event, list[Any]]]:
    """Return what may happen, with the ties that each is about."""
    found: dict[int, tuple[Event, list[Any]]] = {}
    for part in forces:
        for event in part.events:
            found.setdefault(id(event), (event, []))[1].append(part)
    return list(found.values())


def start(events: Iterable[tuple[Event, Sequence[Any]]], t: float, x: Array, u: Array | None = None) -> None:
    """Begin to follow a motion, in one state (1, n_x); what happened later belonged to another one.

    Without rates the scene stands: nothing is known of its motion then, and so of its forces.
    """
    size, moving = float(np.abs(x).max(initial=0.0)), u is not None
    for event, ties in events:
        past = float(event.past(ties, np.array([t]), x, 0.0 * x if u is None else u)[0])
        happened = event.since[0] <= t or event.happens_at_start(t, past, size, moving)
        since = min(float(event.since[0]), t) if happened else np.inf
        event.take(since, 0.0 if happened else event.side_before(past))


def stand(forces: Iterable[Any], t: float) -> None:
    """Have what happens at a stated time happen in a scene that stands at a time [s]."""
    for event, _ in events_of(forces):
        if event.time <= t < event.since[0]:
            event.take(event.time, 0.0)


def lost(forces: Iterable[Any], t: Array) -> Array:
    """Return the energy that is gone by times (n_batch,), and that nothing exchanges [J]."""
    gone = (np.where(t >= event.since, event.lost, 0.0) for event, _ in events_of(forces))
    return np.asarray(sum(gone, np.zeros(len(t))))
