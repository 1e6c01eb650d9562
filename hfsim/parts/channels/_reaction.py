"""What a joint, or a spring, exerts on its second body: by what it holds, by what resists or drives it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.rotations import dot, freedoms
from hfsim.mechanics.constraints import Constraint
from hfsim.parts.channels._base import Samples


def joint_multipliers(samples: Samples, joint: str) -> Iterator[tuple[Constraint, Array]]:
    """Yield the constraints of a joint with their multipliers, (n_times, n_rows)."""
    system = samples.scene.system
    for k in samples.scene.joints.get(joint, ()):
        yield system.constraints[k], samples.multipliers[:, system.unreduced.rows[k]]


def reaction(samples: Samples, joint: str) -> tuple[Array, Array]:
    """Return force, (n_times, n_dim), and moment, (n_times, n_spin), of all that a joint exerts."""
    acting = [tie.reaction(*samples.state) for tie in samples.scene.ties(joint)]
    n_dim = next(iter(samples.scene.bodies.values())).n_dim
    none = np.zeros((len(samples.t), n_dim)), np.zeros((len(samples.t), freedoms(n_dim) - n_dim))
    force, moment = (
        np.sum(kind, axis=0) for kind in zip(none, *_held(samples, joint), *acting, strict=True)
    )
    return force, moment


def held_effort(samples: Samples, joint: str, per_unit: tuple[Array, Array], kind: int) -> list[Array]:
    """Return what is held of a joint along a coordinate, (n_times,) each.

    Parameters
    ----------
    per_unit : tuple of ndarray
        Force and moment that go with an effort of one on the coordinate.
    kind : int
        0 for a distance, 1 for an angle.
    """
    own = per_unit[kind]
    return [(dot(one[kind], own) / dot(own, own))[:, 0] for one in _held(samples, joint)]


def _held(samples: Samples, joint: str) -> list[tuple[Array, Array]]:
    """Return force and moment of each of a joint's constraints."""
    return [one.reaction(samples.x, own) for one, own in joint_multipliers(samples, joint)]
