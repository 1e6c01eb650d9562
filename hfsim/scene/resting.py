"""A scene that starts from its equilibrium, or some bodies of it, with the rates that the deck states."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.matrices import dense
from hfsim.scene.equilibrium import (
    Assembled,
    Turns,
    doubts,
    equilibrium_of,
    problem_of,
    rigid_motions,
    why_not,
)
from hfsim.scene.initial import AT_REST

FIRM, LOOSE = 1e-3, 1e-9
"""Weights of rates that are stated, and of those that follow from joints, whose own is one."""


class Rest(NamedTuple):
    """The state at the start of a scene at rest.

    Attributes
    ----------
    q, v : ndarray, shape (n,)
    start_angles : dict of str to float
        Angles of body frames [rad].
    rest : tuple of str
        What is to be told of it.
    """

    q: Array
    v: Array
    start_angles: dict[str, float]
    rest: tuple[str, ...]


def at_rest(scene: Assembled) -> Rest:
    """Return the start with those bodies at rest that are to be, under what acts on them at t = 0.

    Raises
    ------
    DeckError
        If there is no equilibrium.
    """
    loaded, turns = scene.loaded, Turns(scene)
    some = scene.deck.resting
    bodies = None if set(some) >= set(scene.bodies) else some
    problem = problem_of(scene, 0.0, turns, bodies=bodies)
    turns.expand = problem.expand
    found = equilibrium_of(scene, problem, bodies)
    if found.reason:
        why = why_not(scene, 0.0, found)
        raise loaded.problem(f"initial.{AT_REST}", f"there is none: {why}", why.remedy)
    turns(1.0, found.state)
    x = problem.expand(found.state.z)
    q, v = scene.system.state(x, _rates(scene, x), turns.q)
    q, v = scene.system.project(np.zeros(1), q, v)
    told = tuple(f"initial.{AT_REST}: {one}" for one in doubts(scene, found))
    angles = {**scene.start_angles, **turns.angles}
    for name, body in scene.bodies.items():
        if body.angle_column is not None:
            angles[name] = float(scene.system.arranged(q)[0, body.angle_column])
    return Rest(q[0], v[0], angles, told)


def _rates(scene: Assembled, x: Array) -> Array:
    """Return the rates (1, n_x) with which bodies, as they are deformed, move as the deck states.

    What it does not state follows from the joints, as at any start.
    """
    deck, names = scene.deck, [name for name, body in scene.bodies.items() if not body.still]
    twists = [scene.assembly.twists[name] for name in names]
    wanted = np.concatenate([part for twist in twists for part in (twist.velocity, twist.spin)])
    if not wanted.any():
        return np.zeros_like(x)
    stated = []
    for name, twist in zip(names, twists, strict=True):
        own = deck.motions.get(name)
        stated += [own is not None and own.velocity is not None] * len(twist.velocity)
        stated += [own is not None and own.angular_velocity is not None] * len(twist.spin)
    motions, weights = rigid_motions(scene, x), np.where(stated, FIRM, LOOSE)
    phi = scene.system.unreduced.phi
    held = dense(phi.jacobian_at(x) @ motions.T)
    rows = np.concatenate([held, np.diag(weights)])
    aim = np.concatenate([-phi.rate(np.zeros(1))[0], weights * wanted])
    return np.asarray(np.linalg.lstsq(rows, aim, rcond=1e-14)[0] @ motions)[None]
