"""Deformation of a body in a run: its own, or the one that the forces it carries would cause at rest.

Inertia, weight, joints, springs and loads of a rigid motion bend and stretch a slender body as a static load
would.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.mechanics.body import Body, Load
from hfsim.mechanics.deformation import Deformation
from hfsim.scene.build import Scene


def deformation_of(scene: Scene, body: Body, t: Array, q: Array, v: Array) -> Deformation:
    """Return how a body is deformed; of one that is rigid, how the forces on it would deform it.

    Parameters
    ----------
    scene : Scene
    body : Body
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
    a = system.equations.accelerations(t, x, u, system.force(t, x, u))
    return body.statics(x, u, system.reduction.expand_rates(a), _loads(scene, body, t, x, u))


def _loads(scene: Scene, body: Body, t: Array, x: Array, u: Array) -> Iterator[Load]:
    """Yield what joints, springs and loads do to a body."""
    system = scene.system
    multipliers = system.multipliers(t, x, u)
    for constraint, rows in zip(system.constraints, system.unreduced.rows, strict=True):
        for marker, J in zip(constraint.ends, constraint.jacobians(x), strict=True):
            if marker.columns == body.columns:
                yield marker, -(multipliers[:, None, rows] @ J)[:, 0]
    for part in (piece for whole in system.forces for piece in whole.pieces):
        for marker in part.markers:
            if marker.columns == body.columns:
                whole = np.zeros_like(x)
                part.add_force(t, x, u, whole)
                yield marker, whole[:, body.columns]
