"""Where the path of a load begins: without it or, where it alone holds something, with a little of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.mechanics.statics.newton import Effort, NotFoundError, stepped
from hfsim.mechanics.statics.problem import Level, Problem, State
from hfsim.mechanics.statics.relaxation import relaxed
from hfsim.mechanics.statics.stability import lowest

LIGHT = 1e-2
"""Load factor from which what hangs is followed: without any load nothing tells where it is."""


def begun(problem: Problem, effort: Effort) -> tuple[Problem, State]:
    """Return a problem with the load factor from which it is followed, and the equilibrium there.

    One that is not stable is where the path begins only if the scene starts there, or finds no other.

    Raises
    ------
    NotFoundError
        If there is none without the loads, or nothing holds what they push.
    """
    problem.begin()
    thrown = problem.thrown
    share, state = stepped(problem, effort, let_go)
    try:
        values = lowest(problem, state, 0.0)[0] if share == 1.0 else np.zeros(1)
        loose, stable = bool((values == 0.0).any()), bool((values > 0.0).all())
        if stable or not (loose or thrown):
            return problem, state
        try:
            return _let_down(problem, effort)
        except NotFoundError:
            if loose:
                raise
        return problem, stepped(problem, effort, let_go)[1]
    except np.linalg.LinAlgError as error:
        raise NotFoundError(str(error), state) from error


def let_go(share: float) -> Level:
    """Return the level without loads at which a share of what is out of balance at the start acts."""
    return Level(0.0, 1.0 - share)


def _let_down(problem: Problem, effort: Effort) -> tuple[Problem, State]:
    """Return the same of a scene in which something is loose, or rests on an edge, without the loads."""
    try:
        state = relaxed(problem, problem.begin(), effort, 0.0)
    except NotFoundError as error:
        raise NotFoundError("there is no equilibrium without the loads", error.state) from error
    loose = _loose(problem, state, 0.0)
    if not len(loose):
        return problem, state
    try:
        light = relaxed(problem, state, effort, LIGHT)
    except NotFoundError as error:
        raise NotFoundError("without the loads nothing holds what they push", error.state) from error
    free = _loose(problem, light, LIGHT)
    if len(free) < len(loose):
        return replace(problem, least=LIGHT, free=free), light
    return replace(problem, free=loose), state


def _loose(problem: Problem, state: State, load: float) -> Array:
    """Return the motions that nothing resists, (k, n)."""
    values, motions, _ = lowest(problem, state, load)
    return np.asarray(motions[values == 0.0])
