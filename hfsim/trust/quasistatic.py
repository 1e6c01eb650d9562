"""Deformation of a body in a run: its own, or the one that the forces it carries would cause at rest.

Inertia, weight, joints, springs and loads of a rigid motion bend and stretch a slender body as a static load
would.
"""

from __future__ import annotations

from hfsim.maths.arrays import Array
from hfsim.mechanics.acting import loads_on
from hfsim.mechanics.body import Body
from hfsim.mechanics.deformation import Deformation
from hfsim.scene.build import Scene


def deformation_of(scene: Scene, body: Body, t: Array, q: Array, v: Array) -> Deformation:
    """Return how a body is deformed; of one that is rigid, how the forces on it would deform it.

    Parameters
    ----------
    t : ndarray, shape (n_times,)
    q, v : ndarray, shape (n_times, n)
        On the constraints.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the reactions on a rigid body are not determined.
    """
    system = scene.system
    x, u = system.absolute(q), system.absolute_velocity(q, v)
    own = body.deformation(x, u)
    if own is not None:
        return own
    a, multipliers = system.solved(t, x, u)
    return body.statics(x, u, a, loads_on(system, body.columns, t, x, u, multipliers, system.forces))
