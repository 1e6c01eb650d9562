"""The angle or the distance that joints leave free, drive or act on."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hfsim.maths.arrays import Array
from hfsim.mechanics.constraints import Held, Shift, Turn

if TYPE_CHECKING:
    from hfsim.deck.orientation import OrientationSpec


def coordinate(
    axis: tuple[float, ...] | None, turns: bool, facing: Array | None, zero: OrientationSpec | None = None
) -> Held:
    """Return the angle or the distance that a driver would hold; see `JointSpec.held` for the facing."""
    if facing is None:
        return Turn() if turns else Shift(axis or (1.0, 0.0))
    if turns:
        from hfsim.mechanics.directions import THIRD
        from hfsim.mechanics.spatial_turns import About

        return About.of(axis or THIRD, facing, zero=zero)
    return Shift(axis or (0.0, 0.0, 1.0))
