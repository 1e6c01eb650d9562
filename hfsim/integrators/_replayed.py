"""Collocation steps replayed natively.

A recording holds for all steps that a method makes from one kind of derivative: the place of a step, its
length and the derivative are inputs.  It is checked against NumPy before it is used.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from threading import get_ident
from typing import Any

import numpy as np

from hfsim.integrators._derivative import Derivative
from hfsim.integrators._ending import MAX_ITERATIONS, Ending
from hfsim.integrators._iteration import LINEAR, End, Iteration, Place
from hfsim.integrators._problem import Counts, Increments, PlainIncrements, Problem
from hfsim.integrators._tableau import Collocation
from hfsim.integrators.derivative import computed, place_of, taken_at
from hfsim.maths.arrays import Array
from hfsim.maths.replayed import UNREADABLE, Replayed, agree, arrays_in, jittered, rebuilt, shaken
from hfsim.maths.tape import iterated
from hfsim.maths.traced import plain

MOST = 400
"""Coordinates up to which calls cost so much that replaying pays."""


class Replays:
    """What is replayed of the steps of one problem.

    Recordings are kept with the problem, for all who integrate it; each thread has its own, since a recording
    works on memory of its own.  All steps of a kind are replayed, or none: whether they are wanted is up to
    the stepper, so that a run that is put down goes on to the last bit.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._kept = problem.recordings.setdefault(get_ident(), {})
        self._last: tuple[Any, Any] = None, None

    def step(
        self, derivative: Derivative, table: Collocation, place: Place, strained: bool, native: bool
    ) -> Iteration | Replay:
        """Return what does a step: a recording if that is wanted and there is one."""
        if native and len(place.q) <= MOST:
            kind, numbers = self._seen(derivative)
            found = self._found((*kind, table, strained), derivative, table, place)
            if isinstance(found, Replay):
                return found.begin(self._problem.counts, derivative, numbers, place)
        return Iteration(self._problem, derivative, table, place, strained)

    def _found(
        self, key: Any, derivative: Derivative, table: Collocation, place: Place
    ) -> Replay | Exception:
        """Return the recording of a kind of steps, or why there is none."""
        found: Replay | Exception | None = self._kept.get(key)
        if found is None:
            try:
                found = Replay(self._problem, derivative, table, place, strained=key[-1])
            except UNREADABLE as why:
                found = why
            self._kept[key] = found
        return found

    def derivative(
        self,
        natural: Increments | None,
        t: float,
        q: Array,
        v: Array,
        expected: Array | None = None,
        native: bool = False,
    ) -> Derivative:
        """Compute a derivative; see `hfsim.integrators.derivative.derivative`."""
        problem = self._problem
        if problem.strains is not None and expected is None:
            expected = problem.strains.seen(q[None])[0]
        make = partial(_computed, problem, natural or PlainIncrements())
        given = (t, q, v) if expected is None else (t, q, v, expected)
        if native and problem.linearized is not None and len(q) <= MOST:
            make = self._function(("derivative", natural is None), make, _inverse)
        return taken_at(make(*given), problem, t, q, v, expected)

    def _function(self, name: Any, function: Callable[..., Any], measure: Any = None) -> Any:
        """Return a function that is recorded when it is first called."""
        if name not in self._kept:
            self._kept[name] = Replayed(function, measure)
        return self._kept[name]

    def taken_again(self, natural: Increments | None, taken: Array, native: bool) -> Derivative:
        """Compute a derivative where one was taken."""
        (t, q, v, expected), angles = place_of(self._problem, taken)
        with self._problem.turns.supposed(t, angles):
            return self.derivative(natural, t, q, v, expected, native)

    def _seen(self, derivative: Derivative) -> tuple[tuple[Any, ...], dict[str, Array]]:
        """Return what recordings depend on, the form of a derivative and its arrays, and these themselves."""
        if self._last[0] is not derivative:
            flags = tuple(one for one in vars(derivative).values() if isinstance(one, bool))
            numbers = dict(arrays_in(derivative))
            shapes = tuple((name, one.shape, one.dtype.char) for name, one in numbers.items())
            kind = type(derivative), type(derivative.increments), flags, shapes
            self._last = derivative, (kind, numbers)
        found: tuple[tuple[Any, ...], dict[str, Array]] = self._last[1]
        return found


class Replay:
    """Recorded steps of a kind; parameters, methods and attributes are those of `Iteration`."""

    def __init__(
        self, problem: Problem, derivative: Derivative, table: Collocation, place: Place, strained: bool
    ) -> None:
        from hfsim.maths.recorder import Recorder
        from hfsim.maths.recording import recording

        problem = problem.apart()
        # NumPy goes first: what is kept when it is first asked for must not be made on the tape
        other = Place(place.t, shaken(place.q), shaken(place.v), 0.9 * place.h)
        known = rebuilt(derivative, shaken)
        begun, expected = _trial(Iteration(problem, known, table, other, strained), other)
        tape = Recorder()
        step = Place(*(tape.input(np.asarray(one, dtype=float)) for one in place))
        a0, on_tape = tape.input(place.q), rebuilt(derivative, tape.input)
        with np.errstate(all="ignore"), recording(tape):
            own = _Recorded(problem, on_tape, table, step, strained)
            tape.cut()
            own.a = tape.input(np.zeros((table.stages, len(place.q))))
            own.guess(a0)
            tape.cut()
            sizes = own.correct()
            tape.cut()
            own.advance(finite=False)
            tape.cut()
            own.advance(finite=True)
            tape.cut()
            end = own.end()
            tape.cut()
        strains = [] if own.expected is None else [own.expected]
        programs = tape.programs(*sizes, own.correction_found, *end, *strains)
        self._begin, self._guess, self._correct, self._small, self._finite, self._end = programs
        self._sizes, self.correction_found = (plain(sizes[0]), plain(sizes[1])), plain(own.correction_found)
        self._ends = tuple(map(plain, end))
        self._known = [(name, plain(one)) for name, one in arrays_in(on_tape) if tape.reads(one)]
        self._place, self._a0, self.a = tuple(map(plain, step)), plain(a0), plain(own.a)
        self.expected = None if own.expected is None else plain(own.expected)
        self._held: Any = None
        self._renew = tape.renew
        self.calls = tape.told
        tape.poison()

        def near() -> list[Array]:
            place = other._replace(q=jittered(other.q), v=jittered(other.v))
            step = Iteration(problem, known, table, place, strained)
            return _trial(step, place, (jittered(begun[0]), begun[1]))[1]

        _, found = _trial(self.begin(problem.counts, known, dict(arrays_in(known)), other), other, begun)
        agree(expected, found, 1.0 + np.abs(other.q).max(), near)

    def begin(
        self, counts: Counts, derivative: Derivative, numbers: dict[str, Array], place: Place
    ) -> Replay:
        """Go on with another step, by a derivative that holds these numbers."""
        self._counts, self.derivative = counts, derivative
        if derivative is not self._held:
            for name, memory in self._known:
                memory[...] = numbers[name]
            self._held = derivative
        for memory, value in zip(self._place, place, strict=True):
            memory[...] = value
        self._renew()
        self._begin()
        return self

    def guess(self, a0: Array) -> None:
        """Let modes swing freely."""
        self._a0[...] = a0
        self._guess()

    def take(self, a: Array, expected: Array | None) -> None:
        """Begin with a guess made elsewhere."""
        self.a[...] = a
        if self.expected is not None and expected is not None:
            self.expected[...] = expected

    def correct(self) -> None:
        """Find a correction."""
        self._correct()

    def advance(self, finite: bool) -> None:
        """Add the correction."""
        (self._finite if finite else self._small)()

    def solve(self, ending: Ending) -> tuple[bool, int]:
        """Correct until that ends."""
        programs, limits = (self._correct, self._small, self._finite), (*ending.limits, LINEAR)
        converged, count = iterated(programs, self._sizes, limits, MAX_ITERATIONS)
        self._counts.iterations += count
        self._counts.calls += count
        self._counts.evaluations += count * len(self.a)
        return converged and bool(np.isfinite(self.a).all()), count

    def end(self) -> End:
        """Return what the step leads to."""
        self._end()
        self._counts.native += 1
        return End(*(one.copy() for one in self._ends))


class _Recorded(Iteration):
    """A step on a tape: what changes from correction to correction stays in its place."""

    def __setattr__(self, name: str, value: Any) -> None:
        before = self.__dict__.get(name)
        if name in ("a", "expected") and before is not None:
            before[...] = value
        else:
            self.__dict__[name] = value


def _trial(step: Iteration | Replay, place: Place, begun: Any = None) -> tuple[Any, list[Array]]:
    """Do a step with two corrections; return what these begin with (else the guess), and results."""
    step.guess(place.q)
    found, h = [step.end().q], place.h
    if begun is None:
        begun = step.a.copy(), None if step.expected is None else step.expected.copy()
    step.take(*begun)
    for finite in (True, False):
        step.correct()
        found.append(step.correction_found.copy())
        step.advance(finite)
    as_length = (1.0, h, h * h, 1.0, h)
    return begun, found + [np.asarray(unit * one) for unit, one in zip(as_length, step.end(), strict=True)]


def _computed(
    problem: Problem, natural: Increments, t: float, q: Array, v: Array, expected: Array | None = None
) -> Derivative:
    return computed(problem, natural, False, t, q, v, expected)


def _inverse(found: Derivative) -> Array:
    """Return a matrix by which derivatives are compared: modes by themselves may turn in their planes."""
    time = 1.0 / (1.0 + found.fastest)
    return found.solver(time**2, time)(np.eye(found.n))
