"""Explicit Runge-Kutta-Nystrom steps, all of them native where that pays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hfsim.integrators._base import SPAN_OF_POINTS, Attempt, Integrator, Stability, Stepper
from hfsim.integrators._iteration import End, Place
from hfsim.integrators._lengths import FAINT, ROUGH, RUNGS, SHRUNK, TARGET, factor, fitted
from hfsim.integrators._nystrom import Nystrom, Step, order_6, order_8
from hfsim.integrators._ordinary import END, LONGEST, REACH, Ahead, Rule, State
from hfsim.integrators._problem import Problem
from hfsim.integrators._staged import UNKNOWN, Staged
from hfsim.maths.arrays import Array
from hfsim.mechanics.projection import MOST, ROUNDING
from hfsim.mechanics.turns import NEAR

GROWTH = 4.0
"""How much longer a step may be than the one before."""
REGROWTH = 1.005
"""How much longer a step may be than the last limit, which was set by one too long, to the power of the
number of steps since."""
MOST_SERVED = 100_000
"""Steps from which such a limit is none any more, and powers of numbers end."""
STEPS = "explicit steps"
"""By what they are told from others where functions are chosen that are replayed."""


@dataclass(frozen=True)
class Explicit:
    """An explicit method with projection.

    Attributes
    ----------
    tolerance : float
        Local error per step, relative above 1.
    step : float or None
        A fixed one [s].
    """

    tolerance: float
    step: float | None = None
    name: str = "explicit"
    stages: int | None = None

    def table(self, problem: Problem) -> Nystrom:
        """Return that of its steps in a scene; fixed ones are of one order in all."""
        composed = problem.positional and self.tolerance >= ROUGH and self.step is None
        return order_6() if composed else order_8()

    def start(
        self, problem: Problem, t: float, q: Array, v: Array, known: Array | None = None
    ) -> ExplicitStepper:
        """Return what makes the steps from an initial state, whose accelerations may be known."""
        return ExplicitStepper(self, problem, t, q, v, known)


class ExplicitStepper(Stepper):
    """An explicit method at work; its first step is cautious."""

    remembers = ("_known", "_cap", "_served")

    def __init__(
        self, method: Explicit, problem: Problem, t: float, q: Array, v: Array, known: Array | None
    ) -> None:
        self.name, self._tolerance, self._problem = method.name, method.tolerance, problem
        self._table = table = method.table(problem)
        self.spans = SPAN_OF_POINTS * len(table.nodes)
        self._known: Array = problem.single(t, q, v) if known is None else known
        size = float((np.abs(self._known) / (1.0 + np.abs(q))).max())
        self.first = float(self._tolerance ** (1.0 / table.order)) / float(np.sqrt(max(size, 1.0)))
        self._end = 0 if problem.project is not None else table.end
        """Number of the stage that is the start of the next step; 0: none."""
        self._last, self._tried, self._cap, self._served = UNKNOWN, False, np.inf, 0
        closings, never = MOST if problem.project is not None else 0, np.inf
        self._rule = Rule(
            goal=0.0, near=0.0, last_digit=0.0, linear=0.0, most=0.0, tolerance=self._tolerance, reach=0.0,
            target=TARGET, power=1.0 / table.order, faint=FAINT, rungs=RUNGS, end=0.0, resolved=never,
            stiff=0.0, serves=never, serves_well=never, shrunk=SHRUNK, steady=0.0, regrowth=REGROWTH,
            at_end=self._end, rounding=ROUNDING, closings=closings, turned=NEAR, longest=0.0,
            growths=np.array([never, GROWTH]),
        ).told()  # fmt: skip

    def attempt(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        """Make one step of length h and estimate its error."""
        place = Place(t, q, v, h)
        steps = self._steps(place)
        self._made_natively = steps is not None
        end = self._in_numpy(place) if steps is None else self._natively(steps, place)
        error = max(float(end.error), self.reach * float(end.rate_error)) / self._tolerance
        growth = factor(error, self._table.order - 1, np.inf if error > 1.0 else min(GROWTH, self._cap / h))
        if error > 1.0:
            self._cap, self._served = h * min(max(growth, 0.1), 0.9), 0
        return Attempt(error, growth, *end[:3], end.closed, end.seen)

    def ahead(self, t: float, q: Array, v: Array, h: float, end: float, room: int) -> Ahead | None:
        """Make ordinary steps natively, and one more attempt, of which `attempt` then tells."""
        place = Place(t, q, v, fitted(h, end - t))
        steps = self._steps(place)
        if steps is None or not steps.whole:
            return None
        ahead = self._march(steps, place, h, end, room)
        if len(ahead.rows):
            steps.tell(self._problem.turns)
            self._known = steps.a0.copy() if self._end else UNKNOWN
        self._tried = ahead.tried is not None
        return ahead

    def accept(self, t: float, q: Array, v: Array) -> None:
        """Take note of the accelerations at the end, if they are known."""
        self._problem.counts.native += self._made_natively
        self._known, self._served = self._last, self._served + 1
        self._cap *= REGROWTH ** min(self._served, MOST_SERVED)

    def cross(self) -> None:
        """Find the accelerations behind a break anew: they may have jumped."""
        self._known = UNKNOWN

    def _steps(self, place: Place) -> Staged | None:
        """Return what makes steps natively, from when enough are to come."""
        problem, often = self._problem, self._problem.often
        often.need(STEPS, len(self._table.nodes) * often.rest(place.t) / place.h)
        if STEPS not in often.chosen:
            return None
        table, known = self._table, self._known
        return problem.recordings.made((STEPS, table), lambda: Staged(problem.apart(), table, place, known))

    def _natively(self, steps: Staged, place: Place) -> End:
        if not self._tried:
            self._march(steps, place)
        self._tried = False
        self._last = steps.a[self._end - 1].copy() if self._end else UNKNOWN
        self._known = steps.a0.copy()
        return steps.result()

    def _march(
        self, steps: Staged, place: Place, wish: float = 0.0, end: float = np.inf, room: int = 0
    ) -> Ahead:
        rule, counts = self._rule, self._problem.counts
        rule[REACH], rule[END], rule[LONGEST] = self.reach, end, self.longest
        steps.begin(place)
        if len(self._known):
            steps.a0[...] = self._known
        known = float(len(self._known) > 0)
        ahead = steps.march(rule, State(known, 0.0, self._served, self._cap, wish or place.h), room)
        last = ahead.tried or ahead.state
        self._cap, self._served = ahead.state.cap, int(ahead.state.served)
        made = int(last.total)
        counts.calls, counts.evaluations = counts.calls + made, counts.evaluations + made
        counts.native += int(last.made)
        return ahead

    def _in_numpy(self, place: Place) -> End:
        step = Step(self._problem, self._table, place)
        if not len(self._known):
            self._known = self._problem.single(*place[:3])
        a = step.stages(self._known)
        self._last = a[self._end - 1] if self._end else UNKNOWN
        return step.end(a)


def amplification(y: Array, order: int | None = None) -> Array:
    """Return |R(iy)|, R(z) = 1 + sum_k b A^k 1 z^(k+1), for y = w h."""
    table = order_8()
    R, power, step = np.ones(len(y), dtype=complex), np.ones(len(table.b)), 1j * y
    for k in range(12):
        R = R + float(table.b @ power) * step ** (k + 1)
        power = table.A @ power
    return np.abs(R)


EXPLICIT = Integrator(
    lambda solve: Explicit(solve.tolerance, solve.step),
    Stability("stable up to wh = 6", amplification),
    rank=6,
)
