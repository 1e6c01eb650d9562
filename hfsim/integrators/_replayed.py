"""Collocation steps replayed natively.

A recording holds for all steps that a method makes from one kind of derivative: the place of a step, its
length and the derivative are inputs.  It is checked against NumPy before it is used.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from hfsim.integrators._derivative import Derivative
from hfsim.integrators._iteration import End, Iteration, Place
from hfsim.integrators._problem import Counts, Increments, PlainIncrements, Problem
from hfsim.integrators._tableau import Collocation
from hfsim.integrators.derivative import computed, place_of, taken_at
from hfsim.maths import kernel
from hfsim.maths.arrays import Array
from hfsim.maths.replayed import UNREADABLE, Replayed, agree, arrays_in, jittered, rebuilt, shaken
from hfsim.maths.traced import plain

MOST = 400
"""Coordinates up to which calls cost so much that replaying pays."""


class Replays:
    """The recordings of a stepper.

    All steps of a kind are replayed, or none: a run that is put down goes on to the last bit.

    Attributes
    ----------
    found : dict
        For each kind of step its recording, or why there is none.
    """

    def __init__(self, problem: Problem, wanted: bool = True) -> None:
        self._problem, self._wanted = problem, wanted and kernel.KERNEL == "native"
        self._kind: tuple[Any, Any] = None, None
        self.found: dict[Any, Replay | Exception] = {}
        self._derivatives: dict[bool, Callable[..., Derivative]] = {}

    def step(
        self, derivative: Derivative, table: Collocation, place: Place, strained: bool
    ) -> Iteration | Replay:
        """Return what does a step: a recording where there is one."""
        problem = self._problem
        if self._wanted and len(place.q) <= MOST:
            key = (*self._kind_of(derivative), table, strained)
            found = self.found.get(key)
            if found is None:
                found = self.found[key] = self._recorded(derivative, table, place, strained)
            if isinstance(found, Replay):
                return found.begin(derivative, place)
        return Iteration(problem, derivative, table, place, strained)

    def derivative(
        self, natural: Increments | None, t: float, q: Array, v: Array, expected: Array | None = None
    ) -> Derivative:
        """Compute a derivative; see `hfsim.integrators.derivative.derivative`."""
        problem = self._problem
        if problem.strains is not None and expected is None:
            expected = problem.strains.seen(q[None])[0]
        increments = natural or PlainIncrements()
        make = self._derivatives.get(natural is None)
        if problem.linearized is None:
            make = partial(_computed, problem, increments)
        elif make is None:
            make = Replayed(partial(_computed, replace(problem, counts=Counts()), increments), _inverse)
            self._derivatives[natural is None] = make
        given = (t, q, v) if expected is None else (t, q, v, expected)
        return taken_at(make(*given), problem, t, q, v, expected)

    def taken_again(self, natural: Increments | None, taken: Array) -> Derivative:
        """Compute a derivative where one was taken."""
        (t, q, v, expected), angles = place_of(self._problem, taken)
        with self._problem.turns.supposed(t, angles):
            return self.derivative(natural, t, q, v, expected)

    def _kind_of(self, derivative: Derivative) -> Any:
        """Return what recordings depend on: the form of a derivative and the shapes of its arrays."""
        if self._kind[0] is not derivative:
            flags = tuple(one for one in vars(derivative).values() if isinstance(one, bool))
            shapes = tuple((name, one.shape, one.dtype.char) for name, one in arrays_in(derivative))
            self._kind = derivative, (type(derivative), type(derivative.increments), flags, shapes)
        return self._kind[1]

    def _recorded(
        self, derivative: Derivative, table: Collocation, place: Place, strained: bool
    ) -> Replay | Exception:
        try:
            return Replay(self._problem, derivative, table, place, strained)
        except UNREADABLE as why:
            return why


class Replay:
    """Recorded steps of a kind; parameters, methods and attributes are those of `Iteration`."""

    def __init__(
        self, problem: Problem, derivative: Derivative, table: Collocation, place: Place, strained: bool
    ) -> None:
        from hfsim.maths.recorder import Recorder
        from hfsim.maths.recording import recording

        self._problem, self.derivative, self._other = problem, derivative, (table, strained)
        self._uncounted = replace(problem, counts=Counts())
        # what is kept when it is first asked for must not be made on the tape
        before = Iteration(self._uncounted, derivative, table, place, strained)
        before.guess(place.q)
        before.correct()
        before.advance(finite=False)
        before.advance(finite=True)
        before.end()
        tape = Recorder()
        step = Place(*(tape.input(np.asarray(one, dtype=float)) for one in place))
        a0, known = tape.input(place.q), rebuilt(derivative, tape.input)
        with np.errstate(all="ignore"), recording(tape):
            own = _Recorded(self._uncounted, known, table, step, strained)
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
        y = own.correction_found
        expected = [] if own.expected is None else [own.expected]
        programs = tape.programs(*sizes, y, *end, *expected)
        self._begin, self._guess, self._correct, self._small, self._finite, self._end = programs
        self._sizes, self._y = (plain(sizes[0]), plain(sizes[1])), plain(y)
        self._ends = tuple(map(plain, end))
        self._known = [(name, plain(one)) for name, one in arrays_in(known) if tape.reads(one)]
        self._place, self._a0, self.a = tuple(map(plain, step)), plain(a0), plain(own.a)
        self.expected = None if own.expected is None else plain(own.expected)
        self._held: Any = None
        self.calls = tape.told
        tape.poison()
        self._check(Place(place.t, shaken(place.q), shaken(place.v), 0.9 * place.h), shaken)

    def begin(self, derivative: Derivative, place: Place) -> Replay:
        """Go on with another step."""
        self.derivative = derivative
        if derivative is not self._held:
            found = dict(arrays_in(derivative))
            for name, memory in self._known:
                memory[...] = found[name]
            self._held = derivative
        for memory, value in zip(self._place, place, strict=True):
            memory[...] = value
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

    def correct(self, anew: bool = True) -> tuple[Array, Array]:
        """Find a correction."""
        self._problem.count(self.a)
        self._correct()
        return self._sizes

    def advance(self, finite: bool) -> None:
        """Add the correction."""
        (self._finite if finite else self._small)()

    def end(self) -> End:
        """Return what the step leads to."""
        self._end()
        return End(*(one.copy() for one in self._ends))

    def _check(self, place: Place, change: Callable[[Array], Array] = np.copy) -> None:
        """Do a step with two corrections, and refuse if NumPy finds something else.

        How far rounding reaches in a stiff scene is seen by numbers that differ in their last digit.
        """
        derivative, scale, h = rebuilt(self.derivative, change), 1.0 + np.abs(place.q).max(), place.h
        own, near = (
            Iteration(self._uncounted, derivative, self._other[0], one, self._other[1])
            for one in (place, place._replace(q=jittered(place.q), v=jittered(place.v)))
        )
        self.begin(derivative, place)
        for one in (own, near, self):
            one.guess(place.q)
        agree(own.end().q, self.end().q, scale, near.end().q)
        expected = None if self.expected is None else self.expected.copy()
        own.take(self.a, expected)
        near.take(jittered(self.a), expected)
        for finite in (True, False):
            for one in (own, near):
                one.correct()
            self._correct()
            agree(own.correction_found, self._y, scale, near.correction_found)
            for one in (own, near, self):
                one.advance(finite)
        ends = zip(own.end(), self.end(), near.end(), (1.0, h, h * h, 1.0, h), strict=True)
        for ours, found, other, as_length in ends:
            agree(np.asarray(as_length * ours), np.asarray(as_length * found), scale, as_length * other)


class _Recorded(Iteration):
    """A step on a tape: what changes from correction to correction stays in its place."""

    def __setattr__(self, name: str, value: Any) -> None:
        before = self.__dict__.get(name)
        if name in ("a", "expected") and before is not None:
            before[...] = value
        else:
            self.__dict__[name] = value


def _computed(
    problem: Problem, natural: Increments, t: float, q: Array, v: Array, expected: Array | None = None
) -> Derivative:
    return computed(problem, natural, False, t, q, v, expected)


def _inverse(found: Derivative) -> Array:
    """Return a matrix by which derivatives are compared: modes by themselves may turn in their planes."""
    return found.solver(1.0 / (1.0 + found.fastest) ** 2, 0.0)(np.eye(len(found.L.T)))  # type: ignore[attr-defined]
