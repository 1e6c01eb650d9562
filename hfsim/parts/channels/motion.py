"""Positions, velocities and angles."""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.parts.channels._base import Samples


def _position(samples: Samples, point: str, axis: int) -> Array:
    return samples.scene.marker(point).position(samples.x)[:, axis]


def _velocity(samples: Samples, point: str) -> Array:
    return samples.scene.marker(point).velocity(samples.x, samples.u)


def x(samples: Samples, point: str, quantity: str) -> Array:
    """Return the absolute x position of a point [m]."""
    return _position(samples, point, 0)


def y(samples: Samples, point: str, quantity: str) -> Array:
    """Return the absolute y position of a point [m]."""
    return _position(samples, point, 1)


def vx(samples: Samples, point: str, quantity: str) -> Array:
    """Return the x component of the velocity of a point [m/s]."""
    return _velocity(samples, point)[:, 0]


def vy(samples: Samples, point: str, quantity: str) -> Array:
    """Return the y component of the velocity of a point [m/s]."""
    return _velocity(samples, point)[:, 1]


def speed(samples: Samples, point: str, quantity: str) -> Array:
    """Return the magnitude of the velocity of a point [m/s]."""
    return np.asarray(np.linalg.norm(_velocity(samples, point), axis=1))


def angle(samples: Samples, body: str, quantity: str) -> Array:
    """Return the angle of a body frame [rad], continuous over full turns."""
    return samples.frame_angle(body)


def angular_velocity(samples: Samples, body: str, quantity: str) -> Array:
    """Return the angular velocity of a body frame [rad/s]."""
    return samples.scene.marker(body).spin(samples.x, samples.u)[:, 0]
