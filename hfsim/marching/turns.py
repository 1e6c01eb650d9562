"""Full turns of bodies whose angle is measured from slopes, counted along the steps of a trajectory."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hfsim.integrators import Trajectory
from hfsim.maths.arrays import Array, distinct
from hfsim.scene.build import Scene


def count_turns(
    scene: Scene, trajectory: Trajectory, times: Array, angles: Mapping[str, float] | None = None
) -> dict[str, Array]:
    """Return the frame angles [rad], full turns included, of bodies without a frame coordinate.

    Parameters
    ----------
    scene : Scene
    trajectory : Trajectory
    times : ndarray, shape (n_times,)
        In order, within the trajectory.
    angles : mapping of str to float, optional
        Angles at its start [rad]; without them those of the scene.

    Returns
    -------
    dict of str to ndarray, shape (n_times,)
    """
    if scene.deck.dimension == 3:
        return {}
    unread = scene.left_out["turns"]
    names = [
        name
        for name, body in scene.bodies.items()
        if body.angle_column is None and f"turns of bodies.{name}" not in unread
    ]
    if not names or not len(times):
        return {}
    ends = trajectory.step_ends()
    inner = (ends[:-1, None] + np.diff(ends)[:, None] * np.array([0.25, 0.5, 0.75])).ravel()
    every = distinct(np.concatenate([ends, inner, times]))
    x = scene.system.absolute(trajectory.at(every)[0])
    at = np.searchsorted(every, times)
    turns = {}
    for name in names:
        angle = np.unwrap(scene.marker(name).angle(x))
        start = (scene.start_angles if angles is None else angles)[name]
        turns[name] = (angle + 2.0 * np.pi * np.round((start - angle[0]) / (2.0 * np.pi)))[at]
    return turns
