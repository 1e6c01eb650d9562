"""Deformation that a beam of the model rigid would have under the forces it carries: quasi-static bending.

Inertia, weight, joints, springs and loads of the rigid motion bend and stretch the beam as a static load
would.  Seen from the root tangent, v''(x) = M(x) / EI and u'(x) = N(x) / EA, where N and M are resultants
of everything beyond x, with a, alpha and omega the motion of the mid-point c:

    M(x) = sum m_p + (x_p - x) F_p,y + int_x^L f_y(s) (s - x) ds        f = rho A (g - a - ...)
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.rotations import rotate
from hfsim.mechanics.markers import RigidMarker
from hfsim.parts.bodies.rigid_beam import RigidBeam
from hfsim.scene.build import Scene
from hfsim.trust.validity import Deformation

POINTS = 33
"""Equidistant places along the beam."""


def quasistatic(scene: Scene, body: RigidBeam, t: Array, q: Array, v: Array) -> Deformation:
    """Return the deformation that the forces on a rigid beam would cause, as `validity` looks at it.

    Parameters
    ----------
    scene : Scene
    body : RigidBeam
    t : ndarray, shape (n_times,)
    q, v : ndarray, shape (n_times, n)
        On the constraints.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the reactions are not determined.
    """
    properties, system = scene.deck.properties(body.name), scene.system
    x, u = system.absolute(q), system.absolute_velocity(q, v)
    force = system.force(t, x, u)
    ax = system.reduction.expand_rates(system.equations.accelerations(t, x, u, force))
    angle, omega = x[:, body.columns.start + 2], u[:, body.columns.start + 2]
    own = ax[:, body.columns]
    a = rotate(-angle, own[:, :2] - np.asarray(scene.deck.gravity))
    per_length = body.mass / body.length
    # f(s) = f0 + f1 (s - c), in body axes
    f0 = -per_length * a
    f1 = per_length * np.stack([omega**2, -own[:, 2]], axis=-1)
    places = np.linspace(0.0, body.length, POINTS)
    rest, arm = body.length - places, places - 0.5 * body.length
    first = arm * rest + 0.5 * rest**2
    second = 0.5 * arm * rest**2 + rest**3 / 3.0
    N = np.outer(f0[:, 0], rest) + np.outer(f1[:, 0], first)
    M = np.outer(f0[:, 1], 0.5 * rest**2) + np.outer(f1[:, 1], second)
    for marker, wrench in _wrenches(scene, body, t, x, u):
        at = marker.offset[0] + 0.5 * body.length
        local = rotate(-angle, wrench[:, :2])
        moment = wrench[:, 2] - marker.offset[0] * local[:, 1] + marker.offset[1] * local[:, 0]
        beyond = at > places
        N += local[:, :1] * beyond
        M += (moment[:, None] + local[:, 1:] * (at - places)) * beyond
    weights = np.full(POINTS, body.length / (POINTS - 1))
    weights[[0, -1]] *= 0.5
    curvature = M / properties.bending_stiffness
    step = 0.5 * np.diff(places) * (curvature[:, 1:] + curvature[:, :-1])
    slope = np.concatenate([np.zeros((len(t), 1)), np.cumsum(step, axis=1)], axis=1)
    axial = N / properties.axial_stiffness
    return Deformation(axial, slope, curvature, slope @ weights, omega, weights)


def _wrenches(
    scene: Scene, body: RigidBeam, t: Array, x: Array, u: Array
) -> Iterator[tuple[RigidMarker, Array]]:
    """Yield the points at which something acts on a body, with (F_x, F_y, moment about the mid-point)."""
    system = scene.system
    multipliers = system.multipliers(t, x, u)
    for constraint, rows in zip(system.constraints, system.unreduced.rows, strict=True):
        ends = zip((constraint.first, constraint.second), constraint.jacobians(x), strict=True)
        for marker, J in ends:
            if isinstance(marker, RigidMarker) and marker.columns == body.columns:
                yield marker, -(multipliers[:, None, rows] @ J)[:, 0]
    for part in system.forces:
        for marker in part.markers:
            if isinstance(marker, RigidMarker) and marker.columns == body.columns:
                whole = np.zeros_like(x)
                part.add_force(t, x, u, whole)
                yield marker, whole[:, body.columns]
