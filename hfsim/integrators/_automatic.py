"""What stands for ``auto``: explicit steps where few of them make a run, collocation else."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from hfsim.integrators._base import Attempt, Options, Stepper
from hfsim.integrators._lengths import ROUGH
from hfsim.integrators._ordinary import Ahead
from hfsim.integrators._problem import Problem
from hfsim.integrators.collocation import CollocationMethod, automatic
from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen

FEW = {False: (60.0, 300), True: (300.0, 1000)}
"""Angle by which the fastest mode may turn in a run of explicit steps [rad], and how many of these may follow
at the pace of the last ones, by whether derivatives cost as much as many accelerations."""
SPINNING = {False: (600.0, 4000), True: (3000.0, 10000)}
"""The same where rigid bodies spin in space: steps of collocation are no longer then."""
BENDING = (600.0, 300)
"""The same where bodies bend, and explicit steps are rough."""
LOOK = 16
"""Steps after which that is looked at."""
IN_A_ROW = {False: 3, True: 2}
"""Attempts that fail one after another from which it is not either, by whether there are loops: close to
where these lose their rank explicit steps get ever shorter, and nothing gets across any more."""
SHARPER = {False: 1e-3, True: 1e-4}
"""Tolerance of explicit steps, over that of collocation, which errors then keep, by whether bodies spin that
often."""
SPIN = (0.5, 2.5)
"""Rate at which accelerations follow velocities, over that at which they follow positions, where bodies spin:
both are about that of the spin.  Springs make less of the first, dampers more; at a third it takes as long
either way."""
FINEST, FINEST_OF_LOOPS = 1e-8, 1e-6
"""Tolerance below which theirs would be rounding, or so close to it that steps do not get across positions
where loops lose their rank."""
SMALL = 1e-6
"""Size of a disturbance."""


@frozen
class Automatic:
    """Explicit steps where few of them make a run, collocation else.

    Attributes
    ----------
    usual : CollocationMethod
    """

    usual: CollocationMethod

    @property
    def name(self) -> str:
        """That of collocation."""
        return self.usual.name

    @property
    def stages(self) -> int:
        """Those of collocation."""
        return self.usual.stages

    def start(self, problem: Problem, t: float, q: Array, v: Array) -> Stepper:
        """Return what makes the steps from an initial state."""
        rigid = problem.rigid and self.usual.tolerance >= (FINEST_OF_LOOPS if problem.loops else FINEST)
        if rigid or (problem.positional and self.usual.tolerance >= ROUGH):
            return AutomaticStepper(self, problem, t, q, v)
        return self.usual.start(problem, t, q, v)


class AutomaticStepper(Stepper):
    """One of two methods at work: once collocation, always collocation."""

    remembers = ("_explicit", "_spinning", "_made", "_since")

    def __init__(self, method: Automatic, problem: Problem, t: float, q: Array, v: Array) -> None:
        self._method, self._problem, self._start = method, problem, (t, q, v)
        self._made, self._failed, self._since, self._spinning = 0, 0, t, False
        self._take(*self._begun())
        self.first, self._label = self._now.first, self._now.label

    @property
    def label(self) -> str:
        """That of the method of the last attempt."""
        return self._label

    @property
    def longest(self) -> float:
        """That of the method at work [s]."""
        return self._now.spans * self.period

    def attempt(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        """Try a step of length h; go over to collocation if explicit ones fail."""
        attempt = self._attempted(t, q, v, h)
        self._label = self._now.label
        return attempt

    def _attempted(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        self._now.reach, self._now.period = self.reach, self.period
        if not self._explicit:
            return self._now.attempt(t, q, v, h)
        try:
            attempt = self._now.attempt(t, q, v, h)
            self._failed += attempt.error > 1.0
            if attempt.solved and self._failed < IN_A_ROW[self._problem.loops]:
                return attempt
        except np.linalg.LinAlgError:
            pass
        self._go_over(t, q, v)
        return self._now.attempt(t, q, v, h)

    def ahead(self, t: float, q: Array, v: Array, h: float, end: float, room: int) -> Ahead | None:
        """Make ordinary steps natively, explicit ones as many as may be before it is looked at the pace."""
        self._now.reach, self._now.period = self.reach, self.period
        if self._explicit:
            room = min(room, LOOK - self._made % LOOK)
        ahead, self._label = self._now.ahead(t, q, v, h, end, room), self._now.label
        if self._explicit and ahead is not None and len(ahead.rows):
            last, n = ahead.rows[-1], len(q)
            self._made += len(ahead.rows) - 1
            self._count(ahead.t, last[3 : n + 3], last[n + 3 : 2 * n + 3])
        if ahead is not None:
            self._failed = int(ahead.state.rejected) + (0 if len(ahead.rows) else self._failed)
        return ahead

    def accept(self, t: float, q: Array, v: Array) -> None:
        """Take note of a step that was kept."""
        self._now.accept(t, q, v)
        if self._explicit:
            self._count(t, q, v)

    def cross(self) -> None:
        """Take note of a break."""
        self._now.cross()

    def kept(self) -> Callable[[], dict[str, Any]]:
        """Return what tells the memory of now."""
        own, now = super().memory(), self._now.kept()
        return lambda: own | now()

    def memory(self) -> dict[str, Any]:
        """Return which method is at work, how it gets on, and its memory."""
        return self.kept()()

    def recall(self, memory: Mapping[str, Any]) -> None:
        """Go on as the one did whose memory this is."""
        before, self._failed = (self._explicit, self._spinning), 0
        super().recall(memory)
        if (self._explicit, self._spinning) != before:
            begin = self._begin if self._explicit else self._method.usual.start
            self._take(begin(self._problem, *self._start), self._explicit)
        self._now.recall(memory)

    def _count(self, t: float, q: Array, v: Array) -> None:
        """Count an explicit step; go over to collocation if too many follow at the pace of the last ones."""
        self._made, self._failed = self._made + 1, 0
        if self._made % LOOK == 0:
            pace, self._since = (t - self._since) / LOOK, t
            if self._problem.often.rest(t) > self._few(self._spinning)[1] * pace:
                self._go_over(t, q, v)

    def _go_over(self, t: float, q: Array, v: Array) -> None:
        self._take(self._method.usual.start(self._problem, t, q, v), False)

    def _take(self, stepper: Stepper, explicit: bool) -> None:
        self._now, self.name, self._explicit = stepper, stepper.name, explicit

    def _few(self, spinning: bool) -> tuple[float, int]:
        """Return the angle and the number of steps up to which these are explicit."""
        problem = self._problem
        if not problem.rigid:
            return BENDING
        return (SPINNING if spinning else FEW)[problem.slopes is not None and problem.slopes.pays]

    def _begun(self) -> tuple[Stepper, bool]:
        """Return what makes the steps, and whether that is by explicit ones: if few make the run."""
        problem, start = self._problem, self._start
        rest, turning = problem.often.rest(start[0]), problem.rigid and problem.spatial and not problem.loops
        with suppress(np.linalg.LinAlgError):
            found = self._followed(self._few(turning)[0] / rest)
            if found is not None:
                self._spinning = max(found.by_position, found.by_velocity) * rest > self._few(False)[0]
                if not self._spinning or found.spins:
                    return self._begin(problem, *start, found.a), True
        return self._method.usual.start(problem, *start), False

    def _begin(self, problem: Problem, t: float, q: Array, v: Array, a: Array | None = None) -> Stepper:
        """Return what makes explicit steps from a state whose accelerations may be known."""
        from hfsim.integrators.explicit import Explicit  # few scenes need it

        sharper = SHARPER[self._spinning] if problem.rigid else 1.0
        return Explicit(sharper * self._method.usual.tolerance).start(problem, t, q, v, a)

    def _followed(self, most: float) -> Followed | None:
        """Return what `followed` does at the start."""
        problem, (t, q, v) = self._problem, self._start
        begun = t, q.tobytes(), v.tobytes(), most
        found: Followed | None = problem.at_start("followed", begun, lambda: followed(problem, t, q, v, most))
        return found


class Followed(NamedTuple):
    """Accelerations (n,), and the rates at which they follow positions and velocities [rad/s]."""

    a: Array
    by_position: float
    by_velocity: float

    @property
    def spins(self) -> bool:
        """Whether that is as where bodies spin."""
        least, most = SPIN
        return least * self.by_position <= self.by_velocity <= most * self.by_position


def followed(problem: Problem, t: float, q: Array, v: Array, most: float) -> Followed | None:
    """Return how accelerations follow the state (n,) if they do at no more than so many radians a second.

    The first disturbance is any, the others are what it does to the accelerations: a power iteration.
    """

    def accelerations(*state: Array) -> Array:
        problem.count(state[0])
        return np.asarray(problem.acceleration(np.array([t, t]), *state))

    step = SMALL * np.cos(np.arange(1.0, len(q) + 1))
    a, changed = accelerations(np.array([q, q + step]), np.array([v, v]))
    size, change = np.linalg.norm(step), changed - a
    first = np.linalg.norm(change)
    if not first <= most**2 * size:
        return None
    if change.any():
        step = size / first * change
    changed = accelerations(np.array([q + step, q]), np.array([v, v + step]))
    second, velocity = np.linalg.norm(changed - a, axis=-1)
    found = Followed(a, float(np.sqrt(max(first, second) / size)), float(velocity / size))
    return found if max(found.by_position, found.by_velocity) <= most else None


def chosen(solve: Options, dissipates: bool) -> Automatic | CollocationMethod:
    """Return what stands for ``auto``; see `hfsim.integrators.choose`."""
    usual = automatic(solve, dissipates)
    free = solve.step is None and solve.stages is None and solve.tolerance >= FINEST
    return Automatic(usual) if free else usual
