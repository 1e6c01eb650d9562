"""Forces and moments in joints: what the first body does to the second."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.parts.channels._base import ChannelKind, Plot, Samples


def _reaction(samples: Samples, joint: str) -> tuple[Array, Array]:
    """Return force, (n_times, n_dim), and moment, (n_times, n_spin), of all that a joint exerts."""
    system, parts = samples.scene.system, []
    for k in samples.scene.joints[joint]:
        multipliers = samples.multipliers[:, system.unreduced.rows[k]]
        parts.append(system.constraints[k].reaction(samples.x, multipliers))
    from hfsim.mechanics.ties import GapTie

    for part in system.forces:
        if isinstance(part, GapTie) and part.item.split(".")[:2] == ["joints", joint]:
            parts.append(part.reaction(samples.t, samples.x, samples.u))
    force, moment = (np.asarray(sum(kind)) for kind in zip(*parts, strict=True))
    return force, moment


def _component(which: int, axis: int) -> Callable[[Samples, str], Array]:
    return lambda samples, joint: _reaction(samples, joint)[which][:, axis]


_FORCE, _MOMENT = Plot("joint force", "joint_force"), Plot("joint moment", "joint_moment")
FORCE_X, FORCE_Y = (ChannelKind("N", _component(0, axis), "joint", _FORCE) for axis in range(2))
FORCE_Z = ChannelKind("N", _component(0, 2), "joint", _FORCE, dimensions=(3,))
MOMENT = ChannelKind("N m", _component(1, 0), "joint", _MOMENT, dimensions=(2,))
MOMENTS = tuple(
    ChannelKind("N m", _component(1, axis), "joint", _MOMENT, dimensions=(3,)) for axis in range(3)
)
