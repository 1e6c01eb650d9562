"""What a joint exerts on its second body: by what it holds, and by what resists or drives it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.mechanics.constraints import Constraint
from hfsim.parts.channels._base import Samples


def joint_multipliers(samples: Samples, joint: str) -> Iterator[tuple[Constraint, Array]]:
    """Yield the constraints of a joint with their multipliers, (n_times, n_rows)."""
    system = samples.scene.system
    for k in samples.scene.joints[joint]:
        yield system.constraints[k], samples.multipliers[:, system.unreduced.rows[k]]


def reaction(samples: Samples, joint: str) -> tuple[Array, Array]:
    """Return force, (n_times, n_dim), and moment, (n_times, n_spin), of all that a joint exerts."""
    held = [one.reaction(samples.x, own) for one, own in joint_multipliers(samples, joint)]
    acting = [tie.reaction(*samples.state) for tie in samples.scene.ties(joint)]
    force, moment = (np.asarray(sum(kind)) for kind in zip(*held, *acting, strict=True))
    return force, moment
