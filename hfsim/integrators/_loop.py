"""The loop around the steps, which all methods share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from math import inf, isfinite
from typing import Any

import numpy as np

from hfsim.errors import HfsimError, LimitReached, SolverFailure
from hfsim.integrators._base import Attempt, Limits, Method, Stepper, unsolved
from hfsim.integrators._lengths import SAME_TIME, fitted, stretches
from hfsim.integrators._memory import Memory, packed, unpacked
from hfsim.integrators._ordinary import AT_ONCE, keep_all
from hfsim.integrators._pace import Pace
from hfsim.integrators._problem import Problem
from hfsim.integrators._trajectory import Segment, Trajectory, Watch
from hfsim.maths.arrays import Array, are_finite

EDGES = 3
"""Attempts from one state that end at the edge they have met: each may meet it again a little earlier."""
SHORT, SHORTEST = 1e-6, 1e-11
"""Step lengths, relative to the duration: below the first a known cause ends the run, below the second the
run has failed whatever the cause."""
AHEAD = 1e-4
"""Length of a step, relative to the duration, up to which what lies at its end is to blame."""


class Stepping:
    """The steps from a state to a time, each made when it is asked for.

    Iterating gives the last of those that were made at once, as ordinary ones are; it ends at ``t_end``, or
    when something has stopped the run.  In between the run can be put down: another one of the same problem,
    method and start that recalls its memory makes the same steps, to the last bit.

    Parameters
    ----------
    problem : Problem
    method : Method
    start : (t, q, v)
    t_end : float
    limits : Limits
    watch : callable
        Called with (t, q, v) of every kept step's end; may raise to end the run.

    Attributes
    ----------
    path : Trajectory
        The steps kept so far, since the last recall; its end is where the next one starts.
    stop : exception or None
        What ended the run before ``t_end``: `SolverFailure`, `LimitReached` or KeyboardInterrupt.
    """

    def __init__(
        self,
        problem: Problem,
        method: Method,
        start: tuple[float, Array, Array],
        t_end: float,
        limits: Limits,
        watch: Watch,
    ) -> None:
        self.path = Trajectory(start[0], *start)
        self.stop: HfsimError | KeyboardInterrupt | None = None
        self._problem, self._method, self._limits, self._watch = problem, method, limits, watch
        self._t_end, self._duration = t_end, t_end - start[0]
        self._almost = t_end * (1.0 - SAME_TIME)
        self._breaks = stretches(problem.breaks, start[0], t_end)
        self._pace = Pace(start[0], t_end)
        self._stepper: Stepper | None = None
        self._wish, self._reach, self._period, self._behind_break = 0.0, 0.0, inf, False
        self._stretch, self._break = (start[0], start[0]), start[0]
        problem.count_on(len(start[1]), start[0], t_end)
        self._kept = self._memories()

    def __iter__(self) -> Stepping:
        return self

    def __next__(self) -> Segment:
        """Make a step, or ordinary ones at once, and return the last.

        Raises
        ------
        StopIteration
            At the end, or where no step could be made.
        """
        if self.stop is not None or self._at_end:
            raise StopIteration
        made = len(self.path.segments)
        try:
            with np.errstate(all="ignore"):
                self._step()
                self._watch(self.path.t_end, self.path.q, self.path.v)
        except (SolverFailure, LimitReached, KeyboardInterrupt) as stop:
            self.stop = stop
            self._drop_unkept()
        if self.stop is not None or self._at_end:
            if self.stop is None:
                # what happens right there
                self._problem.edges.keep(self.path.t_end, self.path.q, self.path.v)
            self._problem.turns.end()
        if len(self.path.segments) == made:
            raise StopIteration
        return self.path.segments[-1]

    @property
    def _at_end(self) -> bool:
        return self.path.t_end >= self._almost

    @property
    def on_the_brink(self) -> bool:
        """Whether the last step has ended at a break, and the next takes first what happens there."""
        return not self._at_end and self.path.t_end >= self._stretch[1]

    def memory(self) -> Memory:
        """Return all that the steps after the last kept one depend on; valid between any two steps.

        A step that was interrupted leaves nothing in it.
        """
        return packed({owner: memory() for owner, memory in self._kept.items()})

    def recall(self, memory: Mapping[str, Array]) -> None:
        """Take up a run where its memory was taken, its counts included."""
        kept = {owner: unpacked(memory, owner) for owner in self._kept}
        self._kept = {owner: one.copy for owner, one in kept.items()}
        state = kept["state"]
        t, q, v = state["t"], state["q"], state["v"]
        self.path, self.stop, self._stepper = Trajectory(t, t, q, v), None, None
        self.path.methods.extend(map(str, state["methods"]))
        self._pace.recall(kept["pace"])
        k = int(np.searchsorted(self._breaks, t))
        self._go_into(max(k - 1, 0), k)
        self._problem.counts.recall(kept["counts"])

    def _memories(self) -> dict[str, Callable[[], dict[str, Any]]]:
        """Return what tells the memories of now, by owner."""
        path, problem, stepper = self.path, self._problem, self._stepper
        state = {"t": path.t_end, "q": path.q, "v": path.v, "methods": tuple(path.methods)}
        kept = {"state": state.copy, "pace": self._pace.kept(), "counts": problem.counts.kept()}
        kept |= {"often": problem.often.kept(), "stepper": dict, "turns": dict, "edges": dict}
        if stepper is not None:
            own, wish, reach = stepper.kept(), self._wish, self._reach
            kept["stepper"] = lambda: {"wish": wish, "reach": reach} | own()
            kept["turns"], kept["edges"] = problem.turns.kept(), problem.edges.kept()
        return kept

    def _drop_unkept(self) -> None:
        """Go back to the last kept step: an interruption may come anywhere."""
        path, state = self.path, self._kept["state"]()
        path.t_end, path.q, path.v = state["t"], state["q"], state["v"]
        while path.segments and path.segments[-1].t >= path.t_end:
            path.segments.pop()
        self._problem.often.recall(self._kept["often"]())
        if turns := self._kept["turns"]():
            self._problem.turns.recall(turns["now"])
        self._problem.edges.recall(self._kept["edges"]())

    def _step(self) -> None:
        """Make attempts until a step is kept; raise what prevents that."""
        path, fixed, most = self.path, self._limits.step, self._limits.max_steps
        stepper = self._stepper or self._begin()
        if self.on_the_brink:
            stepper = self._enter(stepper)
        stepper.period = self._period
        steps, made, edges = path.segments, len(path.segments), 0
        while len(steps) == made:
            if self._ahead(stepper):
                return
            made, edges = len(steps), edges if len(steps) == made else 0
            if most is not None and self._problem.counts.steps >= most:
                raise LimitReached(f"{most} steps were made", path.t_end)
            wish = fixed or min(self._wish, stepper.longest)
            h = fitted(wish, self._stretch[1] - path.t_end, fixed is not None)
            attempt = self._attempt(stepper, h)
            if fixed is not None and not attempt.solved:  # asked again, a method may know another way
                attempt = self._attempt(stepper, h)
            if not attempt.solved or (fixed is None and attempt.error > 1.0):
                self._wish = self._shortened(attempt, h)
                if self._behind_break and stepper.looks_back:
                    stepper = self._restarted()
                    self._wish = min(self._wish, stepper.first)
                continue
            tried = Segment(path.t_end, h, path.q, path.v, attempt.series)
            has_edges = fixed is None and h > SHORT * self._duration
            if has_edges and (early := self._problem.edges.first(tried)) < h:
                edges, self._problem.counts.rejected = edges + 1, self._problem.counts.rejected + 1
                self._pace.note(path.t_end, True, False)
                self._wish = early if edges <= EDGES else min(early, 0.5 * h)
                continue
            if h >= 0.5 * self._wish:
                self._wish = float(h * min(max(attempt.growth, 0.2), 5.0))
            self._keep(stepper, attempt, tried)

    def _ahead(self, stepper: Stepper, most: int | None = None) -> bool:
        """Keep ordinary steps that are made at once; tell whether some are, and no more is known."""
        path, limits, counts, end = self.path, self._limits, self._problem.counts, self._stretch[1]
        before, most = len(path.segments), most or AT_ONCE
        room = most if limits.max_steps is None else min(most, limits.max_steps - counts.steps)
        if room < 1 or limits.step is not None or not self._problem.plain:
            return False
        self._kept = self._memories()
        ahead = None
        with suppress(np.linalg.LinAlgError):  # the attempt that follows will raise it again
            ahead = stepper.ahead(path.t_end, path.q, path.v, min(self._wish, stepper.longest), end, room)
        if ahead is None:
            return False
        self._wish = ahead.state.wish
        stop = keep_all(ahead, path, self._problem, self._pace, self._watch)
        path.t_end = self._break if path.t_end == end else path.t_end
        if isinstance(stop, SolverFailure):
            self._remember_again(stepper, len(path.segments) - before)
        elif len(ahead.rows):
            self._name(stepper)
            self._kept, self._behind_break = self._memories(), False
        if stop is not None:
            raise stop
        return len(ahead.rows) > 0 and ahead.tried is None

    def _remember_again(self, stepper: Stepper, made: int) -> None:
        """Make so many steps anew, the first of those that were made at once: memories are of the last."""
        self._drop_unkept()
        stepper.recall(kept := self._kept["stepper"]())
        self._wish = kept["wish"]
        self._pace.recall(self._kept["pace"]())
        self._problem.counts.recall(self._kept["counts"]())
        if made:
            self._ahead(stepper, made)

    def _begin(self) -> Stepper:
        """Start the method, or take it up where it was put down."""
        remembered, turns, path = self._kept["stepper"](), self._problem.turns, self.path
        if remembered:
            turns.recall(self._kept["turns"]()["now"])
            self._problem.edges.recall(self._kept["edges"]())
        else:
            turns.start(path.t_end, path.q, path.v)
            self._problem.edges.start(path.t_end, path.q, path.v)
        stepper = self._started()
        self._wish = stepper.first
        if remembered:
            stepper.recall(remembered)
            self._wish = remembered["wish"]
            self._reach = stepper.reach = remembered["reach"]
            self._problem.counts.recall(self._kept["counts"]())
            self._problem.often.recall(self._kept["often"]())
        self._stepper = stepper
        return stepper

    def _enter(self, stepper: Stepper) -> Stepper:
        """Go on into the stretch of time up to the next break; return what makes the steps there."""
        t, fixed, before = self.path.t_end, self._limits.step, self._reach
        k = int(np.searchsorted(self._breaks, t, side="right"))
        self._go_into(k - 1, k)
        self._behind_break = k > 1
        if self._behind_break:
            stepper.cross()
            if self._problem.edges.keep(t, self.path.q, self.path.v):
                stepper = self._restarted()
                self._wish = stepper.first
        reach = min(max(fixed or self._wish, before), self._t_end - t)
        stepper.reach = self._reach = reach if reach > self._stretch[1] - t else 0.0
        changes = fixed is not None or bool(before) != bool(self._reach)
        if self._behind_break and stepper.looks_back and changes:
            stepper = self._restarted()
            self._wish = stepper.first
        return stepper

    def _go_into(self, begin: int, end: int) -> None:
        self._break, last = float(self._breaks[end]), end == len(self._breaks) - 1
        # what jumps at a break is of the next stretch: the last stage of a step up to it sees what was before
        self._stretch = float(self._breaks[begin]), self._break - (0.0 if last else SAME_TIME * self._t_end)
        self._period, self._pace.t_end = self._problem.period(*self._stretch), self._stretch[1]

    def _restarted(self) -> Stepper:
        """Start the method anew, without what it remembers of the time before a break."""
        self._stepper, self._behind_break = self._started(), False
        self._stepper.reach, self._stepper.period = self._reach, self._period
        return self._stepper

    def _name(self, stepper: Stepper) -> None:
        if stepper.label not in self.path.methods:
            self.path.methods.append(stepper.label)

    def _started(self) -> Stepper:
        path = self.path
        try:
            stepper = self._method.start(self._problem, path.t_end, path.q, path.v)
            if isfinite(stepper.first):
                return stepper
        except np.linalg.LinAlgError:
            pass
        raise self._culprit(0.0) or SolverFailure("the accelerations at the start are not finite", path.t_end)

    def _attempt(self, stepper: Stepper, h: float) -> Attempt:
        """Try a step and move its end onto the constraints."""
        problem, path = self._problem, self.path
        try:
            attempt = stepper.attempt(path.t_end, path.q, path.v, h)
            if not attempt.solved:
                return attempt if isfinite(attempt.growth) else unsolved()
            if attempt.error > 1.0 and self._limits.step is None:
                return attempt
            if not are_finite(attempt.q, attempt.v) or not problem.admissible(attempt.q):
                return unsolved()
            if problem.project is not None and not attempt.closed:
                end, rate = problem.project(np.array([path.t_end + h]), attempt.q[None], attempt.v[None])
                attempt = attempt._replace(q=end[0], v=rate[0])
            if problem.turns:
                tried = Segment(path.t_end, h, path.q, path.v, attempt.series)
                if item := problem.turns.strays(tried, attempt.q, attempt.v, attempt.seen):
                    return self._strayed(item, h)
            return attempt
        except np.linalg.LinAlgError:
            return unsolved()

    def _strayed(self, item: str, h: float) -> Attempt:
        """Return the outcome of a step in which turns could not be counted.

        Raises
        ------
        SolverFailure
            If it cannot be made shorter.
        """
        if self._limits.step is None:
            return unsolved()
        why = f"the turns of the angle of {item} cannot be counted in a step of {h:.4g} s"
        cause = "it leaves the motion at the start of the step by more than a quarter of a turn"
        raise SolverFailure(why, self.path.t_end, item, remedy="take a shorter step", cause=cause)

    def _keep(self, stepper: Stepper, attempt: Attempt, tried: Segment) -> None:
        path, h, end = self.path, tried.h, self._stretch[1]
        t = self._break if h == end - path.t_end else path.t_end + h
        self._name(stepper)
        stepper.accept(t, attempt.q, attempt.v)
        self._problem.counts.steps += 1
        if self._limits.step is None:
            self._pace.note(t, False, False)
        path.segments.append(tried)
        path.t_end, path.q, path.v = t, attempt.q, attempt.v
        self._problem.turns.keep(t)
        self._behind_break = False
        if self._problem.edges.keep(t, path.q, path.v, None if self._limits.step is None else tried):
            self._wish = self._restarted().first
        self._rechart()
        self._problem.often.expect(t, h, self._wish)
        self._kept = self._memories()

    def _rechart(self) -> None:
        """Go on in other coordinates where the state is at the edge of its own; steps before keep theirs."""
        recharted = self._problem.recharted
        moved = None if recharted is None else recharted(self.path.q, self.path.v)
        if moved is not None:
            self.path.q, self.path.v = moved
            stepper = self._restarted()
            self._wish = min(self._wish, stepper.first) if stepper.looks_back else self._wish

    def _shortened(self, attempt: Attempt, h: float) -> float:
        """Return the step to try after one that was not kept.

        Raises
        ------
        SolverFailure
            If none would do.
        """
        problem, path, pace = self._problem, self.path, self._pace
        if self._limits.step is not None:
            why = f"the equations of a step of {h:g} s could not be solved"
            breakdown = self._culprit(h) or problem.breakdown(path.t_end, path.q)
            raise breakdown or SolverFailure(why, path.t_end)
        problem.counts.rejected += 1
        pace.note(path.t_end, True, not attempt.solved)
        short = h < AHEAD * self._duration
        if pace.doubtful and (cause := self._culprit(h if short else 0.0)) is not None:
            raise cause
        wish = h * min(max(attempt.growth, 0.1), 0.9)
        self._refuse_collapse(wish)
        return wish

    def _refuse_collapse(self, wish: float) -> None:
        """Raise the cause when steps have become too short to go on."""
        shortest = max(SHORTEST * float(np.ptp(self._stretch)), float(np.spacing(self._t_end)))
        if wish > max(SHORT * self._duration, shortest):
            return
        if (cause := self._problem.breakdown(self.path.t_end, self.path.q)) is not None:
            raise cause
        if wish < shortest:
            why = f"the step length fell below {shortest:.2g} s"
            raise SolverFailure(why, self.path.t_end)

    def _culprit(self, h: float) -> SolverFailure | None:
        """Return what is not finite where a step begins, or just ahead of it."""
        t, q, v = self.path.t_end, self.path.q, self.path.v
        found = self._problem.culprit
        return found(t, q, v) or (found(t + h, q + h * v, v) if h else None)
