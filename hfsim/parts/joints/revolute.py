"""Revolute joint: two points stay together, and in space an axis."""

from typing import Literal

from hfsim.deck.fields import Axis, Between
from hfsim.maths.arrays import Array
from hfsim.mechanics.constraints import Held, Shift
from hfsim.parts.specs import JointSpec


class RevoluteSpec(JointSpec):
    """Two points stay together, the bodies may turn; in space about an axis that both share."""

    vectors = spatial = ("axis",)
    meets = turns = follows_start = True

    type: Literal["revolute"]
    """Kind of joint."""

    between: Between
    """The two points, [A, B]."""

    axis: Axis | None = None
    """Axis in A's frame, in space [-]; [0, 0, 1] without it."""

    def held(self, facing: Array | None = None) -> tuple[Held, ...]:
        """Return what the joint holds."""
        if facing is None:
            return (Shift(),)
        from hfsim.mechanics.directions import shared_axis

        return Shift(), shared_axis(self.axis, facing)
