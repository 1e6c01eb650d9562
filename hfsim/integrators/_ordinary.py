"""Ordinary steps of collocation made natively one after another: what ``_repeat.c`` is told, in its order.

A step is ordinary if its equations are solved and its error is small enough, at the second attempt at least,
and along it no edge is met and no angle turns too far.  What is decided then stands there as it stands in
`hfsim.integrators.collocation` and `hfsim.integrators._loop`, so that both make the same steps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hfsim.errors import HfsimError, LimitReached, SolverFailure
from hfsim.integrators._pace import Pace
from hfsim.integrators._problem import Problem
from hfsim.integrators._trajectory import Segment, Trajectory, Watch
from hfsim.maths.arrays import Array

AT_ONCE = 32
"""Steps that are made before anybody is told of them."""
PROGRAMS = (
    *("start", "guess", "renew", "reach", "prepare", "correct", "small", "finite", "stage"),
    *("end", "closer", "steadier", "look", "count"),
)
"""What a step is put together from: as in `hfsim.integrators._recorded`, but ``renew``: ``derive``; and
``stage``: the next one of an explicit step."""
MEMORY = (
    *("t", "h", "q", "v", "start", "stages", "change", "size", "scale"),
    *("q_end", "v_end", "series", "error", "rate_error", "frequency", "taken"),
    *("rows", "row", "found"),
    *("miss", "slip", "q_closed", "v_closed", "positive", "q_looked", "v_looked", "farthest"),
)
"""What that works on: where a step begins and its length, accelerations at its start and its stages, sizes of
a correction and of the coordinates; what it leads to, where the derivative was taken; what explicit stages
are made of, all and that of now, and the accelerations there; by how much joints fail and where they do not,
which coordinates have to be positive, and how far angles leave what is known of them in a step that ends
somewhere."""


class Rule(NamedTuple):
    """What steps follow."""

    goal: float
    """This and the next two are `hfsim.integrators._ending.limits`."""
    near: float
    last_digit: float
    linear: float
    """Size of corrections below which they are added as small ones."""
    most: float
    """Corrections of a step."""
    tolerance: float
    reach: float
    """Of the stepper [s]."""
    target: float
    """Error, over the tolerance, at which steps are aimed."""
    power: float
    """That of an error which the length of the step goes with."""
    faint: float
    rungs: float
    """As in `hfsim.integrators._lengths`."""
    end: float
    """When a step has to end [s]."""
    resolved: float
    """Angle by which the fastest mode may turn in a step that is not stiff."""
    stiff: float
    """Whether steps are."""
    serves: float
    """Steps for which a derivative is kept at most."""
    serves_well: float
    """Corrections in a step up to which it is kept for one more."""
    shrunk: float
    """Part of a length that is tried after one that could not be solved."""
    steady: float
    """Whether the derivative is then taken in the middle of the step, as ever."""
    regrowth: float
    """Of the cap, from step to step."""
    at_end: float
    """Number of the stage that is the end of the step; 0: none."""
    rounding: float
    """Violation of joints at which there is nothing to move."""
    closings: float
    """Corrections of the positions at most; 0 without joints."""
    turned: float
    """How far angles may turn away from what is known of them [rad]."""
    longest: float
    """Of the stepper [s]."""
    growths: Array
    """Pairs: corrections in a step, and how much longer the next one may then be."""

    def told(self) -> Array:
        """Return all as one array."""
        return np.array([*self[:-1], *self.growths])


REACH, END, LONGEST = map(Rule._fields.index, ("reach", "end", "longest"))
"""What changes during a run."""


class State(NamedTuple):
    """What changes from step to step, and what they cost."""

    known: float
    """Whether accelerations at the start are known (1), and the first guess (2)."""
    old: float
    """Whether a derivative is to be taken in the next step."""
    served: float
    """Steps for which it was kept."""
    cap: float
    """Longest step [s]."""
    wish: float
    """Length of the next step as far as the end leaves room for it [s]."""
    rejected: float = 0.0
    """Attempts that were not kept since the last step that was."""
    ready: float = np.nan
    """Length of the step that corrections are ready for [s]."""
    fastest: float = np.nan
    """Largest circular frequency [rad/s]."""
    iterations: float = 0.0
    """Corrections in the last step."""
    begun: float = 0.0
    """Steps for which accelerations at the start were computed."""
    renewed: float = 0.0
    """Derivatives that were."""
    total: float = 0.0
    """Corrections."""
    converged: float = 0.0
    """Whether those of the last step did."""
    made: float = 0.0
    """Steps that are kept."""


class Ahead(NamedTuple):
    """Ordinary steps, and an attempt at one more.

    Attributes
    ----------
    rows : ndarray, shape (n_steps, 3 + 2 n + m n)
        Of each the attempts before it, its start and length in time, its end (q, v) and its series.
    t : float
        When the last one ends, to the last digit that of a break it meets [s].
    state : State
        After the last of these steps, and of attempts that are not kept, but for the one below.
    taken : ndarray
        Where the derivative was taken that they ended with.
    tried : State or None
        After the attempt, if there was one.
    failed : bool
        Whether that ended in a singular matrix.
    """

    rows: Array
    t: float
    state: State
    taken: Array
    tried: State | None
    failed: bool = False


def keep_all(
    ahead: Ahead,
    path: Trajectory,
    problem: Problem,
    pace: Pace,
    watch: Watch,
) -> HfsimError | KeyboardInterrupt | None:
    """Keep ordinary steps, and watch them; return what stops the run.

    What fails ends with its step; other stops come when all are kept. Who asks watches the last one unless
    another one was tried after it.
    """
    rows, n, stop = ahead.rows, len(path.q), None
    last, before = None if ahead.tried else len(rows), len(path.segments)
    heads = rows[:, :3].tolist()
    following = [*((t, h) for _, t, h in heads[1:]), (ahead.t, ahead.state.wish)]
    q_ends, v_ends = rows[:, 3 : n + 3], rows[:, n + 3 : 2 * n + 3]
    inside = rows[:, 2 * n + 3 :].reshape(len(rows), -1, n) if len(rows) else ()
    steps = zip(heads, q_ends, v_ends, inside, following, strict=False)
    try:
        for k, ((rejected, t, h), q, v, series, (t_end, then)) in enumerate(steps, start=1):
            if rejected:
                _refused(path.t_end, False, problem, pace)
            pace.note(t_end, False, False)
            path.segments.append(Segment(t, h, path.q, path.v, series))
            path.t_end, path.q, path.v = t_end, q, v
            problem.often.expect(t_end, h, then)
            if stop is None and k != last:
                try:
                    watch(t_end, q, v)
                except (LimitReached, KeyboardInterrupt) as told:  # anywhere else it takes all of them back
                    stop = told
        if ahead.state.rejected:
            _refused(path.t_end, not ahead.state.converged, problem, pace)
    except SolverFailure as failure:
        return failure
    finally:
        problem.counts.steps += len(path.segments) - before
    return stop


def _refused(t: float, unsolved: bool, problem: Problem, pace: Pace) -> None:
    """Take note of an attempt that was not kept."""
    problem.counts.rejected += 1
    pace.note(t, True, unsolved)
