"""Positions, velocities and angles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.rotations import quaternion, rotation_vector
from hfsim.parts.channels._base import ChannelKind, Plot, Samples

_POSITION, _VELOCITY = Plot("position", "position", rows=True), Plot("velocity", "velocity")


def _position(axis: int) -> Callable[[Samples, str], Array]:
    return lambda samples, point: samples.scene.marker(point).position(samples.x)[:, axis]


def _velocities(samples: Samples, point: str) -> Array:
    """Return the velocity of a point [m/s], shape (n_times, n_dim)."""
    return samples.scene.marker(point).velocity(samples.x, samples.u)


def _velocity(axis: int) -> Callable[[Samples, str], Array]:
    return lambda samples, point: _velocities(samples, point)[:, axis]


def _speed(samples: Samples, point: str) -> Array:
    return np.asarray(np.linalg.norm(_velocities(samples, point), axis=1))


def _angular_velocity(axis: int) -> Callable[[Samples, str], Array]:
    return lambda samples, body: samples.scene.marker(body).spin(samples.x, samples.u)[:, axis]


def _rotation(axis: int) -> Callable[[Samples, str], Array]:
    return lambda samples, body: rotation_vector(samples.frame(body))[:, axis]


def _the_other_way(vectors: Array) -> Array:
    """Return the rotation vectors (n_times, n) of the same turns about the opposite axes."""
    angles = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors - 2.0 * np.pi * vectors / np.maximum(angles, np.finfo(float).tiny))


def _quaternion(part: int) -> Callable[[Samples, str], Array]:
    return lambda samples, body: quaternion(samples.frame(body))[:, part]


X, Y = (ChannelKind("m", _position(axis), "point", _POSITION) for axis in (0, 1))
Z = ChannelKind("m", _position(2), "point", _POSITION, dimensions=(3,))
"""Absolute position of a point."""

VX, VY = (ChannelKind("m/s", _velocity(axis), "point", _VELOCITY) for axis in (0, 1))
VZ = ChannelKind("m/s", _velocity(2), "point", _VELOCITY, dimensions=(3,))
SPEED = ChannelKind("m/s", _speed, "point", _VELOCITY)
"""Magnitude of the velocity of a point."""

_ANGLE = Plot("angle", "angle")
ANGLE = ChannelKind("rad", Samples.frame_angle, "body", _ANGLE, dimensions=(2,), in_frame=True)
"""Angle of a body frame, continuous over full turns."""
_SPIN = Plot("angular velocity", "angular_velocity")
ANGULAR_VELOCITY = ChannelKind("rad/s", _angular_velocity(0), "body", _SPIN, dimensions=(2,))
SPINS = tuple(
    ChannelKind("rad/s", _angular_velocity(axis), "body", _SPIN, dimensions=(3,)) for axis in range(3)
)
"""Angular velocity of a body frame, in ground axes."""

_ROTATION = Plot("rotation vector", "rotation")
ROTATIONS = tuple(
    ChannelKind("rad", _rotation(axis), "body", _ROTATION, dimensions=(3,), others=_the_other_way)
    for axis in range(3)
)
"""Rotation vector of a body frame, of half a turn at most."""
_QUATERNION = Plot("quaternion", "quaternion")
QUATERNIONS = tuple(
    ChannelKind("-", _quaternion(part), "body", _QUATERNION, dimensions=(3,), others=np.negative)
    for part in range(4)
)
"""Unit quaternion of a body frame; its scalar part is not negative."""
