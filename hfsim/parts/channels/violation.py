"""How well the joints hold."""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.parts.channels._base import Samples


def violation(samples: Samples, subject: str, quantity: str) -> Array:
    """Return the largest violation of the joints at position or velocity level [m or rad, per second]."""
    system, t, x = samples.scene.system, samples.t, samples.x
    gap = system.residual(t, x) if quantity == "position" else system.drift(t, x, samples.u)
    return np.asarray(np.abs(gap).max(axis=1, initial=0.0))
