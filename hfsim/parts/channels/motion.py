"""Positions, velocities and angles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.rotations import quaternion, rotation_vector
from hfsim.parts.channels._base import OF_ANGLES, OF_POSITIONS, OF_SPINS, ChannelKind, Plot, Samples

_VELOCITY = Plot("velocity", "velocity")


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


def _accelerations(samples: Samples, point: str) -> Array:
    """Return the acceleration of a point [m/s^2], shape (n_times, n_dim)."""
    return samples.scene.marker(point).acceleration(samples.x, samples.u, samples.solved[0])


def _acceleration(axis: int) -> Callable[[Samples, str], Array]:
    return lambda samples, point: _accelerations(samples, point)[:, axis]


def _acceleration_size(samples: Samples, point: str) -> Array:
    return np.asarray(np.linalg.norm(_accelerations(samples, point), axis=1))


def _angular_acceleration(axis: int) -> Callable[[Samples, str], Array]:
    def angular_acceleration(samples: Samples, body: str) -> Array:
        marker = samples.scene.marker(body)
        return marker.angular_acceleration(samples.x, samples.u, samples.solved[0])[:, axis]

    return angular_acceleration


def _rotation(axis: int) -> Callable[[Samples, str], Array]:
    return lambda samples, body: rotation_vector(samples.frame(body))[:, axis]


def _the_other_way(vectors: Array) -> Array:
    """Return the rotation vectors (n_times, n) of the same turns about the opposite axes."""
    angles = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors - 2.0 * np.pi * vectors / np.maximum(angles, np.finfo(float).tiny))


def _quaternion(part: int) -> Callable[[Samples, str], Array]:
    return lambda samples, body: quaternion(samples.frame(body))[:, part]


X, Y = (ChannelKind("m", _position(axis), "point", OF_POSITIONS) for axis in (0, 1))
Z = ChannelKind("m", _position(2), "point", OF_POSITIONS, dimensions=(3,))
"""Absolute position of a point."""

VX, VY = (ChannelKind("m/s", _velocity(axis), "point", _VELOCITY) for axis in (0, 1))
VZ = ChannelKind("m/s", _velocity(2), "point", _VELOCITY, dimensions=(3,))
SPEED = ChannelKind("m/s", _speed, "point", _VELOCITY)
"""Magnitude of the velocity of a point."""

_ACCELERATION = Plot("acceleration", "acceleration", rows=True)
AX, AY = (ChannelKind("m/s^2", _acceleration(axis), "point", _ACCELERATION, solves=True) for axis in (0, 1))
AZ = ChannelKind("m/s^2", _acceleration(2), "point", _ACCELERATION, solves=True, dimensions=(3,))
ACCELERATION = ChannelKind("m/s^2", _acceleration_size, "point", _ACCELERATION, solves=True)
"""Magnitude of the acceleration of a point."""

ANGLE = ChannelKind("rad", Samples.frame_angle, "body", OF_ANGLES, dimensions=(2,), of_turns=True)
"""Angle of a body frame, continuous over full turns."""
ANGULAR_VELOCITY = ChannelKind("rad/s", _angular_velocity(0), "body", OF_SPINS, dimensions=(2,))
SPINS = tuple(
    ChannelKind("rad/s", _angular_velocity(axis), "body", OF_SPINS, dimensions=(3,)) for axis in range(3)
)
"""Angular velocity of a body frame, in ground axes."""
_CHANGE = Plot("angular acceleration", "angular_acceleration")
ANGULAR_ACCELERATION, *_IN_SPACE = (
    ChannelKind("rad/s^2", _angular_acceleration(axis), "body", _CHANGE, dimensions=(n_dim,), solves=True)
    for n_dim, axis in ((2, 0), (3, 0), (3, 1), (3, 2))
)
ANGULAR_ACCELERATIONS = tuple(_IN_SPACE)
"""Rate of that."""

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
