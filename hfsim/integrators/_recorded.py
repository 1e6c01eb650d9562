"""A collocation step on a tape.

A recording holds for all steps of a kind: the place of a step, its length and where its derivative is taken
are inputs.  It is checked against NumPy before it is used.
"""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np

from hfsim.integrators._along import COUNT, LOOK, Along
from hfsim.integrators._closing import FUNCTIONS, Closing
from hfsim.integrators._derivative import Derivative
from hfsim.integrators._ending import size_of
from hfsim.integrators._iteration import End, Iteration, Kind, Place
from hfsim.integrators._ordinary import MEMORY, PROGRAMS, Ahead, State
from hfsim.integrators._problem import Problem
from hfsim.integrators._trial import At, InNumPy, common, derived, here, parted, starts, together, tried
from hfsim.maths.arrays import Array
from hfsim.maths.replayed import agree, arrays_in, jittered, later, rebuilt, shaken
from hfsim.maths.tape import NOTHING, Program, joined, marched
from hfsim.maths.traced import plain
from hfsim.mechanics.counting import Turns
from hfsim.mechanics.projection import CLOSER, SEEN, STEADIER

PARTS = ("derive", "start", "guess", "middle", "reach", "prepare", "correct", "small", "finite", "end")
"""What steps are put together from, in the order in which it is recorded; see the methods of `Recorded`."""


class Recorded:
    """Steps of a kind as programs on fixed memory; methods are those of `Iteration`, unless said otherwise.

    Parameters
    ----------
    problem : Problem
        To be evaluated in NumPy.
    kind : Kind
    place : Place
        A step of this kind.
    given : Derivative, optional
        One that is not to be recorded itself, but written down where it changes.
    known : Derivative, optional
        One that NumPy found: it need not again if it is that of the step's start.

    Attributes
    ----------
    template : Derivative
        Its arrays are the memory of the derivative.
    frequency : ndarray, shape ()
        Its largest circular frequency.
    where : ndarray
        Where it is taken: t, q, v and expected strains, joined.
    taken_at : ndarray
        The same and the angles whose turns are counted, joined.
    a0 : ndarray, shape (n,)
        Accelerations at the start.
    a : ndarray, shape (s, n)
    expected : ndarray, shape (s, n_strains), or None
    correction_found : ndarray, shape (s, n)
    sizes : tuple of ndarray, shape ()
        Of a correction's consequence, of the correction, and of the coordinates.
    calls : list of str
        What is done by Python.

    Raises
    ------
    UNREADABLE
        If they cannot be recorded.
    """

    def __init__(
        self, problem: Problem, kind: Kind, place: Place, given: Derivative | None = None,
        known: Derivative | None = None,
    ) -> None:  # fmt: skip
        from hfsim.maths.recorder import Recorder

        # NumPy goes first: what is kept when it is first asked for must not be made on the tape
        known = known if known is not None and starts(known, problem, kind, place) else None
        begun, expected = tried(InNumPy(problem, kind, place, given or known), place)
        tape, self._derives = Recorder(), given is None
        other = Place(float(later(place.t)), shaken(place.q), shaken(place.v), 0.9 * place.h)
        self._record(tape, problem, kind, other, given)
        self._restore, self.calls = tape.renew, tape.told

        def near() -> list[Array]:
            other = place._replace(q=jittered(place.q), v=jittered(place.v))
            step = InNumPy(problem, kind, other, given)
            return common(tried(step, other, (jittered(begun[0]), begun[1]))[1], found)

        self.begin(place)
        if given is None:
            self.derive(here(problem, place))
            agree([problem.turns.angles(place.t, place.q)], [self.taken_at[len(self.where) :]])
        else:
            self.put(given)
        found = tried(self, place, begun)[1]
        agree(common(expected, found), common(found, found), 1.0 + np.abs(place.q).max(), near)

    def _record(
        self, tape: Any, problem: Problem, kind: Kind, place: Place, given: Derivative | None
    ) -> None:
        """Make a step on a tape; take hold of its memory and its programs."""
        from hfsim.maths.recording import recording

        n = len(place.q)
        memory: list[Any] = [tape.input(np.asarray(one, dtype=float)) for one in place]
        step = Place(*memory)
        a0, where = tape.input(place.q), tape.input(together(here(problem, place)))
        if given is not None:
            given = rebuilt(given, tape.input)
        with np.errstate(all="ignore"), recording(tape):
            known = given or derived(problem, kind, *parted(where, n))
            frequency, turns = known.frequency(), problem.turns
            taken = where
            if turns:
                taken = np.concatenate([where, turns.counted(where[:1], where[None, 1 : n + 1])[:, 0]])
            tape.cut()
            a0[...] = problem.single(step.t, step.q, step.v)
            tape.cut()
            own = _OnTape(problem, known, kind.table, step, kind.strained)
            own.a = tape.input(np.zeros((kind.table.stages, n)))
            own.guess(a0)
            size = size_of(step.q)
            tape.cut()
            for part, value in zip(parted(where, n), own.middle(), strict=True):
                if part is not None:
                    part[...] = value
            tape.cut()
            own.reach()
            tape.cut()
            own.prepare()
            tape.cut()
            sizes = own.correct()
            tape.cut()
            own.advance(finite=False)
            tape.cut()
            own.advance(finite=True)
            tape.cut()
            end = own.end()
            tape.cut()
            closing = Closing.of(tape, problem.project, np.reshape(step.t + step.h, 1), end)
            along = Along.of(tape, problem, step, end.series)
        arrays = {name: one for name, one in arrays_in(known) if tape.knows(one)}
        strains = [] if own.expected is None else [own.expected]
        outputs = [*sizes, own.correction_found, *end[:5], *strains, frequency, *arrays.values()]
        more = {FUNCTIONS: closing, (LOOK, COUNT): along}
        added = {names: one for names, one in more.items() if one is not None}
        outputs += [taken, size, *(output for one in added.values() for output in one.outputs)]
        names = (*PARTS, *(name for some in added for name in some))
        programs = dict(zip(names, tape.programs(*outputs), strict=True))
        self._programs: dict[tuple[str, ...], Program] = {(name,): one for name, one in programs.items()}
        for one in added.values():
            one.programs = programs
        self.template: Derivative = rebuilt(known, plain)
        self._arrays = {name: plain(one) for name, one in arrays.items()}
        self.frequency, self.sizes = plain(frequency), (plain(sizes[0]), plain(sizes[1]), plain(size))
        self.taken_at = plain(taken)
        self._place, self.a0, self.where = list(map(plain, memory)), plain(a0), plain(where)
        self.a, self.correction_found = plain(own.a), plain(own.correction_found)
        self.expected = None if own.expected is None else plain(own.expected)
        self._closing, self._along, self._end = closing, along, rebuilt(end, plain)
        self._closes = closing is not None or problem.project is None
        self.whole = self._closes and (along is not None or not (problem.turns or problem.edges))
        self._steps, self._memory = self._marching(problem)
        self._rows = np.empty((0, 0))

    def _marching(self, problem: Problem) -> tuple[list[Program], list[Array]]:
        """Return what ordinary steps are made of, and what that works on."""
        closing, along, none, no_end = self._closing, self._along, np.zeros(()), np.zeros(0)
        names: dict[str, tuple[str, ...]] = {"renew": ("middle", "derive")}
        if closing:
            names |= {"end": ("end", SEEN), "closer": (CLOSER,), "steadier": (STEADIER,)}
        for name in ("closer", "steadier", LOOK, COUNT):
            self._programs.setdefault((name,), Program(NOTHING, [], None))
        t, q, v, h = self._place
        own = (t, h, q, v, self.a0, self.a, *self.sizes, *self._end[:5], self.frequency, self.taken_at)
        positive = np.array(() if problem.positive is None else problem.positive, dtype=np.int64)
        closed, unseen = closing.memory if closing else (none,) * 4, (no_end, no_end, none)
        memory = (*own, *closed, positive, *(along.memory if along else unseen))
        assert len(memory) == len(MEMORY)
        return [self.program(*names.get(one, (one,))) for one in PROGRAMS], list(map(np.asarray, memory))

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

    def derive(self, at: At) -> None:
        """Compute the derivative at a state."""
        self.where[...] = together(at)
        self._restore()
        self.run("derive")

    def put(self, derivative: Derivative) -> None:
        """Write down a derivative that was computed elsewhere and is of the same form."""
        for name, value in arrays_in(derivative):
            if name in self._arrays:
                self._arrays[name][...] = value

    def taken(self) -> At:
        """Return where the derivative was taken."""
        t, q, v, expected = parted(self.where, len(self.a0))
        return float(t), q.copy(), v.copy(), None if expected is None else expected.copy()

    def result(self) -> End:
        """Return what the last step leads to, moved onto the constraints if that is recorded."""
        closing = self._closing if isfinite(self._end.error) else None
        q, v = closing() if closing else self._end[:2]
        end = self._ended(q, v, closing is not None)
        return end._replace(seen=self._along.look(q, v)) if self._along and self._closes else end

    def start(self) -> Array:
        """Compute the accelerations at the start."""
        self.run("start")
        return self.a0.copy()

    def guess(self, a0: Array) -> None:
        """Let modes swing freely."""
        self.a0[...] = a0
        self.run("guess")

    def middle(self) -> At:
        """Return the stage in the middle as it is guessed; the derivative is taken again where it was."""
        before = self.where.copy()
        self.run("middle")
        found = self.taken()
        self.where[...] = before
        if self._derives:
            self.run("derive")
        return found

    def reach(self) -> None:
        """Find where the stages are."""
        self.run("reach")

    def prepare(self) -> None:
        """Make ready for corrections."""
        self.run("prepare")

    def correct(self) -> None:
        """Find a correction."""
        self.run("correct")

    def advance(self, finite: bool) -> None:
        """Add the correction."""
        self.run("finite" if finite else "small")

    def end(self) -> End:
        """Return what the step leads to."""
        self.run("end")
        return self._ended(self._end.q, self._end.v, False)

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


class _OnTape(Iteration):
    """A step on a tape: what changes from correction to correction stays in its place."""

    def __setattr__(self, name: str, value: Any) -> None:
        before = self.__dict__.get(name)
        if name in ("a", "expected", "_q") and before is not None:
            before[...] = value
        else:
            self.__dict__[name] = value
