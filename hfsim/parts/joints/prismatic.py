"""Prismatic joint: one point slides along an axis of the other body."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Literal

from hfsim.deck.fields import Angle, Axis, Orientation
from hfsim.maths.arrays import Array
from hfsim.maths.rotations import across
from hfsim.mechanics.constraints import Held, Shift, Turn
from hfsim.parts.joints._coordinate import coordinate
from hfsim.parts.resistances import SlidingResistanceSpec
from hfsim.parts.specs import JointSpec

if TYPE_CHECKING:
    from hfsim.mechanics.resistances import Resistance


class PrismaticSpec(JointSpec, SlidingResistanceSpec):
    """Point B slides along an axis through A; the frames there keep their relative angle."""

    vectors = ("axis",)
    spatial = ("orientation",)
    angles = ("angle",)
    measures = (("m", ""),)

    type: Literal["prismatic"]

    axis: Axis | None = None
    """Direction of sliding in A's frame [-]; without it the first axis, in space [0, 0, 1]."""

    angle: Angle = 0.0
    """Angle of B's frame relative to A's at the joint, in space about z [rad]."""

    orientation: Orientation | None = None
    """Orientation of B's frame relative to A's at the joint, in space; the same without it."""

    def held(self, facing: Array | None = None) -> tuple[Held, ...]:
        """Return what the joint holds: no distance across the axis, no turning."""
        if facing is None:
            return *(Shift(side) for side in across(self.axis or (1.0, 0.0))), Turn(self.angle)
        from hfsim.mechanics.directions import THIRD, Facing

        return *(Shift(side) for side in across(self.axis or THIRD)), Facing.of(facing)

    def coordinates(self, facing: Array | None = None) -> Iterator[tuple[str, Held]]:
        """Yield the shift."""
        yield "", coordinate(self.axis, False, facing)

    @property
    def resisting(self) -> "Mapping[str, tuple[Resistance, ...]]":
        """What resists the shift."""
        return {"": self.resistances}
