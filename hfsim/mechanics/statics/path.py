"""The path of equilibria as the load grows, through limit points, by arc length; and what it crosses.

Each step goes on along the tangent of the path and comes back to it across (Riks, International Journal of
Solids and Structures 15, 1979).  A limit point is where the load turns round; a branch is where another path
leaves this one: there an eigenvalue of the tangent stiffness changes its sign though the load does not turn.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.matrices import Matrix
from hfsim.mechanics.statics.beginning import begun
from hfsim.mechanics.statics.newton import Effort, NotFoundError, balanced
from hfsim.mechanics.statics.problem import Level, Problem, State
from hfsim.mechanics.statics.stability import lowest

FIRST, LONGEST, SHORTEST = 0.05, 0.1, 1e-6
"""Lengths of steps: load factor and changes of the state [rad] together."""
CLOSE = 1e-5
"""Step within which a branch is crossed: longer ones shorten, as the path may turn off just before one."""
MOST = 400
"""Steps."""
ITERATIONS = 12
"""Of the way back to the path."""
NEAR, ROUGH = 1e-12, 1e-8
"""Size of a correction after which a point is on the path; and that of rounding, where it gets no smaller."""
LOCATED = 1e-10
"""Part of a step within which a limit point or a branch is located."""
TRIES = 60
"""Of them."""
FREE = 1e-9
"""Part of the load in the first direction of a path below which that is a motion which nothing resists."""


class Point(NamedTuple):
    """An equilibrium on the path.

    Attributes
    ----------
    state : State
    load : float
        Load factor.
    problem : Problem
        With the motions that nothing resists here.
    values : ndarray
        Smallest stiffnesses over masses of the others, ascending [1/s^2].
    along : ndarray, shape (1, n)
        Change of the state along the path ...
    rate : float
        ... and of the load factor; together of length one.
    """

    state: State
    load: float
    problem: Problem
    values: Array
    along: Array
    rate: float

    @property
    def negative(self) -> int:
        """Number of motions along which it is not stable."""
        return int(np.sum(self.values < 0.0))


class Crossing(NamedTuple):
    """A limit point or a branch on the path.

    Attributes
    ----------
    kind : str
        ``limit`` or ``branch``.
    load : float
        Load factor.
    point : int
        Number of the point after it.
    """

    kind: str
    load: float
    point: int


@dataclass(eq=False)
class Path:
    """A path that is followed.

    Attributes
    ----------
    problem : Problem
    effort : Effort
    """

    problem: Problem
    effort: Effort

    def __post_init__(self) -> None:
        self.points: list[Point] = []
        self.crossings: list[Crossing] = []

    def follow(self) -> str:
        """Follow the path from where it begins to the whole load; return why it ends before, if it does.

        Raises
        ------
        NotFoundError
            If it leads to where the scene means nothing.
        """
        try:
            problem, state = begun(self.problem, self.effort)
        except NotFoundError as error:
            return f"no path begins: {error}"
        self.problem, step = problem, FIRST
        self.points.append(self._point(state, problem.least, None))
        problem.note(problem.least, state)
        if self.points[0].rate < FREE:
            return "no path begins: without the loads nothing holds what they push"
        while len(self.points) < MOST:
            here = self.points[-1]
            try:
                there = self._next(here, step)
            except NotFoundError:
                step *= 0.5
                if step < SHORTEST:
                    return f"the path is lost at a load factor of {here.load:.6g}"
                continue
            if step > CLOSE and _branches(here, there):
                step = max(CLOSE, 0.25 * step)
                continue
            whole = there.load >= 1.0
            if whole:
                try:
                    state = balanced(there.problem, there.state, Level(1.0), self.effort)
                    there = self._point(state, 1.0, here)
                except NotFoundError:
                    whole = False
            problem.note(there.load, there.state)
            self._cross(here, there, step)
            self.points.append(there)
            self.effort.steps += 1
            if whole:
                return ""
            if there.load < -1.0:
                return "the path leads to the opposite load"
            step = min(LONGEST, 1.5 * step)
        return f"after {MOST} points it has not come to the whole load"

    def _product(self, a: Array, b: Array) -> float:
        return float((a * np.asarray(b @ self._metric)).sum())

    @cached_property
    def _metric(self) -> Matrix:
        return self.problem.system.reduction.reduced(self.problem.gauge.together)

    def _point(self, state: State, load: float, before: Point | None) -> Point:
        """Return a point with the direction of the path there, going on from the one before."""
        problem, values = self._loosened(state, load, before)
        try:
            gaps = np.zeros_like(state.multipliers)
            along, _ = problem.tangent(state, load).solved(problem.load(state.z), gaps)
        except np.linalg.LinAlgError as error:
            raise NotFoundError("the tangent is singular", state) from error
        length = np.sqrt(self._product(along, along) + 1.0)
        along, rate = along / length, 1.0 / length
        if before is not None and self._product(along, before.along) + rate * before.rate < 0.0:
            along, rate = -along, -rate
        return Point(state, load, problem, values, along, rate)

    def _loosened(self, state: State, load: float, before: Point | None) -> tuple[Problem, Array]:
        """Return the problem with what is loose in a state, and the smallest stiffnesses of all else.

        What is loose turns with the bodies; a motion more that nothing resists is that of a branch.
        """
        problem = self.problem if before is None else before.problem
        if problem.free is None:
            return problem, lowest(problem, state, load)[0]
        values, motions, _ = lowest(replace(problem, free=None), state, load)
        loose = np.flatnonzero(values == 0.0)
        return replace(problem, free=motions[loose]), np.delete(values, loose[: len(problem.free)])

    def _next(self, here: Point, step: float) -> Point:
        """Return the point at the end of a step."""
        problem, load = here.problem, here.load + step * here.rate
        dz = step * here.along
        state = State(here.state.z + dz, here.state.multipliers, problem.expecting(here.state, dz))
        before = np.inf
        for _ in range(ITERATIONS):
            self.effort.iterations += 1
            force, gap = problem.missing(state, Level(load))
            both = np.concatenate([force, problem.load(state.z)])
            gaps = np.concatenate([-gap, np.zeros_like(gap)])
            try:
                found, changes = problem.tangent(state, load).solved(both, gaps)
            except np.linalg.LinAlgError as error:
                raise NotFoundError("the tangent is singular", state) from error
            a, b = found[:1], found[1:]
            turn = self._product(here.along, b) + here.rate
            grown = -self._product(here.along, a) / turn if turn else np.inf
            dz, change = a + grown * b, changes[:1] + grown * changes[1:]
            size = problem.moved(dz) + abs(grown)
            if not size < 2.0 * step:
                break
            state = State(state.z + dz, state.multipliers + change, problem.expecting(state, dz))
            load += grown
            if size < NEAR or (before < ROUGH and size > 0.25 * before):
                return self._point(state.by_itself(), load, here)
            before = size
        raise NotFoundError("the iteration does not converge", state)

    def _cross(self, here: Point, there: Point, step: float) -> None:
        """Take note of limit points and branches between two points."""
        found, number = [], len(self.points)
        if _turns(here, there):
            found.append(Crossing("limit", self._located(here, step, lambda one: one.rate), number))
        if changed := _branches(here, there):
            k = min(here.negative, there.negative)
            crossed = here.negative != there.negative
            load = self._located(here, step, lambda one: float(one.values[k]) if crossed else one.rate)
            found += [Crossing("branch", load, number)] * changed
        self.crossings += found

    def _located(self, here: Point, step: float, measure: Callable[[Point], float]) -> float:
        """Return the load factor where a measure changes its sign within a step."""
        low, high, at_low = 0.0, step, measure(here)
        loads, load, at_high, weight = [here.load, here.load], here.load, None, 1.0
        for _ in range(TRIES):
            share = 0.5 if at_high is None else at_low / (at_low - weight * at_high)
            middle = low + min(max(share, 0.01), 0.99) * (high - low)
            try:
                there = self._next(here, middle)
            except NotFoundError:  # so near to a branch states are known less well than loads
                share = 0.0 if at_high is None else at_low / (at_low - at_high)
                return loads[0] + share * (loads[1] - loads[0])
            load, at = there.load, measure(there)
            if at * at_low > 0.0:
                low, at_low, weight, loads[0] = middle, at, 0.5, load
            else:
                high, at_high, weight, loads[1] = middle, at, 1.0, load
            if high - low < LOCATED * step or at == 0.0 or abs(at) < 1e-11 * abs(measure(here)):
                break
        return load


def _turns(here: Point, there: Point) -> bool:
    """Return whether the load turns round between two points."""
    return here.rate * there.rate < 0.0


def _branches(here: Point, there: Point) -> int:
    """Return how many branches leave the path between two points, as far as signs of eigenvalues tell.

    One of them changes where the load turns: if none does, a branch is there too.
    """
    return abs(abs(there.negative - here.negative) - _turns(here, there))
