"""Equilibrium or steady rotation next to a state of a scene, wherever it would go to by itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.mechanics.statics.equilibrium import HOLD
from hfsim.mechanics.statics.newton import Effort, stepped
from hfsim.mechanics.turning import Turning
from hfsim.scene.equilibrium import problem_of
from hfsim.scene.gauging import Assembled


def nearby(scene: Assembled, t: float, x: Array, turning: Turning) -> Array | None:
    """Return the coordinates (n_x,), next to some, that turn without a change of shape.

    With a spin of zero they are at rest.  All loads act in full; what is not balanced by inertia in the
    given place is taken away in steps where need be.

    Returns
    -------
    ndarray or None
        None if there are none so near.
    """
    time, place = np.array([t]), x[None]
    problem, u = problem_of(scene, t, varied=(), x=place, moving=True), turning.rates(place)
    _, multipliers = scene.system.equations.solve(time, place, u, scene.system.force(time, place, u))
    start = problem.start._replace(multipliers=multipliers)
    problem = replace(problem, start=start, turning=turning, hold=HOLD)
    share, state = stepped(problem, Effort())
    return np.asarray(problem.expand(state.z)[0]) if share == 1.0 else None
