"""The work after a run, within a budget: its error in time and of its mesh, and why it fails or is doubtful.

A signal ends the work, not the run: what is known by then stays, and nothing is made of what is not.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import field
from typing import Any, NamedTuple

from hfsim.errors import HfsimError, LimitReached, SolverFailure
from hfsim.marching.clock import PhaseClock
from hfsim.marching.distance import farthest
from hfsim.marching.stop import Budget, BudgetUsedError, Progress
from hfsim.maths.frozen import mutable
from hfsim.trust.estimate import Compared, Estimate, advice
from hfsim.trust.experiments import time_for

ESTIMATES = ("error_estimate", "mesh_error_estimate")
"""Keys of the estimates."""
AFTER = (*ESTIMATES, "diagnosis")
"""Phases of the work after a run."""
LARGE = 1e-2
"""Error in time, or of the mesh, from which a run warns [-]."""
MESH_TOLD = 1e-3
"""Mesh error [-] from which a run says what would help..."""
MESH_AHEAD = 100.0
"""...if it is that many times the time error."""
MANY = 200
"""Steps from which it is asked what they follow."""
INTERRUPTED = "interrupted"
"""Why something is not known that a signal has ended."""


class Wish(NamedTuple):
    """What is wanted after a run.

    Attributes
    ----------
    seconds : float or None
        CPU time that all of it may take [s]; without it as much as the run, or `AT_LEAST`.
    """

    time_error: bool = True
    mesh_error: bool = False
    diagnosis: bool = False
    seconds: float | None = None

    def allowed(self, seconds: float) -> float:
        """Return the CPU time allowed after a run that has taken some [s]."""
        if not any(self[:3]):
            return 0.0
        return time_for(seconds) if self.seconds is None else self.seconds


class Stages:
    """One progress over a run and the work after it, by the time that either takes.

    Parameters
    ----------
    progress : callable
        Told the share of the whole.
    """

    def __init__(self, progress: Progress, wish: Wish) -> None:
        self._progress, self._wish, self._start = progress, wish, time.process_time()
        self._solved = 1.0

    def solving(self, share: float) -> None:
        """Take the share of the run that is done."""
        whole = (time.process_time() - self._start) / max(share, 1e-9)
        self._solved = whole / (whole + self._wish.allowed(whole)) if whole > 0.0 else 1.0
        self._progress(share * self._solved)

    def after(self, share: float) -> None:
        """Take the share of the time allowed after the run that is used."""
        self._progress(self._solved + share * (1.0 - self._solved))

    def end(self) -> None:
        """Tell that all is done, which may take less than the time allowed."""
        # a budget that is used up by now ends nothing more
        with suppress(LimitReached):
            self._progress(1.0)


@mutable
class Aftermath:
    """What the work after a run finds.

    Attributes
    ----------
    run : Compared
        The run.
    clock : PhaseClock
        Gets a phase for each kind of work; knows that of the solution.
    stop : exception or None
        What stopped the run, with its cause as far as it was found.
    facts : dict
        For its statistics.
    interruption : KeyboardInterrupt or None
        What ended the work.
    """

    run: Compared
    wish: Wish
    clock: PhaseClock
    budget: Budget
    stop: HfsimError | KeyboardInterrupt | None = None
    facts: dict[str, Any] = field(default_factory=dict)
    interruption: KeyboardInterrupt | None = None

    def find(self, statistics: dict[str, Any]) -> None:
        """Do all that is wanted; of a run that failed, find the cause first."""
        self.stop = self.run.legs[-1].done.stop
        self.budget.spent = isinstance(self.stop, BudgetUsedError)
        work = [self._time_error, self._mesh_error]
        order = [self._diagnosis, *work] if isinstance(self.stop, SolverFailure) else [*work, self._diagnosis]
        for find in order:
            find(statistics)
        known = {self.facts[f"{name}_channel"]: self.facts[name] for name in ESTIMATES if self.facts[name]}
        self.facts["limiting_channel"] = farthest(known)[0] or None
        if large := [name for name in ESTIMATES if (self.facts[name] or 0.0) > LARGE]:
            self.facts["warnings"] = [*statistics["warnings"], *map(self._warning, large)]

    def _time_error(self, statistics: dict[str, Any]) -> None:
        from hfsim.trust.error import time_error

        self._estimate("error", self.wish.time_error, time_error)

    def _mesh_error(self, statistics: dict[str, Any]) -> None:
        from hfsim.trust.mesh import mesh_advice, mesh_error

        self._estimate("mesh_error", self.wish.mesh_error, mesh_error)
        mesh, time = (self.facts[name] for name in reversed(ESTIMATES))
        if mesh is not None and mesh > min(LARGE, max(MESH_TOLD, MESH_AHEAD * (time or 0.0))):
            self.facts["mesh_advice"] = mesh_advice(self.run.legs[-1].scene)

    def _estimate(self, name: str, wanted: bool, find: Callable[[Compared, Budget, float], Estimate]) -> None:
        reason = self._why_not(wanted)
        found = Estimate(None, reason)
        if not reason:
            with self._phase(f"{name}_estimate"):
                found = Estimate(None, INTERRUPTED)
                found = find(self.run, self.budget, self.clock.cpu["solve"])
        self.facts |= found.facts(name)

    def _diagnosis(self, statistics: dict[str, Any]) -> None:
        reason = self._why_not(self.wish.diagnosis)
        if not reason and (len(self.run.legs) > 1 or isinstance(self.stop, LimitReached)):
            reason = "models change in the run" if len(self.run.legs) > 1 else "the run did not reach its end"
        if not reason and self.budget.left <= 0.0:
            reason = f"no time was left for it; {advice(self.clock.cpu['solve'], self.budget)}"
        self.facts["diagnosis_reason"] = reason
        if reason:
            return
        scene, done, *_ = self.run.legs[0]
        done.trajectory.past.recall()  # estimates have had other motions followed since
        self.facts["diagnosis_reason"] = INTERRUPTED
        with self._phase("diagnosis"):
            if isinstance(self.stop, SolverFailure):
                from hfsim.trust.diagnosis import diagnose

                self.stop = diagnose(scene, done, self.budget)
            else:
                from hfsim.trust.suspicion import suspect

                self.facts["suspicion"] = suspect(scene, done, statistics, self.budget)
                self._ringing()
            cut = f"cut short when its time was up; {advice(self.clock.cpu['solve'], self.budget)}"
            self.facts["diagnosis_reason"] = cut if self.budget.left <= 0.0 else ""

    def _ringing(self) -> None:
        if not self.facts["suspicion"] and self.run.legs[0].done.problem.counts.steps >= MANY:
            from hfsim.trust.ringing import ringing

            self.facts["ringing"] = ringing(self.run, self.budget)

    def _why_not(self, wanted: bool) -> str:
        """Return why some work is not done."""
        if isinstance(self.stop, KeyboardInterrupt):
            return "the run was interrupted"
        if self.interruption is not None:
            return INTERRUPTED
        if not wanted:
            return "not asked for"
        return "" if self.budget.seconds > 0.0 else "no time was allowed for it"

    @contextmanager
    def _phase(self, name: str) -> Iterator[None]:
        """Time some work; what a signal ends is left as it is."""
        try:
            with self.clock.phase(name):
                yield
        except KeyboardInterrupt as signal:
            self.interruption = signal

    def _warning(self, name: str) -> str:
        stepped = self.run.legs[0].scene.deck.solve.step is not None
        remedy = "shorten the step" if stepped else "lower the tolerance"
        range_ = f"the range of {self.facts[f'{name}_channel']}"
        instead = self.facts.get(f"{name}_relative_to")
        scale = f"{instead}, for {range_} is too small to judge by" if instead else range_
        what = f"about {self.facts[name]:.2g} of {scale}"
        if name != ESTIMATES[0]:
            return f"the mesh error is {what}; what helps: {self.facts['mesh_advice']}"
        doubt = "if it stays as large, this motion cannot be predicted so far"
        return f"the time error is {what}: {remedy}; {doubt}"
