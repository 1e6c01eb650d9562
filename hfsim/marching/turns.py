"""Full turns of angles that are measured from slopes, counted along the steps of a trajectory."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from hfsim.integrators import Trajectory
from hfsim.maths.arrays import Array, distinct
from hfsim.scene.build import Scene
from hfsim.scene.measured import uncounted


def read_states(
    scene: Scene, trajectory: Trajectory, times: Array, angles: Mapping[str, float] | None = None
) -> tuple[Array, Array, dict[str, Array]]:
    """Return states (q, v) at some times, and angles [rad], with all their turns, that coordinates have not.

    They are those of frames of bodies, and of joints and springs that channels ask for.

    Parameters
    ----------
    times : ndarray, shape (n_times,)
        In order, within the trajectory.
    angles : mapping of str to float, optional
        Angles at its start [rad]; without them those of the scene.

    Returns
    -------
    q, v : ndarray, shape (n_times, n)
    turns : dict of str to ndarray, shape (n_times,)
    """
    angles_of = _counted(scene)
    if not angles_of or not len(times):
        return *trajectory.at(times), {}
    ends = trajectory.step_ends()
    inner = (ends[:-1, None] + np.diff(ends)[:, None] * np.array([0.25, 0.5, 0.75])).ravel()
    every = distinct(np.concatenate([ends, inner, times]))
    q, v = trajectory.at(every)
    x = scene.system.absolute(q)
    at = np.searchsorted(every, times)
    turns = {}
    for name, angle_of in angles_of.items():
        angle = np.unwrap(angle_of(x))
        start = (scene.start_angles if angles is None else angles)[name]
        turns[name] = (angle + 2.0 * np.pi * np.round((start - angle[0]) / (2.0 * np.pi)))[at]
    return q[at], v[at], turns


def _counted(scene: Scene) -> dict[str, Callable[[Array], Array]]:
    """Return what measures the angles whose turns are counted, by the names of bodies, joints and springs."""
    found: dict[str, Callable[[Array], Array]] = {name: tie.angle for name, tie in uncounted(scene).items()}
    if scene.deck.dimension == 2:
        unread, bodies = scene.left_out["turns"], scene.bodies.items()
        free = (name for name, body in bodies if body.angle_column is None)
        read = (name for name in free if f"turns of bodies.{name}" not in unread)
        found.update({name: scene.marker(name).angle for name in read})
    return found
