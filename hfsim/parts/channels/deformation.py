"""Displacements seen from the body frame, the same for every model."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hfsim.deck.fields import split_point
from hfsim.maths.arrays import Array
from hfsim.maths.rotations import quaternion, rotate
from hfsim.parts.channels._base import ChannelKind, Plot, Samples


def _relative(samples: Samples, point: str) -> Array:
    """Return the position of a point in its body frame, shape (n_times, n_dim)."""
    body, _ = split_point(point)
    origin = samples.scene.marker(body).position(samples.x)
    gap = samples.scene.marker(point).position(samples.x) - origin
    if gap.shape[1] == 3:
        return np.asarray((gap[:, None] @ samples.frame(body))[:, 0])
    return rotate(-samples.frame_angle(body), gap)


def _deflection(axis: int) -> Callable[[Samples, str], Array]:
    return lambda samples, point: _relative(samples, point)[:, axis]


def _elongation(samples: Samples, point: str) -> Array:
    body, name = split_point(point)
    own = samples.scene.bodies[body]
    place = own.reference(own.points[name])[0] if name else 0.0
    return np.asarray(_relative(samples, point)[:, 0] - place)


def _twist(samples: Samples, point: str) -> Array:
    """Return the angle left of a section's rotation when what turns its first axis is taken away."""
    body, _ = split_point(point)
    own = samples.scene.marker(point).turned(samples.x, np.eye(3))
    q = quaternion(samples.frame(body).swapaxes(1, 2) @ own)
    return np.asarray(2.0 * np.arctan2(q[:, 1], q[:, 0]))


_DEFLECTION = Plot("deflection", "deflection")
DEFLECTION = ChannelKind(
    "m", _deflection(1), "point", _DEFLECTION, dimensions=(2,), only_beams=True, of_turns=True
)
"""Distance of a point from the first axis of its body frame, across it."""
DEFLECTIONS = tuple(
    ChannelKind("m", _deflection(axis), "point", _DEFLECTION, dimensions=(3,), only_beams=True)
    for axis in (1, 2)
)
"""The same in space, along the second and the third axis."""

ELONGATION = ChannelKind(
    "m", _elongation, "point", Plot("elongation", "elongation"), only_beams=True, of_turns=True
)
"""Displacement of a point along the first axis of its body frame."""

TWIST = ChannelKind(
    "rad", _twist, "point", Plot("twist", "twist"), dimensions=(3,), only_beams=True, of_sections=True
)
"""Angle by which a section is turned about the beam against the body frame, within half a turn."""
