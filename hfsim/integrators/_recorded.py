"""A collocation step on a tape.

A recording holds for all steps of a kind: the place of a step, its length and where its derivative is taken
are inputs.  It is checked against NumPy before it is used.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hfsim.integrators._derivative import Derivative
from hfsim.integrators._ending import size_of
from hfsim.integrators._iteration import Iteration, Kind, Place
from hfsim.integrators._marched import Marched
from hfsim.integrators._problem import Problem
from hfsim.integrators._trial import At, InNumPy, common, derived, here, parted, starts, together, tried
from hfsim.maths.arrays import Array
from hfsim.maths.replayed import AGREEING, HALF, agree, arrays_in, jittered, rebuilt
from hfsim.maths.traced import plain

PARTS = ("derive", "start", "guess", "middle", "reach", "prepare", "correct", "small", "finite", "end")
"""What steps are put together from, in the order in which it is recorded; see the methods of `Recorded`."""


class Recorded(Marched):
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
    expected : ndarray, shape (s, n_strains), or None
    correction_found : ndarray, shape (s, n)

    Raises
    ------
    UNREADABLE
        If they cannot be recorded.
    """

    def __init__(
        self, problem: Problem, kind: Kind, place: Place, given: Derivative | None = None,
        known: Derivative | None = None,
    ) -> None:  # fmt: skip
        # NumPy goes first: what is kept when it is first asked for must not be made on the tape
        known = known if known is not None and starts(known, problem, kind, place) else None
        begun, expected = tried(InNumPy(problem, kind, place, given or known), place)
        super().__init__(place)
        self._derives = given is None
        self._record(problem, kind, place, given)

        def near() -> list[Array]:
            other = place._replace(q=jittered(place.q), v=jittered(place.v))
            step = InNumPy(problem, kind, other, rebuilt(given, jittered))
            return common(tried(step, other, (jittered(begun[0]), begun[1]))[1], found)

        self.begin(place)
        if given is None:
            self.derive(here(problem, place))
            agree([problem.turns.angles(place.t, place.q)], [self.taken_at[len(self.where) :]])
        else:
            self.put(given)
        found = tried(self, place, begun)[1]
        agreeing = HALF if problem.by_differences else AGREEING
        agree(common(expected, found), common(found, found), 1.0 + np.abs(place.q).max(), near, agreeing)

    def _record(self, problem: Problem, kind: Kind, place: Place, given: Derivative | None) -> None:
        """Make a step on a tape; take hold of its memory and its programs."""
        from hfsim.maths.recording import on_tape

        n, tape, step = len(place.q), self._tape, self._inputs
        a0, where = tape.input(place.q), tape.input(together(here(problem, place)))
        memory = None if given is None else rebuilt(given, tape.input)

        def made() -> tuple[Derivative, Any, Any, _OnTape, Any, Any]:
            known = memory or derived(problem, kind, *parted(where, n))
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
            self.follow(problem, end)
            return known, frequency, taken, own, sizes, size

        with np.errstate(all="ignore"):
            known, frequency, taken, own, sizes, size = on_tape(tape, made)
        arrays = {name: one for name, one in arrays_in(known) if tape.knows(one)}
        strains = [] if own.expected is None else [own.expected]
        derivative = (frequency, taken, *arrays.values())
        self.assemble(PARTS, *sizes, own.correction_found, *strains, *derivative, size)
        self.template: Derivative = rebuilt(known, plain)
        self._arrays = {name: plain(one) for name, one in arrays.items()}
        self.frequency, self.taken_at, self.where = plain(frequency), plain(taken), plain(where)
        self.a0, self.a = plain(a0), plain(own.a)
        self.correction_found = plain(own.correction_found)
        self.expected = None if own.expected is None else plain(own.expected)
        change, correction = map(plain, sizes)
        found = {"change": change, "size": correction, "scale": plain(size), "frequency": self.frequency}
        self.make_ready(problem, found, {"renew": ("middle", "derive")})

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


class _OnTape(Iteration):
    """A step on a tape: what changes from correction to correction stays in its place."""

    def __setattr__(self, name: str, value: Any) -> None:
        before = self.__dict__.get(name)
        if name in ("a", "expected", "_q") and before is not None:
            before[...] = value
        else:
            self.__dict__[name] = value
