"""Newton's iteration for an equilibrium, and the path along which loads are put on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.mechanics.statics.problem import Correction, Level, Problem, State
from hfsim.mechanics.statics.stability import Signs

ENOUGH = 1e-13
"""Size of a correction after which nothing is left but rounding."""
ROUGH = 1e-8
"""Size of a correction that may be rounding, where they get no smaller."""
SHRINKING = 0.25
"""What a correction is of the one before, at most, as long as an iteration converges."""
STUCK = 0.9
"""The same, from which it is rounding of forces alone that moves what is only held."""
MOST = 40
"""Iterations."""
FAR = 3.0
"""Size of a correction from which an iteration is given up [rad]."""
MOVE = 0.4
"""Largest change of a state in a step of the load, and turn of a joint by its law [rad]."""
ASIDE = 0.5
"""How far from where the tangent points a step of the load may end, relative to what that foretells ..."""
NEXT_TO = 1e-3
"""... and how far it may in any case [rad]."""
LITTLE = 1e-3
"""Step of the load, relative to all of it, from which on it may fall short of that by any part."""
SHORTEST = 1e-5
"""Step of the load, relative to all of it, below which the path has come to its end."""

HOLD = 1e-11
"""What holds motions that nothing brings back, over the stiffest of all."""
FIRMER = 1e4
"""How much more does so in the last correction."""

EPSILON = float(np.finfo(float).eps)


class NotFoundError(Exception):
    """A search that has found nothing: where it was, and how (1, n) it went on, if known."""

    def __init__(self, why: str, state: State, motion: Array | None = None) -> None:
        self.state, self.motion = state, motion
        super().__init__(why)


@dataclass
class Effort:
    """What has been done: iterations (factorisations), steps, and ways downhill (relaxations)."""

    iterations: int = 0
    steps: int = 0
    descents: int = 0


def correction(problem: Problem, state: State, level: Level) -> Correction:
    """Return the correction of a state and its multipliers towards a level."""
    force, gap = problem.missing(state, level)
    return problem.tangent(state, level.load).solved(force, -gap)


def balanced(
    problem: Problem, state: State, level: Level, effort: Effort, first: Correction | None = None
) -> State:
    """Return the equilibrium near a state, by Newton's iteration with expected strains.

    Its first correction can be handed over where it is known; none that follows may then be larger, beyond
    what a step of the load may miss: there is no equilibrium next to where it points.

    Raises
    ------
    NotFoundError
        If it does not converge.
    """
    before = np.inf
    far = FAR if first is None else max(problem.moved(first[0]), 2.0 * NEXT_TO)
    for _ in range(MOST):
        effort.iterations += 1
        try:
            dz, change = first or correction(problem, state, level)
        except np.linalg.LinAlgError as error:
            raise NotFoundError("the tangent is singular", state) from error
        first, size = None, problem.moved(dz)
        if not size <= far:
            raise NotFoundError("the iteration diverges", state)
        expected = problem.expecting(state, dz)
        state = State(state.z + dz, state.multipliers + change, expected)
        rough = before < ROUGH and size > SHRINKING * before
        held = before * problem.hold < EPSILON and size > STUCK * before
        if problem.hold and held:
            return _firmly(problem, state, level).by_itself()
        if size < ENOUGH or rough:
            return state.by_itself()
        before = size
    raise NotFoundError("the iteration does not converge", state)


def _firmly(problem: Problem, state: State, level: Level) -> State:
    """Return a state in which what only moves by rounding has stopped: its last motion bent all else."""
    dz, change = correction(replace(problem, hold=FIRMER * problem.hold), state, level)
    return State(state.z + dz, state.multipliers + change, problem.expecting(state, dz))


def growing(share: float) -> Level:
    """Return the level at which a share of the loads is on."""
    return Level(share, 1.0 - share)


def stepped(
    problem: Problem,
    effort: Effort,
    levels: Callable[[float], Level] = growing,
    signs: Signs | None = None,
) -> tuple[float, State]:
    """Put the loads on in steps; return the share that could be put on, and the equilibrium there.

    Steps are as long as changes stay moderate and near to what the tangent foretells, so that it is the
    equilibrium that is connected with the start, and shorter where the iteration does not converge.  With
    signs they are shorter too where the first motion becomes unstable, which is so located and noted.
    """
    state, share, step = problem.begin(), 0.0, 1.0
    while share < 1.0 and step > SHORTEST:
        to = share + step if 1.0 - share - step > SHORTEST else 1.0
        step, level = to - share, levels(to)
        if problem.way.turned(levels(share).rest, level.rest) > MOVE:
            step *= 0.5
            continue
        try:
            first = correction(problem, state, level)
            move = problem.moved(first[0])
            if move > MOVE:
                step *= max(0.1, 0.9 * MOVE / move)
                continue
            found = balanced(problem, state, level, effort, first)
        except (NotFoundError, np.linalg.LinAlgError):
            step *= 0.25
            continue
        if not follows(problem, found.z - state.z, first[0], step <= LITTLE):
            step *= 0.25
            continue
        if signs is not None and signs.more(found, to) and step > 4.0 * SHORTEST:
            step *= 0.25
            continue
        try:
            problem.note(to, found)
        except NotFoundError:
            step *= 0.25
            continue
        if signs is not None:
            signs.note(share)
        state, share, step = found, to, 2.0 * step
        effort.steps += 1
    return share, state


def follows(problem: Problem, change: Array, foretold: Array, little: bool) -> bool:
    """Return whether a step of the load is moderate, and near to what the tangent at its begin foretells.

    Slack strings and the like have next to no stiffness until they are tight: little steps may fall short.
    """
    moved, ahead = problem.moved(change), problem.moved(foretold)
    if moved > MOVE:
        return False
    if little and moved <= ahead and np.sum(change * (foretold @ problem.metric)) > 0.0:
        return True
    return problem.moved(change - foretold) <= max(NEXT_TO, ASIDE * ahead)
