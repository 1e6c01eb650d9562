"""Collocation steps replayed natively: whole attempts, and the derivatives that they take."""

from __future__ import annotations

from math import isfinite
from threading import get_ident
from typing import Any, ClassVar
from weakref import ref

import numpy as np

from hfsim.integrators._derivative import Derivative, form
from hfsim.integrators._iteration import End, Kind, Middle, Place
from hfsim.integrators._often import LARGE
from hfsim.integrators._ordinary import Ahead, State
from hfsim.integrators._problem import Problem
from hfsim.integrators._recorded import Recorded
from hfsim.integrators.derivative import computed, place_of, taken_at
from hfsim.maths.arrays import Array
from hfsim.maths.replayed import rebuilt

MOST_DIFFERENCES = 60
"""Coordinates up to which derivatives by differences, of as many states at once, are replayed: LAPACK is
quicker with more."""


class Held:
    """A derivative in the memory of a recording, until another one is written there.

    Attributes
    ----------
    fastest, taken, ways
        As those of a `Derivative`.
    """

    recordable: ClassVar[bool] = True

    def __init__(self, replay: Replay, fastest: float, taken: Array, ways: tuple[str, ...]) -> None:
        self._replay, self.fastest, self.taken, self.ways = ref(replay), fastest, taken, ways

    @property
    def replay(self) -> Replay:
        """The recording; it lives as long as the problem, and as it holds this, this does not hold it."""
        found = self._replay()
        assert found is not None
        return found

    def apart(self, problem: Problem) -> Derivative:
        """Return the same in memory of its own."""
        self.replay.holds(problem, self)
        found: Derivative = rebuilt(self.replay.recorded.template)
        found.taken, found.ways = self.taken, self.ways
        return found


class Replays:
    """What is replayed of the steps of one problem.

    Recordings are kept with the problem, for all who integrate it; each thread has its own, since a recording
    works on memory of its own.  All steps of a kind are replayed, or none: whether they are wanted is up to
    the stepper, so that a run that is put down goes on to the last bit.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem

    def of(self, kind: Kind, place: Place, derivative: Derivative | Held) -> Replay | None:
        """Return the recording of a kind of steps, in which there is a derivative; None if there is none.

        One that cannot be recorded itself has a recording of steps for each of its forms.
        """
        if isinstance(derivative, Held):
            replay = derivative.replay
            if replay.kind == kind and replay.held is derivative and replay.thread == get_ident():
                return replay
        found = self._deriving(kind, place, derivative)
        if found is None and isinstance(derivative, Derivative):
            found = self._recorded((kind, form(derivative)), place, derivative)
        return found if found is not None and found.holds(self._problem, derivative) else None

    def beginning(self, kind: Kind, place: Place) -> Derivative:
        """Return the derivative at the start of a run, which the next one from there finds as it is."""
        problem, (t, q, v, _) = self._problem, place
        if len(q) > LARGE:
            return self._in_numpy(kind, place, None)
        begun = kind, t, q.tobytes(), v.tobytes()
        found: Derivative = problem.at_start("beginning", begun, lambda: self._in_numpy(kind, place, None))
        return found

    def derivative(
        self, kind: Kind, place: Place, expected: Array | None = None, native: bool = False
    ) -> Derivative | Held:
        """Compute a derivative for steps of a kind, about as long as one from there."""
        replay = self._deriving(kind, place) if native else None
        if replay is None:
            return self._in_numpy(kind, place, expected)
        return replay.derive(self._problem, self._seen(place, expected))

    def _in_numpy(self, kind: Kind, place: Place, expected: Array | None) -> Derivative:
        problem, at = self._problem, self._seen(place, expected)
        return taken_at(computed(problem, kind.increments(problem), False, *at), problem, *at)

    def _seen(self, place: Place, expected: Array | None) -> tuple[float, Array, Array, Array | None]:
        """Return where a derivative is taken, with the strains that are seen there if none are expected."""
        problem, (t, q, v, _) = self._problem, place
        if problem.strains is not None and expected is None:
            expected = problem.strains.seen(q[None])[0]
        return t, q, v, expected

    def taken_again(self, kind: Kind, taken: Array, h: float, native: bool) -> Derivative | Held:
        """Compute a derivative where one was taken."""
        (t, q, v, expected), angles = place_of(self._problem, taken)
        with self._problem.turns.supposed(t, angles):
            return self.derivative(kind, Place(t, q, v, h), expected, native)

    def _deriving(
        self, kind: Kind, place: Place, known: Derivative | Held | None = None
    ) -> Replay | None:
        """Return the recording of a kind of steps and their derivatives."""
        if self._problem.by_differences and len(place.q) > MOST_DIFFERENCES:
            return None
        return self._recorded((kind, None), place, None, known)

    def _recorded(
        self, key: tuple[Kind, Any], place: Place, given: Derivative | None, known: Any = None
    ) -> Replay | None:
        def make() -> Replay:
            start = known if isinstance(known, Derivative) else None
            return Replay(key[0], Recorded(self._problem.apart(), key[0], place, given, start), given)

        return self._problem.recordings.made(key, make)


class Replay:
    """Recorded steps of a kind at work.

    Attributes
    ----------
    kind : Kind
    recorded : Recorded
    thread : int
        Whose memory it works on.
    derives : bool
        Whether the derivative is among what is recorded.
    held : Derivative, Held or None
        The derivative in the memory of the recording.
    """

    def __init__(self, kind: Kind, recorded: Recorded, given: Derivative | None) -> None:
        self.kind, self.recorded, self.derives = kind, recorded, given is None
        self.thread = get_ident()
        self.held: Derivative | Held | None = given
        self._prepared = np.nan
        """Length of the step that corrections are ready for."""

    @property
    def a(self) -> Array:
        """Accelerations at the stages, shape (s, n)."""
        return self.recorded.a

    @property
    def whole(self) -> bool:
        """Whether all that is done in steps is recorded: derivatives, the projection, the turns of angles."""
        return self.derives and self.recorded.whole

    def march(
        self, problem: Problem, place: Place, rule: Array, state: State,
        start: Array | None = None, guess: Array | None = None, room: int = 0,
    ) -> Ahead:  # fmt: skip
        """Make ordinary steps, as many as there is room for, and try one more.

        Parameters
        ----------
        problem : Problem
            That of the run.
        place : Place
        rule, state
            As in `hfsim.integrators._ordinary`.
        start : ndarray, shape (n,), optional
            Accelerations at the start, if they are known.
        guess : ndarray, shape (s, n), optional
            Accelerations at the stages to begin with.
        """
        step, counts, held = self.recorded, problem.counts, self.held
        assert held is not None
        step.begin(place)
        if start is not None:
            step.a0[...] = start
        if guess is not None:
            step.run(*([] if start is not None else ["start"]), "guess")
            step.a[...] = guess
        known = 2.0 if guess is not None else float(start is not None)
        state = state._replace(known=known, ready=self._prepared, fastest=held.fastest)
        self.held = None
        ahead = step.march(rule, state, room)
        last = ahead.tried or ahead.state
        self._prepared = last.ready
        if not ahead.failed:
            if last.renewed:  # what was held is no longer there, also for one whom a signal ends here
                self._take(problem, int(last.renewed))
            else:
                self.held = held
        count, begun = int(last.total), int(last.begun)
        counts.iterations += count
        counts.calls += count + begun
        counts.evaluations += count * len(step.a) + begun
        counts.native += int(last.made)
        return ahead

    def before(self, problem: Problem, ahead: Ahead) -> Held:
        """Return the derivative that ordinary steps ended with, before one more was tried."""
        if isinstance(self.held, Held) and np.array_equal(ahead.taken, self.held.taken):
            return self.held
        return Held(self, ahead.state.fastest, ahead.taken, problem.often.chosen)

    def middle(self, problem: Problem, place: Place, known: Array | None) -> Middle:
        """Return the stage in the middle of a step as it is guessed; parameters are those of `attempt`."""
        self.recorded.run(*self._begin(problem, place, known), "middle")
        return Middle(*self.recorded.taken())

    def started(self) -> Array:
        """Return the accelerations at the start of the last step."""
        return self.recorded.a0.copy()

    def end(self) -> End:
        """Return what the last step leads to."""
        return self.recorded.result()

    def derive(self, problem: Problem, at: tuple[float, Array, Array, Array | None]) -> Held:
        """Compute a derivative and hold it."""
        self.held, self._prepared = None, np.nan
        self.recorded.derive(at)
        return self._take(problem)

    def holds(self, problem: Problem, derivative: Derivative | Held) -> bool:
        """Tell whether a derivative is held, after it was brought here if it fits."""
        if derivative is self.held:
            return True
        if isinstance(derivative, Derivative):
            if form(derivative) != form(self.recorded.template):
                return False
            self.recorded.put(derivative)
        elif derivative.replay.kind == self.kind:
            at, angles = place_of(problem, derivative.taken)
            with problem.turns.supposed(at[0], angles):
                self.recorded.derive(at)
        else:
            return False
        self.held, self._prepared = derivative, np.nan
        return True

    def _begin(self, problem: Problem, place: Place, known: Array | None) -> list[str]:
        """Go to another step; return how it begins."""
        self.recorded.begin(place)
        if known is not None:
            self.recorded.a0[...] = known
            return ["guess"]
        problem.count(self.recorded.a0[None])
        return ["start", "guess"]

    def _take(self, problem: Problem, count: int = 1) -> Held:
        """Take note of the derivative that was computed, the last one of some."""
        fastest = float(self.recorded.frequency)
        problem.counts.factorisations += count
        if not isfinite(fastest):
            raise np.linalg.LinAlgError("the derivative is not finite")
        held = self.held = Held(self, fastest, self.recorded.taken_at.copy(), problem.often.chosen)
        return held
