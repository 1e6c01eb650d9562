"""Ordinary steps of collocation made natively one after another: what ``_repeat.c`` is told, in its order.

A step is ordinary if its equations are solved, its error is small enough, nothing has to be looked at along
it, and neither a break nor the end of the run is near.  What is decided then stands there as it stands in
`hfsim.integrators.collocation` and `hfsim.integrators._loop`, so that both make the same steps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hfsim.errors import HfsimError, LimitReached, SolverFailure
from hfsim.integrators._base import Watch
from hfsim.integrators._pace import Pace
from hfsim.integrators._problem import Problem
from hfsim.integrators._trajectory import Segment, Trajectory
from hfsim.maths.arrays import Array

AT_ONCE = 32
"""Steps that are made before anybody is told of them."""
PROGRAMS = (
    *("start", "guess", "renew", "reach", "prepare", "correct", "small", "finite"),
    *("end", "closer", "steadier"),
)
"""What a step is put together from: as in `hfsim.integrators._recorded`, but ``renew``: ``derive``."""
MEMORY = (
    *("t", "h", "q", "v", "start", "stages", "change", "size", "scale"),
    *("q_end", "v_end", "series", "error", "rate_error", "frequency", "taken"),
    *("miss", "slip", "q_closed", "v_closed", "positive"),
)
"""What that works on: where a step begins and its length, accelerations at its start and its stages, sizes of
a correction and of the coordinates; what it leads to, where the derivative was taken; by how much joints fail
and where they do not, and which coordinates have to be positive."""


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
    """When steps have to end [s]."""
    resolved: float
    """Angle by which the fastest mode may turn in a step that is not stiff."""
    stiff: float
    """Whether steps are."""
    serves: float
    """Steps for which a derivative is kept at most."""
    serves_well: float
    """Corrections in a step up to which it is kept for one more."""
    regrowth: float
    """Of the cap, from step to step."""
    at_end: float
    """Whether the last stage is the end of the step."""
    rounding: float
    """Violation of joints at which there is nothing to move."""
    closings: float
    """Corrections of the positions at most; 0 without joints."""
    growths: Array
    """Pairs: corrections in a step, and how much longer the next one may then be."""

    def told(self) -> Array:
        """Return all as one array."""
        return np.array([*self[:-1], *self.growths])


REACH, END = map(Rule._fields.index, ("reach", "end"))
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
    rows : ndarray, shape (n_steps, 2 + 2 n + m n)
        Of each its start and length in time, its end (q, v) and its series.
    h : float
        Length of the next one.
    state : State
        After the last of these steps.
    taken : ndarray
        Where the derivative was taken that they ended with.
    tried : State or None
        After the attempt, if there was one.
    failed : bool
        Whether that ended in a singular matrix.
    """

    rows: Array
    h: float
    state: State
    taken: Array
    tried: State | None
    failed: bool = False


def keep_all(
    rows: Array,
    following: float,
    path: Trajectory,
    problem: Problem,
    pace: Pace,
    watch: Watch,
    last: bool,
) -> HfsimError | KeyboardInterrupt | None:
    """Keep ordinary steps, and watch them; return what stops the run.

    What fails ends with its step; other stops come when all are kept.

    Parameters
    ----------
    rows, following
        As `Ahead` has them; the length of the step after them.
    last : bool
        Whether the last one is watched by who asks.
    """
    n, stop = len(path.q), None
    for k, row in enumerate(rows, start=1):
        t, h = row[:2].tolist()
        try:
            pace.note(t + h, False, False)
            path.segments.append(Segment(t, h, path.q, path.v, row[2 * n + 2 :].reshape(-1, n)))
            path.t_end, path.q, path.v = t + h, row[2 : n + 2], row[n + 2 : 2 * n + 2]
            problem.counts.steps += 1
            problem.often.expect(t + h, h, float(rows[k, 1]) if k < len(rows) else following)
            if stop is None and not (last and k == len(rows)):
                stop = _watched(watch, path)
        except SolverFailure as failure:
            return failure
    return stop


def _watched(watch: Watch, path: Trajectory) -> LimitReached | KeyboardInterrupt | None:
    """Watch the last step; return what stops the run behind it.

    An interruption that comes anywhere else would leave a step half kept: it takes all of them back.
    """
    try:
        watch(path.t_end, path.q, path.v)
    except (LimitReached, KeyboardInterrupt) as told:
        return told
    return None
