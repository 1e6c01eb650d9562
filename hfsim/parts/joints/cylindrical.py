"""Cylindrical joint: one point slides along an axis, and the bodies turn about it."""

from typing import Literal

from hfsim.deck.fields import Axis, Between
from hfsim.maths.arrays import Array
from hfsim.maths.rotations import across
from hfsim.mechanics.constraints import Held, Shift
from hfsim.parts.specs import JointSpec


class CylindricalSpec(JointSpec):
    """Point B slides along an axis through A; the bodies may turn about it."""

    vectors = ("axis",)
    spatial = turns = follows_start = True

    type: Literal["cylindrical"]
    """Kind of joint."""

    between: Between
    """The two points, [A, B]."""

    axis: Axis | None = None
    """Axis in A's frame [-]; [0, 0, 1] without it."""

    def held(self, facing: Array | None = None) -> tuple[Held, ...]:
        """Return what the joint holds."""
        from hfsim.mechanics.directions import THIRD, shared_axis

        assert facing is not None
        return *(Shift(side) for side in across(self.axis or THIRD)), shared_axis(self.axis, facing)
