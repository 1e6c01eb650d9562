"""The turns of all angles of a system that have to be counted, along the steps of a motion."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any, NamedTuple, Protocol

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.mechanics.projection import Through, directly
from hfsim.mechanics.system import System
from hfsim.mechanics.turns import NEAR, TurnCount, Turning

PLACES = np.linspace(0.0, 1.0, 17)[1:]
"""Places in a step at which angles are looked at."""


class Step(Protocol):
    """A step of a motion, with what is in between."""

    @property
    def t(self) -> float:
        """Start [s]."""

    @property
    def h(self) -> float:
        """Length [s]."""

    @property
    def q(self) -> Array:
        """State at the start, shape (n,)."""

    @property
    def v(self) -> Array:
        """Its rate."""

    @property
    def series(self) -> Array:
        """What is inside, with a row for each term."""

    def __iter__(self) -> Iterator[Any]:
        """Go through all of these."""

    def at(self, times: Array) -> tuple[Array, Array]:
        """Return (q, v) at times within it, shape (n_times, n) each."""

    def inside(self, shares: Array) -> tuple[Array, Array]:
        """Return (q, v) at shares of its length, shape (n_shares, n) each."""

    def positions(self, shares: Array) -> Array:
        """Return q there."""


class Past(NamedTuple):
    """What the forces of a system remember of one motion, also when they have followed others.

    Attributes
    ----------
    parts : tuple of (object, tuple)
        What counts the turns of an angle, or says whether something has happened, with its memory: what it
        has in `memory` and can `take`, which is replaced along a motion, never changed.
    """

    parts: tuple[tuple[Any, tuple[Any, ...]], ...] = ()

    @classmethod
    def of(cls, parts: Iterable[Any]) -> Past:
        """Return what is remembered now."""
        return cls(tuple((one, one.memory) for one in parts))

    def recall(self) -> None:
        """Have the forces remember it."""
        for one, memory in self.parts:
            one.take(*memory)

    @contextmanager
    def recalled(self) -> Iterator[None]:
        """For the time being, have the forces remember it."""
        before = Past.of(one for one, _ in self.parts)
        self.recall()
        try:
            yield
        finally:
            before.recall()


class AlongSteps:
    """What looks at a system along tried steps; without a system there is nothing to see.

    Parameters
    ----------
    through : callable, optional
        What functions of states are called through.
    """

    def __init__(self, system: System | None = None, through: Through = directly) -> None:
        self._system, self._through = system, through

    def looked(self, kind: Callable[..., Step], t: Any, h: Any, *given: Array) -> Array:
        """Return what is seen along a step.

        Parameters
        ----------
        kind : callable
            Makes a step.
        t, h : float
        given : sequence of ndarray
            What else it is made of, and what else is to be known of it.
        """
        raise NotImplementedError

    def _look(self, what: str, function: Callable[..., Array], step: Step, *given: Array) -> Array:
        """Return what a function of a kind of steps, numbers of one and arrays returns."""
        name = f"{what} in a step of {len(step.series)} terms"
        found: Array = self._through(name, partial(function, type(step)), (*step, *given))
        return found


class Turns(AlongSteps):
    """The turns of a system's angles, counted from step to step."""

    def __init__(self, system: System | None = None, through: Through = directly) -> None:
        super().__init__(system, through)
        forces = () if system is None else system.forces
        self._parts = tuple((part, part.counter) for part in forces if part.counter is not None)
        self._seen: list[list[float]] = []

    @property
    def counts(self) -> list[TurnCount]:
        """The turns of each angle."""
        return [count for _, count in self._parts]

    def start(self, t: float, q: Array, v: Array) -> None:
        """Begin to follow a motion in a state (n,)."""
        if self._parts:
            pairs = self._turning(np.array([t]), q[None], v[None])
            for (_, count), pair in zip(self._parts, pairs.tolist(), strict=True):
                count.start(Turning(t, *pair))

    def strays(self, step: Step, q: Array, v: Array, seen: Array | None = None) -> str:
        """Return what has an angle that leaves what was expected of it in a tried step with this end, or ''.

        By more than a quarter of a turn: its force may have been that of another number of turns.

        Parameters
        ----------
        seen : ndarray, shape (n_angles, 4), optional
            What `looked` returns, where it is known.
        """
        if not self._parts:
            return ""
        self._seen = (self._look("angles", self.looked, step, q, v) if seen is None else seen).tolist()
        far = (part.item for (part, _), row in zip(self._parts, self._seen, strict=True) if row[0] > NEAR)
        return next(far, "")

    def keep(self, t: float) -> None:
        """Go on to the end of the step that was tried last, at this time."""
        for (_, count), (_, left, *here) in zip(self._parts, self._seen, strict=True):
            count.keep(Turning(t, *here), left)

    def known(self) -> list[Array]:
        """Return time, angle and rate (3,) of each at the last kept step."""
        return [count.known() for _, count in self._parts]

    def reach(self, known: Array) -> None:
        """Go on along steps that others have counted, to times, angles and rates (n_angles, 3)."""
        for (_, count), row in zip(self._parts, known.tolist(), strict=True):
            count.reach(Turning(*row))

    def __len__(self) -> int:
        """Return their number."""
        return len(self._parts)

    def angles(self, t: float, q: Array) -> Array:
        """Return the angles in a state (n,), with all their turns."""
        if not self._parts:
            return np.zeros(0)
        return self.counted(np.array([t]), q[None])[:, 0]

    @contextmanager
    def supposed(self, t: float, angles: Array) -> Iterator[None]:
        """For the time being, take the angles near t for these."""
        before = Past.of(self.counts)
        for count, angle in zip(self.counts, angles.tolist(), strict=True):
            count.suppose(t, angle)
        try:
            yield
        finally:
            before.recall()

    def end(self) -> None:
        """End the motion."""
        for _, count in self._parts:
            count.end()

    def along(self, steps: Sequence[Step], end: tuple[float, Array, Array]) -> None:
        """Go on along steps that others have made, up to a state (t, q, v)."""
        if not self._parts:
            return
        if any(count.now is None for _, count in self._parts):
            self.start(steps[0].t, steps[0].q, steps[0].v)
        ends = [(step.t, step.q, step.v) for step in steps[1:]]
        for step, (t, q, v) in zip(steps, [*ends, end], strict=True):
            self.strays(step, q, v)
            self.keep(t)

    def memory(self) -> Array:
        """Return time, angle and rate of each angle at the last kept step, and as noted last, (n_angles, 6).

        Before the first step (0, 6).
        """
        return self.kept()()["now"]

    def kept(self) -> Callable[[], dict[str, Array]]:
        """Return what tells the memory of now, also when the motion has gone on."""
        known = [(*count.now, *count.noted[-1]) for _, count in self._parts if count.now is not None]
        return lambda: {"now": np.array(known, dtype=float).reshape(-1, 6)}

    def recall(self, memory: Array) -> None:
        """Go on with a motion that was put down."""
        for (_, count), row in zip(self._parts, memory.tolist(), strict=False):
            count.start(Turning(*row[3:]))
            count.reach(Turning(*row[:3]))

    def counted(self, t: Array, q: Array) -> Array:
        """Return the angles in states (n_batch, n), with all their turns, shape (n_angles, n_batch)."""
        assert self._system is not None
        x = self._system.absolute(q)
        return np.stack([count.counted(t, part.angle(x)) for part, count in self._parts])

    def looked(self, kind: Callable[..., Step], t: Any, h: Any, *given: Array) -> Array:
        """Return how far each leaves what is known of it, and its angle and rate at the end, (n_angles, 4).

        The end (q, v) is given last.
        """
        *start, q, v = given
        times, inside = t + h * PLACES, kind(t, h, *start).positions(PLACES)
        inside[-1] = q
        pairs = zip(self._parts, self.counted(times, inside), strict=True)
        left = np.stack([count.left(times, angles) for (_, count), angles in pairs])
        return np.concatenate([left, self._turning(times[-1:], q[None], v[None])], axis=1)

    def _turning(self, t: Array, q: Array, v: Array) -> Array:
        """Return angles and their rates in a state, shape (n_angles, 2)."""
        assert self._system is not None
        x, u = self._system.absolute(q), self._system.absolute_velocity(q, v)
        rates = np.concatenate([part.spin(x, u) for part, _ in self._parts])
        return np.stack([self.counted(t, q)[:, 0], rates], axis=1)
