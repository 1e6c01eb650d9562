"""Equilibrium or steady rotation next to a state of a scene, wherever it would go to by itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.matrices import is_sparse
from hfsim.mechanics.statics.equilibrium import STAYED
from hfsim.mechanics.statics.newton import HOLD, Effort, stepped
from hfsim.mechanics.statics.problem import Problem, State
from hfsim.mechanics.statics.stability import are_pushed, neutral
from hfsim.mechanics.turning import Turning
from hfsim.scene.equilibrium import equilibrium_of, problem_of, standing, why_not
from hfsim.scene.gauging import Assembled, gauge_of, rigid_motions


def nearby(scene: Assembled, t: float, x: Array, turning: Turning, moving: bool = True) -> Array | None:
    """Return the coordinates (n_x,), next to some, that turn without a change of shape.

    With a spin of zero they are at rest.  All loads act in full; what is not balanced by inertia in the
    given place is taken away in steps where need be.  What servos go to counts as moving, or as standing.

    Returns
    -------
    ndarray or None
        None if there are none so near.
    """
    time, place = np.array([t]), x[None]
    problem, u = problem_of(scene, t, varied=(), x=place, moving=moving), turning.rates(place)
    system = standing(scene.system, moving)
    _, multipliers = system.equations.solve(time, place, u, system.force(time, place, u))
    start = problem.start._replace(multipliers=multipliers)
    problem = replace(problem, start=start, turning=turning)
    for way in _ways(problem, _free(scene, problem, start)):
        found = _found(scene, problem, way)
        if found is not None:
            return np.asarray(problem.expand(found.z)[0])
    return None


def _free(scene: Assembled, problem: Problem, state: State) -> Array:
    """Return the motions (k, n) that nothing resists in a state."""
    return neutral(problem, state, 1.0, rigid_motions(scene, problem.expand(state.z)))


def _found(scene: Assembled, problem: Problem, way: Problem) -> State | None:
    """Return the state that a way leads to; None without, or where something free goes on from there.

    What nothing resists at the start may have a weight where all else has bent: then it is let go there, and
    comes to rest by that.
    """
    share, state = stepped(way, Effort())
    while share == 1.0 and way.free is not None and are_pushed(problem, state, way.free):
        free = _free(scene, problem, state)
        if len(free) >= len(way.free):
            return None
        way = _held(problem.starting(state), free)
        share, state = stepped(way, Effort())
    return state if share == 1.0 else None


def _held(problem: Problem, free: Array) -> Problem:
    """Return a problem in which free motions (k, n) are held, and what only inertia may bring back."""
    turning = problem.turning is not None and problem.turning.rate
    # rounding of large forces would lead far along them
    return replace(problem, hold=HOLD if turning or len(free) else 0.0, free=free if len(free) else None)


def _ways(problem: Problem, free: Array) -> Iterator[Problem]:
    """Yield how the search may hold what nothing brings back, among this free motions (k, n) of the start."""
    if len(free) and not are_pushed(problem, problem.start, free):
        yield _held(problem, free)
    # what holds nothing bends corrections of fine meshes: these are soft beside their stiffest parts
    for hold in sorted({_held(problem, free).hold, HOLD}):
        yield replace(problem, hold=hold)


def resting(scene: Assembled) -> Array:
    """Return the coordinates (n_x,) of the equilibrium next to the start.

    With none so near, it is the one in which the scene comes to rest; where it does not, one further off.

    Raises
    ------
    SolverFailure
        If there is none at all.
    """
    start, n_dim = scene.system.absolute(scene.q[None])[0], scene.deck.dimension
    sparse = is_sparse(scene.system.equations.constant_mass)
    still = Turning.of(scene.bodies.values(), np.zeros(1 if n_dim == 2 else 3), np.zeros(n_dim), sparse)
    try:
        near = nearby(scene, 0.0, start, still, moving=False)
    except np.linalg.LinAlgError:
        near = None
    if near is not None and gauge_of(scene).size((near - start)[None]) < STAYED:
        return near
    found = equilibrium_of(scene, problem_of(scene))
    if not found.reason:
        return np.asarray(scene.system.reduction.expand(found.state.z)[0])
    if near is None:
        raise why_not(scene, 0.0, found)
    return near
