"""Going on with other models: the state of one scene as that of the same scene with other models."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from hfsim.integrators import Trajectory
from hfsim.maths.arrays import Array
from hfsim.maths.rotations import normal, rotate
from hfsim.mechanics.body import Body
from hfsim.mechanics.pose import Pose, Twist
from hfsim.mechanics.system import System
from hfsim.parts.bodies.nodal import NodalBeam
from hfsim.parts.bodies.rigid_beam import RigidBeam
from hfsim.run.turns import count_turns
from hfsim.scene.build import Scene
from hfsim.trust.quasistatic import quasistatic
from hfsim.trust.validity import Deformation

CLOSING = 4
"""Newton corrections in closing joints: the gaps are small, and what is left the projection closes."""


def hand_over(old: Scene, new: Scene, path: Trajectory) -> tuple[Scene, float]:
    """Return the new scene starting where a trajectory of the old one ends, and the energy that came in [J].

    What was rigid starts in the same rigid motion with the deformation that its forces would cause at rest:
    undeformed, it would ring.  Everything else keeps its positions, slopes and their rates.  Then the joints
    are closed, by rigid motions of whole bodies first.

    Parameters
    ----------
    old, new : Scene
        Of one deck.
    path : Trajectory
        Of the old scene.

    Raises
    ------
    ValueError
        If a body goes over to a model that its state has no counterpart in.
    """
    time, q, v = np.array([path.t_end]), path.q, path.v
    turns = count_turns(old, path, time)
    x, u = old.system.absolute(q[None]), old.system.absolute_velocity(q[None], v[None])
    arranged = old.system.arranged(q[None])
    angles = {
        name: float(turns[name][0]) if body.angle_column is None else float(arranged[0, body.angle_column])
        for name, body in old.bodies.items()
    }
    y, w, near = (np.zeros((1, new.system.n_x)) for _ in range(3))
    for name, body in new.bodies.items():
        before = old.bodies[name]
        if type(before) is type(body):
            y[:, body.columns], w[:, body.columns] = x[:, before.columns], u[:, before.columns]
        elif isinstance(before, RigidBeam):
            assert isinstance(body, NodalBeam)
            seen = quasistatic(old, before, time, q[None], v[None])
            y[0, body.columns], w[0, body.columns] = _deformed(
                before, body, seen, x, u, new.models[name] != "linear"
            )
        else:
            raise ValueError(f"'{name}' cannot go over from {old.models[name]} to {new.models[name]}")
        if body.angle_column is not None:
            near[0, body.angle_column] = angles[name]
    _close(new, time, y, angles)
    state, rate = new.system.state(y, w, new.system.reduction.free_rates(near))
    state, rate = new.system.project(time, state, rate)
    gained = _energy(new.system, time, state, rate) - _energy(old.system, time, q[None], v[None])
    return replace(new, q=state[0], v=rate[0], start_angles=angles), gained


def _deformed(
    before: RigidBeam, body: NodalBeam, seen: Deformation, x: Array, u: Array, green: bool
) -> tuple[Array, Array]:
    """Return nodal vectors and rates of a beam in the rigid motion of another, bent and stretched."""
    root = before.marker((0.0, 0.0))
    origin, angle = root.position(x)[0], float(root.angle(x)[0])
    own = u[:, before.columns]
    velocity = (root.position_jacobian(x) @ own[..., None])[0, :, 0]
    mesh, stride = body.mesh, body.mesh.element.stride
    nodes = mesh.undeformed[::stride, 0]
    places = np.linspace(0.0, mesh.length, seen.slope.shape[1])
    # bending alone stretches nothing where the strain counts the slope
    stretch = seen.axial[0] - (0.5 * seen.slope[0] ** 2 if green else 0.0)
    along, across = _integral(places, stretch), _integral(places, seen.slope[0])
    bent = mesh.undeformed.copy()
    for shift, (values, slopes) in enumerate(((along, stretch), (across, seen.slope[0]))):
        bent[::stride, shift] += np.interp(nodes, places, values)
        bent[1::stride, shift] += np.interp(nodes, places, slopes)
    if mesh.element.per_node == 3:
        # sections stay normal to the centre line
        bent[2::stride, 0] -= np.interp(nodes, places, seen.slope[0])
    turned = rotate(np.full(len(bent), angle), bent)
    shifts = mesh.positions[:, None]
    rates = float(own[0, 2]) * normal(turned) + shifts * velocity
    return np.asarray(turned + shifts * origin).ravel(), np.asarray(rates).ravel()


def _integral(places: Array, values: Array) -> Array:
    steps = 0.5 * np.diff(places) * (values[1:] + values[:-1])
    return np.concatenate([[0.0], np.cumsum(steps)])


def _close(scene: Scene, t: Array, y: Array, angles: Mapping[str, float]) -> None:
    """Close the joints by rigid motions of the bodies, in place."""
    system = scene.system
    if not system.constraints:
        return
    for _ in range(CLOSING):
        gap = system.residual(t, y)[0]
        motions = np.concatenate([_motions(body, y, angles[name]) for name, body in scene.bodies.items()])
        moves = np.linalg.lstsq(system.unreduced.jacobians(y)[0] @ motions.T, -gap, rcond=1e-10)[0]
        y += moves @ motions


def _motions(body: Body, y: Array, angle: float) -> Array:
    """Return the changes of x with the rigid freedoms of a body, shape (3, n_x)."""
    motions = np.zeros((3, y.shape[1]))
    pose = Pose.planar((0.0, 0.0), angle)
    for k, twist in enumerate(Twist.units(2)):
        motions[k, body.columns] = body.moving(pose, twist)
    if isinstance(body, NodalBeam):
        vectors = y[0, body.columns].reshape(-1, 2)
        motions[2, body.columns] = normal(vectors - body.mesh.positions[:, None] * vectors[0]).ravel()
    return motions


def _energy(system: System, t: Array, q: Array, v: Array) -> float:
    x, u = system.absolute(q), system.absolute_velocity(q, v)
    return float((system.kinetic_energy(x, u) + system.strain_energy(x) + system.potential_energy(t, x))[0])
