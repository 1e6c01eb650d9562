"""The error of an integration in time, measured by a second one with finer steps, or with coarser ones.

The distance to finer steps is the error.  Where there is no time for them, the distance to coarser ones is
several times the error: of tolerances ten times as loose 3 to 40 times, of steps twice as long 3 to 25 times
were measured in most scenes, less where steps do not resolve the fastest motion.  `COARSER` of it is taken.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hfsim.errors import SolverFailure
from hfsim.marching.integration import Integration, run_integration
from hfsim.marching.record import Record
from hfsim.marching.stop import Budget, Progress
from hfsim.maths.arrays import Array
from hfsim.scene.build import Scene
from hfsim.scene.schema import SolveSpec
from hfsim.trust.estimate import LARGER, USED_UP, Compared, Estimate, no_time, why_not

COARSER = 1.0 / 3.0
"""Part of the distance to a run with coarser steps that is taken as the error."""
TIGHTEST = 1e-13
"""Tolerance below which steps are no finer."""
ALIKE = 0.5
"""Share of the steps of two runs that end together, from which their tolerances have made no other steps."""
CLOSE = 1e-3
"""Distance of such ends, over the step."""
SAME = "took the same steps, which tells nothing"
"""End of a reason."""
_STEP = 10.0
"""Factor between the tolerances of two runs."""


class Second(NamedTuple):
    """Another integration of the same scene.

    Attributes
    ----------
    update : dict
        Of the deck's ``solve``.
    part : float
        Share of the distance between the two that is the error.
    cost : float
        Time that it was seen to take, over that of the run.
    """

    words: str
    update: dict[str, Any]
    part: float
    cost: float


def time_error(run: Compared, budget: Budget, seconds: float) -> Estimate:
    """Integrate again, with finer steps if the time suffices, and return the error of the integration.

    Parameters
    ----------
    seconds : float
        CPU time of the run [s].

    Raises
    ------
    KeyboardInterrupt
        If that ended the second run.
    """
    solve, steps = run.legs[0].scene.deck.solve, sum(leg.done.problem.counts.steps for leg in run.legs)
    if not steps:
        return Estimate(None, "no step was made")
    finer, coarser = _finer(solve), _coarser(solve)
    found = Estimate(None, no_time("a second run", seconds, budget))
    if finer is not None and budget.left > (finer.cost + coarser.cost) * seconds:
        found = _measured(run, finer, budget.guard(budget.left - coarser.cost * seconds), seconds)
    if found.error is None and budget.left > 0.0:
        other = _measured(run, coarser, budget.guard(), seconds)
        found = other if other.error is not None or found.until is None else found
    if budget.spent and found.reason.endswith(SAME):
        return Estimate(None, f"{USED_UP} in a second run; {LARGER}")
    if found.error == 0.0 or found.reason.endswith(SAME):
        # what bounds the steps is not the tolerance: they may be as long as the run, or as can be solved
        halved = _measured(run, _halved(run.end / steps), budget.guard(), seconds)
        why = "; ".join(filter(None, (found.reason, halved.reason)))
        found = halved._replace(reason="" if halved.error is not None else why)
    return found


def _finer(solve: SolveSpec) -> Second | None:
    if solve.step is not None:
        return _halved(solve.step)
    tolerance = float(f"{solve.tolerance / _STEP:.3g}")
    if tolerance < TIGHTEST:
        return None
    return Second(f"tolerance {tolerance:g}", {"tolerance": tolerance}, 1.0, 2.0)


def _coarser(solve: SolveSpec) -> Second:
    if solve.step is not None:
        return Second(f"steps of {2.0 * solve.step:.3g} s", {"step": 2.0 * solve.step}, COARSER, 0.6)
    tolerance = float(f"{solve.tolerance * _STEP:.3g}")
    return Second(f"tolerance {tolerance:g}", {"tolerance": tolerance}, COARSER, 0.8)


def _halved(step: float) -> Second:
    return Second(f"steps of {0.5 * step:.3g} s", {"step": 0.5 * step}, 1.0, 2.0)


def _measured(run: Compared, second: Second, guard: Progress, seconds: float) -> Estimate:
    """Make a second run and return the error that follows from its distance."""
    again, reason, ends = _again(run, second, guard, seconds)
    own = np.concatenate([leg.done.trajectory.step_ends() for leg in run.legs])
    if "tolerance" in second.update and len(ends) > 1 and _alike(own, ends):
        return Estimate(None, f"a second run with {second.words} {SAME}")
    found = run.distance(again, second.part)
    if found.error is None or not reason:
        return found._replace(reason=reason or found.reason, by=f"distance to a run with {second.words}")
    so_far = f"{reason}; until {found.until or run.end:.4g} s the error is {found.error:.2g}"
    return Estimate(None, so_far, until=found.until)


def _alike(ends: Array, others: Array) -> bool:
    """Return whether most steps end where those of another run do, as long as both last.

    Examples
    --------
    >>> ends = np.array([0.0, 0.3, 0.6, 0.8, 1.0])
    >>> _alike(ends, ends + 1e-6), _alike(ends, np.array([0.0, 0.25, 0.5, 0.75, 1.0])), _alike(ends[:1], ends)
    (True, False, False)
    """
    both = min(ends[-1], others[-1])
    ends, others = ends[ends <= both], others[others <= both]
    if min(len(ends), len(others)) < 2:
        return False
    near = np.clip(np.searchsorted(others, ends), 1, len(others) - 1)
    apart = np.minimum(np.abs(others[near] - ends), np.abs(others[near - 1] - ends))
    shared = int(np.sum(apart[1:] <= CLOSE * np.diff(ends)))
    return shared >= ALIKE * (max(len(ends), len(others)) - 1)


def _again(run: Compared, second: Second, guard: Progress, seconds: float) -> tuple[Record, str, Array]:
    """Integrate again and return where steps ended too.

    Models change where they did in the run: how good they are is not judged here.
    """
    record, ends = Record(balanced=False), list[Array]()
    before: tuple[Scene, Integration] | None = None
    for leg in run.legs:
        scene, start = leg.scene, None
        if before is not None:
            from hfsim.trust.handover import hand_over

            try:
                scene = hand_over(before[0], scene, before[1].trajectory)[0]
            except SolverFailure as failure:
                done = before[1]._replace(stop=failure)
                return record, why_not(done, second.words, seconds), np.concatenate(ends)
            start = (leg.begin, scene.q, scene.v)
        update = {"max_steps": None, **second.update, "duration": leg.done.trajectory.t_end}
        solve = scene.deck.solve.model_copy(update=update)
        again = run_integration(scene, solve, guard, start, record=record)
        reason = why_not(again, second.words, seconds)
        ends.append(again.trajectory.step_ends())
        if reason:
            return record, reason, np.concatenate(ends)
        before = scene, again
    return record, "", np.concatenate(ends)
