"""How well the joints hold."""

from __future__ import annotations

import numpy as np

from hfsim.arrays import Array
from hfsim.channels._base import Samples


def violation(samples: Samples, subject: str, quantity: str) -> Array:
    """Return the largest violation of the joints at position or velocity level [m or rad, per second]."""
    system, t, x = samples.scene.system, samples.t, samples.x
    if quantity == "position":
        gap = system.residual(t, x)
    else:
        gap = (system.jacobian(x) @ samples.u[..., None])[..., 0] + system.constraint_rate(t)
    return np.asarray(np.abs(gap).max(axis=1, initial=0.0))
