"""How well the joints hold."""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.parts.channels._base import ChannelKind, Plot, Samples

_PLOT = Plot("constraint violation", "constraint")


def _position(samples: Samples, subject: str) -> Array:
    gap = samples.scene.system.residual(samples.t, samples.x)
    return np.asarray(np.abs(gap).max(axis=1, initial=0.0))


def _velocity(samples: Samples, subject: str) -> Array:
    drift = samples.scene.system.drift(samples.t, samples.x, samples.u)
    return np.asarray(np.abs(drift).max(axis=1, initial=0.0))


POSITION = ChannelKind("m", _position, "constraint", _PLOT, judged="never")
VELOCITY = ChannelKind("m/s", _velocity, "constraint", _PLOT, judged="never")
"""Largest violation of the joints, of lengths and angles alike, at position and velocity level."""
