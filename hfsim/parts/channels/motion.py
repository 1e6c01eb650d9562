"""Positions, velocities and angles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.parts.channels._base import ChannelKind, Plot, Samples

_POSITION, _VELOCITY = Plot("position", "position", rows=True), Plot("velocity")


def _position(axis: int) -> Callable[[Samples, str], Array]:
    return lambda samples, point: samples.scene.marker(point).position(samples.x)[:, axis]


def _velocities(samples: Samples, point: str) -> Array:
    """Return the velocity of a point [m/s], shape (n_times, n_dim)."""
    return samples.scene.marker(point).velocity(samples.x, samples.u)


def _velocity(axis: int) -> Callable[[Samples, str], Array]:
    return lambda samples, point: _velocities(samples, point)[:, axis]


def _speed(samples: Samples, point: str) -> Array:
    return np.asarray(np.linalg.norm(_velocities(samples, point), axis=1))


def _angular_velocity(samples: Samples, body: str) -> Array:
    return samples.scene.marker(body).spin(samples.x, samples.u)[:, 0]


X, Y = (ChannelKind("m", _position(axis), "point", _POSITION) for axis in (0, 1))
Z = ChannelKind("m", _position(2), "point", _POSITION, dimensions=(3,))
"""Absolute position of a point."""

VX, VY = (ChannelKind("m/s", _velocity(axis), "point", _VELOCITY) for axis in (0, 1))
SPEED = ChannelKind("m/s", _speed, "point", _VELOCITY)
"""Magnitude of the velocity of a point."""

ANGLE = ChannelKind("rad", Samples.frame_angle, "body", Plot("angle", "angle"), in_frame=True)
"""Angle of a body frame, continuous over full turns."""
ANGULAR_VELOCITY = ChannelKind(
    "rad/s", _angular_velocity, "body", Plot("angular velocity", "angular_velocity")
)
