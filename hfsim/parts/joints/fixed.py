"""Fixed joint: two points stay together and do not turn."""

from typing import Literal

from hfsim.deck.fields import Angle, Orientation
from hfsim.maths.arrays import Array
from hfsim.mechanics.constraints import Held, Shift, Turn
from hfsim.parts.specs import JointSpec


class FixedSpec(JointSpec):
    """Two points stay together and the frames there keep their relative angle."""

    spatial = ("orientation",)
    angles = ("angle",)
    meets = welds = True

    type: Literal["fixed"]

    angle: Angle = 0.0
    """Angle of B's frame relative to A's at the joint, in space about z [rad]."""

    orientation: Orientation | None = None
    """Orientation of B's frame relative to A's at the joint, in space; the same without it."""

    def held(self, facing: Array | None = None) -> tuple[Held, ...]:
        """Return what the joint holds."""
        if facing is None:
            return Shift(), Turn(self.angle)
        from hfsim.mechanics.directions import Facing

        return Shift(), Facing.of(facing)
