"""Going on with other models: the state of one scene as that of the same scene with other models."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hfsim.errors import SolverFailure
from hfsim.integrators import Trajectory
from hfsim.marching.culprit import in_scale
from hfsim.marching.turns import read_states
from hfsim.maths.arrays import Array
from hfsim.maths.matrices import smallest_step
from hfsim.maths.rotations import rotation_vector
from hfsim.mechanics.body import Body
from hfsim.mechanics.pose import Pose, Twist
from hfsim.mechanics.system import System
from hfsim.scene.build import Scene
from hfsim.scene.gauging import rigid_motions
from hfsim.scene.measured import uncounted
from hfsim.trust.experiments import command_exact
from hfsim.trust.quasistatic import deformation_of

CLOSING = 4
"""Newton corrections in closing joints: the gaps are small, and what is left the projection closes."""
UNCHANGED = 1e-10
"""Change of an equation over the terms that it is the sum of, at which it is none."""


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
    SolverFailure
        If no state is found to start in.
    """
    with path.past.recalled(), np.errstate(all="ignore"):
        try:
            return _handed_over(old, new, path)
        except np.linalg.LinAlgError as told:
            raise _not_found(old, new, path, str(told)) from told


def _not_found(old: Scene, new: Scene, path: Trajectory, why: str) -> SolverFailure:
    """Return the failure of a change of models."""
    name, after = next((name, model) for name, model in new.models.items() if model != old.models[name])
    return SolverFailure(
        reason=f"'{name}' cannot go over from {old.models[name]} to {after} at t = {path.t_end:.4g} s: {why}",
        time=path.t_end,
        item=new.bodies[name].item,
        evidence={"next_model": after},
        remedy=command_exact(new, name, force=True),
    )


def _handed_over(old: Scene, new: Scene, path: Trajectory) -> tuple[Scene, float]:
    time, q, v = np.array([path.t_end]), path.q, path.v
    _, _, turns = read_states(old, path, time)
    x, u = old.system.absolute(q[None]), old.system.absolute_velocity(q[None], v[None])
    hand_memory(old.system, new.system, time, x)
    arranged, angles = old.system.arranged(q[None]), dict(old.start_angles)
    turns = {name: old.coordinate(name, "rad").measured(time, x)[0] for name in uncounted(new)} | turns
    angles |= {name: float(turn[0]) for name, turn in turns.items()}
    for name, body in old.bodies.items():
        if body.angle_column is not None:
            angles[name] = float(arranged[0, body.angle_column])
    new = replace(new, start_angles=angles)
    y, w, near = (np.zeros((1, new.system.n_x)) for _ in range(3))
    for name, body in new.bodies.items():
        before = old.bodies[name]
        if body.coordinates == before.coordinates:
            y[:, body.columns], w[:, body.columns] = x[:, before.columns], u[:, before.columns]
        else:
            seen = deformation_of(old, before, time, q[None], v[None])
            try:
                y[0, body.columns], w[0, body.columns] = body.deformed(*_motion(before, x, u), seen)
            except NotImplementedError:
                models = f"from {old.models[name]} to {new.models[name]}"
                raise ValueError(f"'{name}' cannot go over {models}") from None
        if body.angle_column is not None:
            near[0, body.angle_column] = angles[name]
    _close(new, time, y)
    state, rate = new.system.state(y, w, new.system.reduction.free_rates(near))
    state, rate = new.system.project(time, state, rate)
    if not (in_scale(state[0], path.q) and in_scale(rate[0], path.v)):
        raise np.linalg.LinAlgError("the state to start in is beyond all scale")
    gained = _energy(new.system, time, state, rate) - _energy(old.system, time, q[None], v[None])
    return replace(new, q=state[0], v=rate[0], begin=float(path.t_end)), gained


def hand_memory(old: System, new: System, t: Array, x: Array) -> None:
    """Say of springs which turns their angles are in, and what has happened, from a state (1, n)."""
    before = {part.item: part for part in old.forces}
    for part in (one for one in new.forces if not one.counts_for_others):
        for event, known in zip(part.events, before[part.item].events if part.events else (), strict=True):
            event.take_from(known)
        for k, one in enumerate(part.angles):
            if one.counter is not None:
                same = before[part.item].angles[k]
                angle = same.angle(x) if same.counter is None else same.counter.counted(t, same.angle(x))
                one.counter.suppose(float(t[0]), float(angle[0]))


def _motion(body: Body, x: Array, u: Array) -> tuple[Pose, Twist]:
    """Return where the frame of a body is in one state, (1, n), and how it moves."""
    root = body.marker(body.origin)
    twist = Twist(root.velocity(x, u)[0], root.spin(x, u)[0])
    turn = root.angle(x) if root.n_dim == 2 else rotation_vector(root.frame(x)[0])
    return Pose(root.position(x)[0], turn), twist


def _close(scene: Scene, t: Array, y: Array) -> None:
    """Close the joints by rigid motions of the bodies, in place, as far as these can."""
    phi = scene.system.unreduced.phi
    if not phi.constraints:
        return
    gap = phi.residual(t, y)[0]
    for _ in range(CLOSING):
        motions = rigid_motions(scene, y)
        trial = y - smallest_step(_changes(phi.jacobians(y)[0], motions), gap) @ motions
        left = phi.residual(t, trial)[0]
        if not left @ left < gap @ gap:
            return
        y[:], gap = trial, left


def _changes(J: Array, motions: Array) -> Array:
    """Return J (n_rows, n_x) times motions (n, n_x), (n_rows, n), without what is rounding of its terms.

    What bodies hold of themselves no rigid motion changes: rounding alone would say which motion closes it.
    """
    changes, terms = J @ motions.T, np.abs(J) @ np.abs(motions).T
    return np.where(np.abs(changes) > UNCHANGED * terms, changes, 0.0)


def _energy(system: System, t: Array, q: Array, v: Array) -> float:
    x, u = system.absolute(q), system.absolute_velocity(q, v)
    return float((system.kinetic_energy(x, u) + system.strain_energy(x) + system.potential_energy(t, x))[0])
