"""Forces and moments in joints: what the first body does to the second."""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.parts.channels._base import Samples


def _reaction(samples: Samples, joint: str) -> tuple[Array, Array]:
    system = samples.scene.system
    force, moment = np.zeros((len(samples.t), 2)), np.zeros(len(samples.t))
    for k in samples.scene.joints[joint]:
        f, m = system.constraints[k].reaction(samples.x, samples.multipliers[:, system.unreduced.rows[k]])
        force, moment = force + f, moment + m
    return force, moment


def force_x(samples: Samples, joint: str, quantity: str) -> Array:
    """Return the x component of the force on the second body of a joint [N]."""
    return _reaction(samples, joint)[0][:, 0]


def force_y(samples: Samples, joint: str, quantity: str) -> Array:
    """Return the y component of the force on the second body of a joint [N]."""
    return _reaction(samples, joint)[0][:, 1]


def moment(samples: Samples, joint: str, quantity: str) -> Array:
    """Return the moment on the second body of a joint [N m]."""
    return _reaction(samples, joint)[1]
