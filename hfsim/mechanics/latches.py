"""Latches: what holds a coordinate, as of a hinge that unfolds, from when it comes to where they catch."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.traced import live
from hfsim.mechanics.counting import PLACES, AlongSteps, Step
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.projection import Through
from hfsim.mechanics.resistances import Resistance
from hfsim.mechanics.system import System
from hfsim.mechanics.ties import Tie

ROUNDS = 6
"""Times that the stretch in which one catches is looked at more closely."""
SHARES = np.append(0.0, PLACES)
"""Of that stretch."""
SHORTEST = 1e-9
"""Share of a step after which one catches at the soonest."""
NOISE = 1e-9
"""Distance from the place, over the largest coordinate, up to which one catches where a motion starts."""


@dataclass(frozen=True)
class Latch(Resistance):
    """A spring and a damper that are there from a time on: k (s - place) + d w.

    Attributes
    ----------
    place : float
        Where it catches, and is without force.
    stiffness, damping : float
        k and d.
    since, side : ndarray, shape (1,)
        Time from which it holds [s], infinite as long as it is open; on which side of the place the
        coordinate is then, -1 or 1, and 0 where it holds.  Both are changed in place.
    """

    place: float
    stiffness: float
    damping: float
    since: Array = field(default_factory=lambda: np.array([np.inf]), compare=False)
    side: Array = field(default_factory=lambda: np.zeros(1), compare=False)
    catches: ClassVar[bool] = True

    @property
    def uses_rates(self) -> bool:
        """Whether it is damped."""
        return self.damping > 0.0

    def _held(self, t: Array, what: Array) -> Array:
        """Return what there is where it holds, zero where it is open."""
        return np.where(t >= live(self.since), what, 0.0)

    def energy(self, t: Array, s: Array) -> Array:
        """Return 1/2 k (s - place)^2."""
        return self._held(t, 0.5 * self.stiffness * (s - self.place) ** 2)

    def elastic(self, t: Array, s: Array) -> Array:
        """Return k (s - place)."""
        return self._held(t, self.stiffness * (s - self.place))

    def force(self, t: Array, s: Array, w: Array) -> Array:
        """Return that and d w."""
        elastic = self.stiffness * (s - self.place)
        return self._held(t, elastic + self.damping * w if self.damping else elastic)

    def slopes(self, t: Array, s: Array, w: Array) -> tuple[Array, Array]:
        """Return k and d."""
        held = self._held(t, np.ones_like(s))
        return self.stiffness * held, self.damping * held

    def start(self, t: float, beyond: float, near: float) -> None:
        """Begin to follow a motion with the coordinate so far beyond the place; near it, it holds at once.

        What caught later belonged to another motion.
        """
        held = self.since[0] <= t or abs(beyond) <= near
        self.take(*((min(float(self.since[0]), t), 0.0) if held else (np.inf, float(np.sign(beyond)))))

    def take(self, since: float, side: float) -> None:
        """Hold from a time on, or be open, with the coordinate on a side."""
        self.since[0], self.side[0] = since, side


class Latches(AlongSteps):
    """The latches of a system, which catch from step to step."""

    def __init__(self, system: System, through: Through) -> None:
        super().__init__(system, through)
        ties = (part for part in system.forces if isinstance(part, Tie))
        self._all = tuple((tie, one) for tie in ties for one in tie.resistances if isinstance(one, Latch))
        self._begun = False

    @property
    def _sides(self) -> Array:
        return np.concatenate([live(one.side) for _, one in self._all])

    def start(self, t: float, q: Array) -> None:
        """Begin to follow a motion in a state (n,)."""
        assert self._system is not None
        self._begun, x = True, self._system.absolute(q[None])
        for tie, _ in self._all:
            start(tie, t, x)

    def along(self, states: Sequence[tuple[float, Array]]) -> None:
        """Go on along states (t, q) at the ends of steps that others have made."""
        if not self._begun:
            self.start(*states[0])
        for state in states[1:]:
            self.keep(*state)

    def first(self, step: Step) -> float:
        """Return after what time the first one catches in a tried step [s]; its length, if none does."""
        if not self._sides.any():
            return step.h
        found = self._between(SHARES, self._look("latches", self.looked, step))
        if found is None:
            return step.h
        for _ in range(ROUNDS):
            shares = found[0] + (found[1] - found[0]) * SHARES
            seen = self._look("latches at shares", self._closely, step, shares[1:])
            found = self._between(shares, seen) or found
        return step.h * max(found[1], SHORTEST)

    def _between(self, shares: Array, beyond: Array) -> tuple[float, float] | None:
        """Return the shares between which the first latch catches, if any, seen at all of them but one."""
        caught = np.flatnonzero((self._sides * beyond < 0.0).any(axis=1))
        return (float(shares[caught[0]]), float(shares[caught[0] + 1])) if len(caught) else None

    def keep(self, t: float, q: Array) -> bool:
        """Go on to the end of a step; tell whether any catches there."""
        if not self._sides.any():
            return False
        caught = np.flatnonzero(self._sides * self._past(np.array([t]), q[None])[0] < 0.0)
        for k in caught:
            self._all[k][1].take(t, 0.0)
        return len(caught) > 0

    def met(self, kind: Callable[..., Step], t: Any, h: Any, *start: Array) -> Array:
        """Return whether any catches in a step: one or zero, shape ()."""
        caught = self._sides * self.looked(kind, t, h, *start) < 0.0
        return np.asarray(np.where(caught, 1.0, 0.0).max())

    def kept(self) -> Callable[[], dict[str, Array]]:
        """Return what tells the memory of now, also when the motion has gone on."""
        now = {"latches": np.array([(*one.since, *one.side) for _, one in self._all])}
        return now.copy

    def recall(self, memory: Mapping[str, Array]) -> None:
        """Go on with a motion that was put down."""
        self._begun = True
        for (_, one), known in zip(self._all, memory["latches"].tolist(), strict=True):
            one.take(*known)

    def looked(self, kind: Callable[..., Step], t: Any, h: Any, *start: Array) -> Array:
        """Return how far beyond its place each coordinate is along a step, (n_places, n_latches)."""
        return self._past(t + h * PLACES, kind(t, h, *start).positions(PLACES))

    def _closely(self, kind: Callable[..., Step], t: Any, h: Any, *given: Array) -> Array:
        """Return the same at shares that are given last."""
        *start, shares = given
        times = t + h * shares
        return self._past(times, kind(t, h, *start).at(times)[0])

    def _past(self, t: Array, q: Array) -> Array:
        assert self._system is not None
        x = self._system.absolute(q)
        return np.stack([tie.measured(t, x)[0] - one.place for tie, one in self._all], axis=1)


def start(tie: ForcePart, t: float, x: Array) -> None:
    """Begin a motion, as far as the latches of a force are concerned, in one state (1, n_x)."""
    near = NOISE * float(np.abs(x).max(initial=0.0))
    for one, beyond in _beyond(tie, np.array([t]), x):
        one.start(t, beyond, near)


def passed(tie: ForcePart, t: Array, x: Array) -> bool:
    """Tell whether a state (1, n_x) is beyond the place of an open latch of a force."""
    return any(one.side[0] * beyond < 0.0 for one, beyond in _beyond(tie, t, x))


def _beyond(tie: ForcePart, t: Array, x: Array) -> Iterator[tuple[Latch, float]]:
    """Yield the latches of a force, with how far a state (1, n_x) is beyond their places."""
    for one in tie.latches:
        assert isinstance(tie, Tie) and isinstance(one, Latch)
        yield one, float(tie.measured(t, x)[0][0]) - one.place
