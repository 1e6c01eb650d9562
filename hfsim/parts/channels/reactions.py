"""Forces and moments in joints: what the first body does to the second."""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.parts.channels._base import Samples


def _reaction(samples: Samples, joint: str) -> tuple[Array, Array]:
    """Return force, (n_times, n_dim), and moment, (n_times, n_spin), of all equations of a joint."""
    system, parts = samples.scene.system, []
    for k in samples.scene.joints[joint]:
        multipliers = samples.multipliers[:, system.unreduced.rows[k]]
        parts.append(system.constraints[k].reaction(samples.x, multipliers))
    force, moment = (np.asarray(sum(kind)) for kind in zip(*parts, strict=True))
    return force, moment


def force_x(samples: Samples, joint: str, quantity: str) -> Array:
    """Return the x component of the force on the second body of a joint [N]."""
    return _reaction(samples, joint)[0][:, 0]


def force_y(samples: Samples, joint: str, quantity: str) -> Array:
    """Return the y component of the force on the second body of a joint [N]."""
    return _reaction(samples, joint)[0][:, 1]


def moment(samples: Samples, joint: str, quantity: str) -> Array:
    """Return the moment on the second body of a joint [N m]."""
    return _reaction(samples, joint)[1][:, 0]
