"""Displacements seen from the body frame, the same for every model."""

from __future__ import annotations

import numpy as np

from hfsim.deck.fields import split_point
from hfsim.maths.arrays import Array
from hfsim.maths.rotations import rotate
from hfsim.parts.channels._base import ChannelKind, Plot, Samples


def _relative(samples: Samples, point: str) -> Array:
    """Return the position of a point in its body frame, shape (n_times, 2)."""
    body, _ = split_point(point)
    origin = samples.scene.marker(body).position(samples.x)
    gap = samples.scene.marker(point).position(samples.x) - origin
    return rotate(-samples.frame_angle(body), gap)


def _deflection(samples: Samples, point: str) -> Array:
    return _relative(samples, point)[:, 1]


def _elongation(samples: Samples, point: str) -> Array:
    body, name = split_point(point)
    place = samples.scene.bodies[body].points[name][0] if name else 0.0
    return np.asarray(_relative(samples, point)[:, 0] - place)


DEFLECTION = ChannelKind(
    "m", _deflection, "point", Plot("deflection", "deflection"), only_beams=True, in_frame=True
)
"""Distance of a point from the first axis of its body frame, across it."""

ELONGATION = ChannelKind(
    "m", _elongation, "point", Plot("elongation", "elongation"), only_beams=True, in_frame=True
)
"""Displacement of a point along the first axis of its body frame."""
