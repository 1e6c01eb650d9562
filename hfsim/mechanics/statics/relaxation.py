"""Rest by relaxation: the scene creeps downhill, slower than it could swing, until nothing moves it any more.

What is solved is W z' = f - Phi_z^T lambda with Phi = 0, W the metric of the gauge, by implicit steps that
grow as the forces fade: with long ones they are Newton's iteration (pseudo-transient continuation; Kelley and
Keyes, SIAM Journal on Numerical Analysis 35, 1998).  A step that would lead uphill is taken shorter: then
only stable places of rest are come to, but for a start that is exactly between.

One correction a step leaves forces in what is stiff, of the curvature of the way.  Where something is so soft
beside it that these are more than what moves it, as the roll of a thin line, the longest step leads nowhere:
then steps get longer still, and each is solved for its end.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, random_signs
from hfsim.maths.matrices import Matrix
from hfsim.mechanics.statics.newton import (
    ENOUGH,
    EPSILON,
    HOLD,
    NEXT_TO,
    ROUGH,
    SHRINKING,
    STUCK,
    Effort,
    NotFoundError,
    balanced,
)
from hfsim.mechanics.statics.problem import Level, Problem, Solver, State, Tangent
from hfsim.mechanics.statics.strides import MOVE, Strides
from hfsim.mechanics.ties import Tie

NEARLY = 0.9
"""Part of it up to which steps are made longer: a step that is too long costs one that is not."""
BEYOND = 10.0
"""Work that contacts take back at the end of a step, over that at its start, with which it is not done."""
MOST = 600
"""Steps."""
LONG = 1e13
"""Of the longest step, times the stiffest of all stiffnesses: what it adds to them is rounding."""
SAME = 1e-5
"""Change of a state up to which all within it is the same place of rest [rad]."""
NOTHING = 1e-14
"""Push that joints leave, over that which there is without them, that is rounding ..."""
CLOSED = 1e-12
"""... where they miss no more than this [m or rad]."""
CLEARLY = 100.0
"""Way in a longest step, over that by rounding, from which something soft is on its way still."""
WITHIN = 12
"""Corrections in a step that is solved for its end."""
GROWING = 3.0
"""How much longer the next one is."""
STILL = 10
"""Longest steps within that, after which corrections that get no smaller are rounding."""
SHORT = 1e-25
"""Of the shortest step, over the longest."""
ENDLESS = "it does not come to rest"
"""What is said after so many steps."""
ON_AND_ON = "it goes on and on"
"""What is said after too long a way."""


def relaxed(problem: Problem, state: State, effort: Effort, load: float = 1.0) -> State:
    """Return a place of rest downhill of a state, under the whole load.

    Raises
    ------
    NotFoundError
        If there is none, or it is not found.
    """
    level, effort.descents = Level(load), effort.descents + 1
    step, multipliers = _first(problem, state, level, problem.metric)
    if multipliers is not None:
        state = state._replace(multipliers=multipliers)
        problem.note(load, state)
        return state
    return _Descent(problem, level, effort, state, step).rest()


class _Taken(NamedTuple):
    """A step downhill: its change, how large that and what answers the forces are, and the work of these."""

    dz: Array
    size: float
    ahead: float
    work: float


@dataclass(eq=False)
class _Descent:
    """The way downhill from a state.

    Attributes
    ----------
    problem : Problem
    level : Level
    effort : Effort
    state : State
        Where it has come to.
    step : float
        Length of the next step.
    """

    problem: Problem
    level: Level
    effort: Effort
    state: State
    step: float

    def __post_init__(self) -> None:
        self._strides, self._before, self._may_creep = Strides(self.problem), np.inf, True
        forces = self.problem.system.forces
        self._touches = any(isinstance(one, Tie) and not one.holds_together for one in forces)
        self._place, self._first, self._stayed, self._stiffest = self.state.z, np.inf, 0, 0.0
        self._missing = self.problem.missing(self.state, self.level)
        self._look_ahead()

    def rest(self) -> State:
        """Return the place of rest to which it leads."""
        while self._strides.tries < MOST:
            self._strides.tries += 1
            self.effort.iterations += 1
            taken = self._taken()
            if taken is None:
                continue
            found = self._rest_next_to(taken.size) or self._rest_of_what_creeps(taken.size)
            found = found or self._rest_where_it_stays(taken.size)
            if found is not None:
                return found
            if self._strides.endless(self.state, taken.dz, taken.work):
                raise NotFoundError(ON_AND_ON, self.state, taken.dz)
            self._lengthen(taken)
            self._look_ahead()
        raise NotFoundError(ENDLESS, self.state)

    @property
    def _longest(self) -> float:
        return LONG / self._stiffest if self._stiffest else np.inf

    def _look_ahead(self) -> None:
        """Take the derivatives where it has come to, and the forces that are foreseen there."""
        self._slopes = K, _ = self.problem.tangent(self.state, self.level.load)
        stiffest = (np.abs(K.diagonal()) / self.problem.metric.diagonal()).max(initial=0.0)
        self._stiffest = max(self._stiffest, float(stiffest))
        strained = any(one is not None for one in self.state.expected or ())
        self._foreseen = self.problem.foreseen(self.state, self.level) if strained else self._missing[0]

    def _taken(self) -> _Taken | None:
        """Take a step, if it suits; else make the next one shorter."""
        (force, gap), (K, J), metric = self._missing, self._slopes, self.problem.metric
        try:
            solved = Tangent(K + metric / self.step, J).solver()
            dz, change, ahead, uphill = _answer(self._strides, solved, force, self._foreseen, gap)
        except np.linalg.LinAlgError:
            self.step *= 0.3
            return None
        if not ahead < MOVE or uphill:
            self.step *= 0.2 if uphill or not ahead < 1e3 else max(0.1, 0.7 * MOVE / ahead)
            if self.step < SHORT * min(self._longest, 1e6):
                raise NotFoundError("no way downhill is found", self.state)
            return None
        problem, state, level, work = self.problem, self.state, self.level, float((force * dz).sum())
        there = State(state.z + dz, state.multipliers + change, problem.expecting(state, dz))
        missing = problem.missing(there, level)
        suits = not self._touches or float((missing[0] * dz).sum()) >= -BEYOND * work  # else it fell through
        if suits and self._strides.doubtful(dz):
            beside = problem.foreseen(there, level) - np.asarray(dz @ metric) / self.step
            suits = self._strides.suits(dz, solved, beside, gap + np.asarray(dz @ J.T) - missing[1])
        if not suits:
            self.step *= 0.25
            return None
        problem.note(level.load, there)
        self.effort.steps += 1
        self.state, self._missing = there, missing
        return _Taken(dz, problem.moved(dz), ahead, work)

    def _rest_next_to(self, size: float) -> State | None:
        """Return the place of rest, if the last step has come to it."""
        if size < ENOUGH:
            return self.state.by_itself()
        if self.step >= self._longest and self._before < SAME and size > SHRINKING * self._before:
            held = _held(self.problem, self.state, self.level, self.effort)
            return held or (self.state.by_itself() if self._before < ROUGH else None)
        return None

    def _rest_of_what_creeps(self, size: float) -> State | None:
        """Return the place of rest, if ever longer steps lead to it where the longest one leads nowhere."""
        slow = self.step >= self._longest and self._before > size > max(SAME, STUCK * self._before)
        if not (self._may_creep and slow):
            return None
        tangent = Tangent(self._slopes[0] + self.problem.metric / self.step, self._slopes[1])
        self._may_creep = size <= CLEARLY * _by_rounding(self.problem, self.state, self.level, tangent)
        if self._may_creep:
            return None
        way = self.problem, self.state, self.level, self.step, self.effort, self._strides
        self.state, rests = _crept(*way)
        self._missing = self.problem.missing(self.state, self.level)
        return self.state if rests else None

    def _rest_where_it_stays(self, size: float) -> State | None:
        """Return the place of rest, if the longest steps stay at it and get no smaller."""
        self._stayed += 1
        if self.step < self._longest or self.problem.moved(self.state.z - self._place) > SAME:
            self._place, self._first, self._stayed = self.state.z, size, 0
        if self._stayed >= STILL and size > 0.25 * self._first:
            return self.state.by_itself()
        return None

    def _lengthen(self, taken: _Taken) -> None:
        """Make the next step longer, the more so the faster the last ones fade."""
        growth = 2.0 if taken.size > 0.3 * self._before else min(100.0, 2.0 * self._before / taken.size)
        self.step = min(self._longest, self.step * min(growth, NEARLY * MOVE / max(taken.ahead, ENOUGH)))
        self._before = taken.size


def _by_rounding(problem: Problem, state: State, level: Level, tangent: Tangent) -> float:
    """Return how far rounding of forces moves a state in a step with these derivatives."""
    beside = state._replace(z=state.z * (1.0 + EPSILON * random_signs(state.z.shape)))
    (force, gap), (other, _) = (problem.missing(one, level) for one in (state, beside))
    return problem.moved(tangent.solved(other - force, 0.0 * gap)[0])


def _crept(
    problem: Problem, state: State, level: Level, step: float, effort: Effort, strides: Strides
) -> tuple[State, bool]:
    """Return where ever longer steps lead to, each solved for its end, and whether it is a place of rest."""
    first = step
    for _ in range(MOST):
        try:
            ahead = _ended(problem, state, level, step, effort)
        except (NotFoundError, np.linalg.LinAlgError):
            step *= 0.25
            if step < first:
                break
            continue
        dz = ahead.z - state.z
        size, done = problem.moved(dz), float((problem.missing(state, level)[0] * dz).sum())
        problem.note(level.load, ahead)
        effort.steps += 1
        state = ahead
        if strides.endless(state, dz, done):
            raise NotFoundError(ON_AND_ON, state, dz)
        if size < NEXT_TO and (found := _next_to(problem, state, level, effort)) is not None:
            return found, True
        if size < SAME:
            break
        step *= min(GROWING, NEARLY * MOVE / size)
    return state, False


def _ended(problem: Problem, begin: State, level: Level, step: float, effort: Effort) -> State:
    """Return the state at the end of a step, no longer than they may be."""
    slowing, state, before = problem.metric / step, begin, 0.5 * MOVE
    for _ in range(WITHIN):
        effort.iterations += 1
        force, gap, K, J = _equations(problem, state, level)
        force = force - np.asarray((state.z - begin.z) @ slowing)
        dz, change = Tangent(K + slowing, J).solved(force, -gap)
        size = problem.moved(dz)
        if not size < 2.0 * before or (state is begin and float((force * dz).sum()) < 0.0):
            break
        state = State(state.z + dz, state.multipliers + change, problem.expecting(state, dz))
        if size < SAME:
            return state
        before = size
    raise NotFoundError("the iteration does not converge", state)


def _next_to(problem: Problem, state: State, level: Level, effort: Effort) -> State | None:
    """Return the place of rest next to a state; None without."""
    try:
        found = balanced(problem, state, level, effort)
    except NotFoundError:
        return None
    return found if problem.moved(found.z - state.z) < MOVE else None


def _held(problem: Problem, state: State, level: Level, effort: Effort) -> State | None:
    """Return the place of rest at a state where what nothing brings back is held; None without.

    Rounding moves that the further the longer steps are.
    """
    found = _next_to(replace(problem, hold=HOLD), state, level, effort)
    return found if found is not None and problem.moved(found.z - state.z) < SAME else None


def _answer(
    strides: Strides, solved: Solver, force: Array, foreseen: Array, gap: Array
) -> tuple[Array, Array, float, bool]:
    """Return changes of state and multipliers, the size of what answers the forces, and whether it is uphill.

    That stays on what the joints allow: there the curvature counts, and it is smaller in a shorter step.
    What closes the gaps is as large in all steps, and is done in parts where it is too large.  What the last
    step has left in what is stiff is released downhill: that would hide that all else, which was foreseen, is
    led uphill.
    """
    forces, gaps = np.concatenate([force, 0.0 * force, foreseen]), np.zeros((3, gap.shape[1]))
    gaps[1] = -gap
    every, changes = solved(forces, gaps)
    ahead, closing, awaited = (strides.size(one[None]) for one in every)
    done = np.sum(forces * every, axis=1)
    uphill = (ahead > SAME and done[0] < 0.0) or (awaited > SAME and done[2] < 0.0)
    parts = np.array([[1.0, MOVE / max(closing, MOVE), 0.0]])
    return parts @ every, parts @ changes, ahead, bool(uphill)


def _equations(problem: Problem, state: State, level: Level) -> tuple[Array, Array, Matrix, Matrix]:
    """Return what is missing in a state, and the derivatives; a step taken shorter needs no others."""
    return *problem.missing(state, level), *problem.tangent(state, level.load)


def _first(problem: Problem, state: State, level: Level, metric: Matrix) -> tuple[float, Array | None]:
    """Return the length of the first step; then the multipliers if what pushes is no more than rounding."""
    force, gap = problem.missing(state, level)
    J, whole = problem.jacobian(state), problem.gauge.whole
    try:
        answer, change = Tangent(metric, J).solved(force, np.zeros_like(gap))
    except np.linalg.LinAlgError as error:
        raise NotFoundError("joints hold the same more than once", state) from error
    x, push = problem.expand(state.z), problem.moved(answer)
    apart, _ = Tangent(whole, whole[:0]).solved(problem.force(x, level.load), np.zeros((1, 0)))
    if push <= NOTHING * problem.gauge.size(apart) and np.abs(gap).max(initial=0.0) <= CLOSED:
        return np.inf, state.multipliers + change
    return 0.1 * MOVE / push if push > 0.0 else 1.0, None
