"""Where a body is and how it moves as a rigid body: its frame's origin and turn, and their rates.

A turn and a spin have as many numbers as there are axes to turn about: one in the plane, which counts
full turns.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.rotations import freedoms, spun, turned


class Pose(NamedTuple):
    """Place of a body frame.

    Attributes
    ----------
    origin : ndarray, shape (n_dim,)
        In ground axes [m].
    turn : ndarray, shape (n_spin,)
        Of the body axes against those of the ground [rad]: an angle with its full turns in the plane, in
        space a rotation vector.

    Examples
    --------
    >>> Pose.planar((1.0, 0.0), np.pi / 2).placed(np.array([0.5, 0.0])).round(12)
    array([1. , 0.5])
    """

    origin: Array
    turn: Array

    @classmethod
    def planar(cls, origin: Array | tuple[float, ...], angle: float) -> Pose:
        """Return a pose in the plane."""
        return cls(np.asarray(origin, dtype=float), np.array([angle]))

    @classmethod
    def level(cls, origin: Sequence[float] | Array) -> Pose:
        """Return a pose with the axes of the ground, in plane or space."""
        return cls(np.asarray(origin, dtype=float), np.zeros(freedoms(len(origin)) - len(origin)))

    @property
    def angle(self) -> float:
        """Angle of the frame about the last axis there is, in the plane with full turns [rad]."""
        return float(self.turn[-1])

    def turned(self, a: Array) -> Array:
        """Return vectors (..., n_dim), given in body axes, in ground axes."""
        return turned(self.turn, a)

    def placed(self, a: Array) -> Array:
        """Return where points (..., n_dim) of the body frame are in ground axes [m]."""
        return np.asarray(self.origin + self.turned(a))


class Twist(NamedTuple):
    """Rigid motion of a body.

    Attributes
    ----------
    velocity : ndarray, shape (n_dim,)
        Of the frame's origin, in ground axes [m/s].
    spin : ndarray, shape (n_spin,)
        Angular velocity, in ground axes [rad/s].

    Examples
    --------
    >>> Twist(np.array([1.0, 0.0]), np.array([2.0])).turning(np.array([0.5, -0.5]))
    array([1., 1.])
    """

    velocity: Array
    spin: Array

    def turning(self, a: Array) -> Array:
        """Return the rates of vectors (..., n_dim) that turn with the body, in ground axes."""
        return spun(self.spin, a)

    @classmethod
    def units(cls, n_dim: int) -> Iterator[Twist]:
        """Yield the motions that each freedom of a rigid body has by itself: shifts first, then spins."""
        for row in np.eye(freedoms(n_dim)):
            yield cls(row[:n_dim], row[n_dim:])
