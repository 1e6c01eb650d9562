"""Equilibrium or steady rotation next to a state of a scene, wherever it would go to by itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.matrices import is_sparse
from hfsim.mechanics.statics.equilibrium import STAYED
from hfsim.mechanics.statics.newton import HOLD, Effort, stepped
from hfsim.mechanics.statics.problem import Problem
from hfsim.mechanics.statics.stability import are_pushed, neutral
from hfsim.mechanics.turning import Turning
from hfsim.scene.equilibrium import equilibrium_of, problem_of, rigid_motions, standing, why_not
from hfsim.scene.gauging import Assembled, gauge_of


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
    free = neutral(problem, start, 1.0, rigid_motions(scene, place))
    for way in _ways(problem, free):
        share, state = stepped(way, Effort())
        if share == 1.0 and not (way.free is not None and are_pushed(problem, state, free)):
            return np.asarray(problem.expand(state.z)[0])
    return None


def _ways(problem: Problem, free: Array) -> Iterator[Problem]:
    """Yield how the search may hold what nothing brings back, among this free motions (k, n) of the start."""
    turning = problem.turning is not None and problem.turning.rate
    if len(free) and not are_pushed(problem, problem.start, free):
        # rounding of large forces would lead far along them
        yield replace(problem, hold=HOLD, free=free)
    # what holds nothing bends corrections of fine meshes: these are soft beside their stiffest parts
    for hold in (HOLD,) if turning or len(free) else (0.0, HOLD):
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
