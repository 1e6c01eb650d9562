"""Steps of a method as programs on fixed memory, which the native kernel makes one after another."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any

import numpy as np

from hfsim.integrators._along import COUNT, LOOK, Along
from hfsim.integrators._closing import FUNCTIONS, Closing
from hfsim.integrators._iteration import End, Place
from hfsim.integrators._ordinary import MEMORY, PROGRAMS, Ahead, State
from hfsim.integrators._problem import Problem
from hfsim.maths.arrays import Array
from hfsim.maths.replayed import rebuilt
from hfsim.maths.tape import NOTHING, Program, joined, marched
from hfsim.maths.traced import plain
from hfsim.mechanics.counting import Turns
from hfsim.mechanics.projection import CLOSER, SEEN, STEADIER


class Marched:
    """What recordings of steps of all kinds have in common.

    Attributes
    ----------
    a0 : ndarray, shape (n,)
        Accelerations at the start.
    a : ndarray, shape (s, n)
        The same at the stages.
    taken_at : ndarray
        Where their derivative is taken, if they have one: the state and the angles that are counted, joined.
    calls : list of str
        What is done by Python.
    whole : bool
        Whether all that is done in steps is recorded: the projection, the turns of angles.
    """

    a0: Array
    a: Array
    taken_at: Array

    def __init__(self, place: Place) -> None:
        """Begin to record steps like one."""
        from hfsim.maths.recorder import Recorder

        tape: Any = Recorder()
        self._tape, self.calls, self._nothing = tape, tape.told, Program(NOTHING, tape.calls, None)
        self._inputs = Place(*(tape.input(np.asarray(one, dtype=float)) for one in place))
        self._place = list(map(plain, self._inputs))
        self._restore = tape.renew

    def follow(self, problem: Problem, end: End) -> None:
        """Record what comes after a step that leads there, on the tape."""
        tape, step = self._tape, self._inputs
        self._closing = Closing.of(tape, problem.project, np.reshape(step.t + step.h, 1), end)
        self._along = Along.of(tape, problem, step, end.series)
        self._closes = self._closing is not None or problem.project is None
        self.whole = self._closes and (self._along is not None or not (problem.turns or problem.edges))
        self._end = end

    def assemble(self, parts: tuple[str, ...], *outputs: Any) -> None:
        """End the recording of parts and of what comes after them."""
        more = {FUNCTIONS: self._closing, (LOOK, COUNT): self._along}
        added = {names: one for names, one in more.items() if one is not None}
        after = [output for one in added.values() for output in one.outputs]
        names = (*parts, *(name for some in added for name in some))
        programs = dict(zip(names, self._tape.programs(*outputs, *self._end[:5], *after), strict=True))
        self._programs: dict[tuple[str, ...], Program] = {(name,): one for name, one in programs.items()}
        for one in added.values():
            one.programs = programs
        self._end = rebuilt(self._end, plain)
        del self._tape, self._inputs

    def make_ready(
        self, problem: Problem, own: Mapping[str, Array], put_together: Mapping[str, tuple[str, ...]]
    ) -> None:
        """Say what ordinary steps are made of, and what that works on.

        Parameters
        ----------
        own : mapping of str to ndarray
            What steps of this kind alone have in `MEMORY`.
        put_together : mapping of str to tuple of str
            Those of `PROGRAMS` that are several of this recording.
        """
        closing, along, end = self._closing, self._along, self._end
        names = dict(put_together)
        if closing:
            names |= {"end": ("end", SEEN), "closer": (CLOSER,), "steadier": (STEADIER,)}
        for name in {one for part in PROGRAMS for one in names.get(part, (part,))}:
            self._programs.setdefault((name,), self._nothing)
        memory = dict(zip(("t", "q", "v", "h"), self._place, strict=True))
        memory |= {"start": self.a0, "stages": self.a, "taken": self.taken_at}
        memory |= {"q_end": end.q, "v_end": end.v, "series": end.series}
        memory |= {"error": np.asarray(end.error), "rate_error": np.asarray(end.rate_error)}
        if problem.positive is not None:
            memory["positive"] = np.array(problem.positive, dtype=np.int64)
        if closing:
            memory |= dict(zip(("miss", "slip", "q_closed", "v_closed"), closing.memory, strict=True))
        if along:
            memory |= dict(zip(("q_looked", "v_looked", "farthest"), along.memory, strict=True))
        nothing = {name: np.zeros(0) for name in MEMORY}
        nothing["miss"] = nothing["slip"] = nothing["farthest"] = np.zeros(1)
        self._memory = [np.asarray(one) for one in (nothing | memory | dict(own)).values()]
        assert len(self._memory) == len(MEMORY)
        self._steps = [self.program(*names.get(one, (one,))) for one in PROGRAMS]
        self._rows = np.empty((0, 0))

    def march(self, rule: Array, state: State, room: int) -> Ahead:
        """Make ordinary steps from a place, and try one more; see `hfsim.integrators._ordinary`."""
        now = np.array(state)
        if len(self._rows) < room:
            self._rows = np.empty((room, 3 + 2 * len(self.a0) + self._end.series.size))
        before = np.empty(len(state)), np.empty_like(self.taken_at)
        failed = False
        try:
            tried = marched(self._steps, self._memory, rule, now, self._rows[:room], before)
        except np.linalg.LinAlgError:
            if not now[-1]:
                raise
            tried = failed = True  # it will again: what is kept is told of first
        after, rows = State(*now.tolist()), self._rows[: int(now[-1])].copy()
        t = float(self._place[0])
        if not tried:
            return Ahead(rows, t, after, self.taken_at.copy(), None)
        return Ahead(rows, t, State(*before[0].tolist()), before[1], None if failed else after, failed)

    def program(self, *names: str) -> Program:
        """Return programs, one after another, as one."""
        if names not in self._programs:
            self._programs[names] = joined([self._programs[name,] for name in names])
        return self._programs[names]

    def run(self, *names: str) -> None:
        """Run programs."""
        self.program(*names)()

    def begin(self, place: Place) -> None:
        """Go to another step."""
        t, q, v, h = self._place
        t[()], q[:], v[:], h[()] = place
        self._restore()

    def start(self) -> Array:
        """Compute the accelerations at the start."""
        self.run("start")
        return self.a0.copy()

    def end(self) -> End:
        """Return what the step leads to."""
        self.run("end")
        return self._ended(self._end.q, self._end.v, False)

    def result(self) -> End:
        """Return what the last step leads to, moved onto the constraints if that is recorded."""
        closing = self._closing if isfinite(self._end.error) else None
        q, v = closing() if closing else self._end[:2]
        end = self._ended(q, v, closing is not None)
        return end._replace(seen=self._along.look(q, v)) if self._along and self._closes else end

    def _ended(self, q: Array, v: Array, closed: bool) -> End:
        end = self._end
        return End(q.copy(), v.copy(), end.series.copy(), float(end.error), float(end.rate_error), closed)

    def closed(self, q: Array, v: Array) -> list[Array]:
        """Return what the functions of the projection return at an end; nothing if they are not recorded."""
        return self._closing.tried(q, v) if self._closing else []

    def looked(self, series: Array, q: Array, v: Array) -> list[Array]:
        """Return what is seen along the step of now, with an end; nothing if that is not recorded."""
        return [self._along.look(q, v), self._along.memory[2].copy()] if self._along else []

    def tell(self, turns: Turns) -> None:
        """Let a system know how far its angles have turned in ordinary steps."""
        if self._along:
            self._along.tell(turns)
