"""Momentum of the whole scene about the origin of the ground, and its centre of mass.

Momentum is M u times unit motions of everything, shifts and turns; that of a turn times a shift tells where
the centre is.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.parts.channels._base import OF_POSITIONS, ChannelKind, Plot, Samples


def _along(samples: Samples, rates: Array, motion: Array) -> Array:
    """Return the momentum of rates in a motion, both (n_times, n_x)."""
    return np.asarray(np.sum(samples.scene.system.equations.momentum(samples.x, rates) * motion, axis=1))


def _momentum(motion: int) -> Callable[[Samples, str], Array]:
    return lambda samples, subject: _along(samples, samples.u, samples.rigid_motions[motion])


def _centre(axis: int) -> Callable[[Samples, str], Array]:
    def place(samples: Samples, subject: str) -> Array:
        units = samples.rigid_motions
        mass = _along(samples, units[0], units[0])
        if len(units) == 3:
            across = units[1] if axis == 0 else -units[0]
            return _along(samples, units[2], across) / mass
        # a turn about the axis before moves the centre along the axis after it
        return _along(samples, units[3 + (axis + 2) % 3], units[(axis + 1) % 3]) / mass

    return place


def _kind(unit: str, motion: int, plot: Plot, dimensions: tuple[int, ...]) -> ChannelKind:
    return ChannelKind(unit, _momentum(motion), "momentum", plot, dimensions=dimensions, judged="never")


_LINEAR, _ANGULAR = Plot("momentum", "momentum"), Plot("angular momentum", "angular_momentum")
LINEAR = tuple(_kind("kg m/s", axis, _LINEAR, (2, 3) if axis < 2 else (3,)) for axis in range(3))
"""Along the axes of the ground."""
ANGULAR = _kind("kg m^2/s", 2, _ANGULAR, (2,))
ANGULARS = tuple(_kind("kg m^2/s", 3 + axis, _ANGULAR, (3,)) for axis in range(3))
"""About its origin."""
CENTRE = tuple(
    ChannelKind("m", _centre(axis), "centre_of_mass", OF_POSITIONS, (2, 3) if axis < 2 else (3,))
    for axis in range(3)
)
"""Of all bodies."""
