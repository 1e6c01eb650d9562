"""Samples of a solution at the output times, and what a channel is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.rotations import wrap
from hfsim.scene.build import Scene


@dataclass(frozen=True)
class Samples:
    """States at the output times, with what several channels need of them.

    Attributes
    ----------
    scene : Scene
    t : ndarray, shape (n_times,)
    q, v : ndarray, shape (n_times, n)
    turns : dict of str to ndarray, shape (n_times,)
        For bodies without a frame coordinate: an angle close to theirs, full turns included.
    """

    scene: Scene
    t: Array
    q: Array
    v: Array
    turns: dict[str, Array]

    @cached_property
    def x(self) -> Array:
        """Absolute coordinates."""
        return self.scene.system.absolute(self.q)

    @cached_property
    def u(self) -> Array:
        """Rates of the absolute coordinates."""
        return self.scene.system.absolute_velocity(self.q, self.v)

    @cached_property
    def multipliers(self) -> Array:
        """Lagrange multipliers of all joints, shape (n_times, n_rows)."""
        return self.scene.system.multipliers(self.t, self.x, self.u)

    def frame_angle(self, body: str) -> Array:
        """Return the angle of a body frame [rad], continuous over full turns."""
        column = self.scene.bodies[body].angle_column
        if column is not None:
            return self.scene.system.arranged(self.q)[:, column]
        measured = self.scene.marker(body).angle(self.x)
        near = self.turns[body]
        return np.asarray(near + wrap(measured - near))


class ChannelKind(NamedTuple):
    """A unit and the function (samples, subject, quantity) -> one value per time."""

    unit: str
    compute: Callable[[Samples, str, str], Array]
