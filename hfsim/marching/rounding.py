"""What of the channels of a run is rounding, by the sizes of all that they are of one kind with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hfsim.marching.distance import MOMENTS, related, unit_sizes
from hfsim.marching.solution import Channel
from hfsim.maths.arrays import Array, magnitude
from hfsim.parts.channels import is_judged

ROUNDING = 1e-12
"""Change of a channel, over the size of its unit in the scene, that is rounding."""
LEAST = 1e-25
"""Size of any unit in any scene, in SI."""


def sizes_of(channels: Sequence[Channel], outlines: Mapping[str, Array] | None = None) -> dict[str, float]:
    """Return by unit how large values in a scene are; forces and rates tell of moments and turns, and back.

    Parameters
    ----------
    outlines : mapping of str to ndarray, shape (n_times, n_points, n_dim), optional
        Of its bodies [m].

    Examples
    --------
    >>> x, force = (Channel(*one, np.array([0.0, 2.0])) for one in (("b.x", "m"), ("j.force_x", "N")))
    >>> sizes_of((x, force))["N m"]
    4.0
    """
    found = unit_sizes([one for one in channels if is_judged(one.name, conserved=False)], magnitude)
    shapes = [points for points in (outlines or {}).values() if points.size]
    length = max([found.get("m", 0.0), *(float(np.ptp(points, axis=(0, 1)).max()) for points in shapes)])
    sizes = {**found, "m": length, "rad": max(found.get("rad", 0.0), 1.0), "-": max(found.get("-", 0.0), 1.0)}
    return related(sizes, length, {**MOMENTS, "m/s": "rad/s"})


def levelled(
    channels: Sequence[Channel], outlines: Mapping[str, Array] | None = None
) -> tuple[Channel, ...]:
    """Return channels of which those that are zero, or constant, but for rounding are just that.

    Residuals of joints and energies that are conserved, of which rounding is all, are left as they are.

    Examples
    --------
    >>> z, x = Channel("b.z", "m", np.array([1e-17, -3e-17])), Channel("b.x", "m", np.array([0.0, 2.0]))
    >>> levelled((z, x))[0].values.tolist()
    [0.0, 0.0]
    """
    sizes = sizes_of(channels, outlines)
    return tuple(_levelled(one, sizes.get(one.unit, 0.0)) for one in channels)


def _levelled(channel: Channel, size: float) -> Channel:
    values, rounding = channel.values, max(ROUNDING * size, LEAST)
    if not len(values) or not is_judged(channel.name) or not np.isfinite(values).all():
        return channel
    if magnitude(values) <= rounding:
        return channel._replace(values=np.zeros_like(values))
    if np.ptp(values) <= rounding:
        return channel._replace(values=np.full_like(values, values[0]))
    return channel
