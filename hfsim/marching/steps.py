"""The steps of a scene, or of its parts side by side, that can be put down and taken up again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeAlias

import numpy as np

from hfsim.errors import HfsimError, LimitReached, SolverFailure
from hfsim.integrators import (
    Counts,
    Limits,
    Memory,
    Method,
    Problem,
    Segment,
    Stepping,
    Trajectory,
    joined,
    packed,
    part_of,
)
from hfsim.marching.runaway import Watches
from hfsim.maths.arrays import Array, IntArray

Stop: TypeAlias = HfsimError | KeyboardInterrupt | None
"""What ended steps before their time."""
State: TypeAlias = tuple[float, Array, Array]
"""Time and state (t, q, v)."""


class Steps:
    """The steps of one scene with the watches over them."""

    def __init__(
        self, problem: Problem, method: Method, start: State, t_end: float, limits: Limits, watches: Watches
    ) -> None:
        self.problem, self._start, self._watches = problem, start, watches
        self._stepping = Stepping(problem, method, start, t_end, limits, watches)
        self._early: Stop = None

    @property
    def path(self) -> Trajectory:
        """The steps so far, since they were last taken up."""
        return self._stepping.path

    @property
    def stop(self) -> Stop:
        """What ended them early."""
        return self._early or self._stepping.stop

    @property
    def counts(self) -> Counts:
        """What they have cost."""
        return self.problem.counts

    @property
    def on_the_brink(self) -> bool:
        """Whether the next step takes first what happens where the last has ended."""
        return self._stepping.on_the_brink

    def __iter__(self) -> Iterator[None]:
        """Make steps until the end, or until something stops them."""
        try:
            if self.path.t_end == self._start[0]:
                self._watches(*self._start)
        except (LimitReached, SolverFailure, KeyboardInterrupt) as at_once:
            self._early = at_once
            return
        for _ in self._stepping:
            yield None

    def settle(self) -> None:
        """Bring the path to where the steps have come: it is there."""

    def memory(self) -> Memory:
        """Return all that the next step depends on."""
        return packed({"stepping": self._stepping.memory(), "watches": self._watches.memory()})

    def recall(self, memory: Memory) -> None:
        """Go on from a memory."""
        self._stepping.recall(part_of(memory, "stepping"))
        self._watches.recall(part_of(memory, "watches"))


class Strand(NamedTuple):
    """The steps of one part.

    Attributes
    ----------
    columns : ndarray of int
        Where its state stands in that of the whole scene.
    """

    steps: Steps
    columns: IntArray
    bodies: tuple[str, ...]

    @property
    def t(self) -> float:
        """Time it has reached [s]."""
        return self.steps.path.t_end


class Together:
    """The steps of all parts; whichever lies behind goes on, and one that stops ends all at its time.

    Attributes
    ----------
    path : Trajectory
        Of the whole scene, up to where `settle` has brought it.
    stop : exception or None
        As of `Stepping`.
    """

    def __init__(self, problem: Problem, strands: Sequence[Strand], start: State, t_end: float) -> None:
        self.problem, self.path = problem, Trajectory(start[0], *start)
        self.stop: Stop = None
        self._strands, self._t_end = tuple(strands), t_end

    @property
    def counts(self) -> Counts:
        """What all parts have cost."""
        total = Counts()
        for strand in self._strands:
            total.add(strand.steps.counts)
        return total

    def __iter__(self) -> Iterator[None]:
        """Make steps until the end, or until a part stops."""
        moving = {strand.bodies: iter(strand.steps) for strand in self._strands}
        while self.t < self._t_end:
            behind = min(self._strands, key=lambda strand: strand.t)
            next(moving[behind.bodies], None)
            if behind.steps.stop is not None:
                self.stop = _named(behind.steps.stop, behind.bodies)
                break
            yield None
        self.settle()

    @property
    def on_the_brink(self) -> bool:
        """Whether a part that is no further than the whole takes first what happens there."""
        return any(strand.steps.on_the_brink and strand.t <= self.t for strand in self._strands)

    @property
    def t(self) -> float:
        """Time that all parts have reached [s]."""
        return min(strand.t for strand in self._strands)

    def settle(self) -> None:
        """Bring the path of the whole to where all parts have come."""
        path, t = self.path, self.t
        self.problem.counts = self.counts
        paths = [(strand.steps.path, strand.columns) for strand in self._strands]
        path.methods = list(dict.fromkeys(name for part, _ in paths for name in part.methods))
        if t <= path.t_end:
            return
        steps, path.q, path.v = joined(paths, path, t)
        path.segments += steps
        path.t_end = t
        self.problem.turns.along(steps, (t, path.q, path.v))
        self.problem.edges.along(steps, (t, path.q, path.v))
        for part, _ in paths:
            part.segments = [step for step in part.segments if step.t + step.h > t]

    def memory(self) -> Memory:
        """Return all that the next step depends on."""
        own = {"t": np.array(self.path.t_end), "q": self.path.q, "v": self.path.v}
        own["turns"] = self.problem.turns.memory()
        own |= packed({"edges": self.problem.edges.kept()()})
        for k, strand in enumerate(self._strands):
            ahead = packed({"ahead": _arrays(strand.steps.path)})
            own |= packed({str(k): strand.steps.memory() | ahead})
        return own

    def recall(self, memory: Memory) -> None:
        """Go on from a memory."""
        t = float(memory["t"])
        self.path = Trajectory(t, t, memory["q"], memory["v"])
        self.problem.turns.recall(memory["turns"])
        self.problem.edges.recall(part_of(memory, "edges"))
        for k, strand in enumerate(self._strands):
            own = part_of(memory, str(k))
            strand.steps.recall(own)
            strand.steps.path.segments = _segments(part_of(own, "ahead"))


def _arrays(path: Trajectory) -> Memory:
    """Return the steps of a path as arrays: those by which a part is ahead of the others."""
    alike = {name: np.array([getattr(step, name) for step in path.segments]) for name in ("t", "h", "q", "v")}
    series = [np.empty((0, len(path.q))), *(step.series for step in path.segments)]
    terms = np.array([len(one) for one in series[1:]], dtype=int)
    return alike | {"terms": terms, "series": np.concatenate(series)}


def _segments(memory: Memory) -> list[Segment]:
    series = np.split(memory["series"], np.cumsum(memory["terms"]))
    alike = zip(memory["t"], memory["h"], memory["q"], memory["v"], series, strict=False)
    return [Segment(float(t), float(h), q, v, own) for t, h, q, v, own in alike]


def _named(stop: Stop, bodies: tuple[str, ...]) -> Stop:
    """Say which part of the scene stopped."""
    part = f"in the part of {', '.join(bodies)}: "
    if isinstance(stop, SolverFailure):
        return replace(stop, reason=part + stop.reason)
    if isinstance(stop, LimitReached):
        # whoever raised it must know it again by its class
        stop.reason = part + stop.reason
        stop.args = (stop.reason,)
    return stop
