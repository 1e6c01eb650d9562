"""The angle or the distance that joints leave free, drive or act on."""

from __future__ import annotations

from hfsim.maths.arrays import Array
from hfsim.mechanics.constraints import Held, Shift, Turn


def coordinate(axis: tuple[float, ...] | None, turns: bool, facing: Array | None) -> Held:
    """Return the angle or the distance that a driver would hold; see `JointSpec.held` for the facing."""
    if facing is None:
        return Turn() if turns else Shift(axis or (1.0, 0.0))
    if turns:
        from hfsim.mechanics.spatial_turns import about

        return about(axis, facing)
    return Shift(axis or (0.0, 0.0, 1.0))
