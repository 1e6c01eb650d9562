"""Forces and moments in joints: what the first body does to the second."""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.parts.channels._base import ChannelKind, Plot, Samples


def _reaction(samples: Samples, joint: str) -> tuple[Array, Array]:
    """Return force, (n_times, n_dim), and moment, (n_times, n_spin), of all equations of a joint."""
    system, parts = samples.scene.system, []
    for k in samples.scene.joints[joint]:
        multipliers = samples.multipliers[:, system.unreduced.rows[k]]
        parts.append(system.constraints[k].reaction(samples.x, multipliers))
    force, moment = (np.asarray(sum(kind)) for kind in zip(*parts, strict=True))
    return force, moment


def _force_x(samples: Samples, joint: str) -> Array:
    return _reaction(samples, joint)[0][:, 0]


def _force_y(samples: Samples, joint: str) -> Array:
    return _reaction(samples, joint)[0][:, 1]


def _moment(samples: Samples, joint: str) -> Array:
    return _reaction(samples, joint)[1][:, 0]


FORCE_X = ChannelKind("N", _force_x, "joint", Plot("force"))
FORCE_Y = ChannelKind("N", _force_y, "joint", Plot("force"))
MOMENT = ChannelKind("N m", _moment, "joint", Plot("moment"))
