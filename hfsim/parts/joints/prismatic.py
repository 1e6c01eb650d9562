"""Prismatic joint: one point slides along an axis of the other body."""

from collections.abc import Iterator
from typing import Literal

from hfsim.deck.fields import Angle, Axis, Between, degrees_as_radians
from hfsim.deck.spec import Around, Complaint
from hfsim.maths.rotations import across
from hfsim.mechanics.constraints import Held, Shift, Turn
from hfsim.parts.specs import JointSpec


class PrismaticSpec(JointSpec):
    """Point B slides along an axis through A; the frames there keep their relative angle."""

    vectors = ("axis",)

    type: Literal["prismatic"]
    """Kind of joint."""

    between: Between
    """The two points, [A, B]."""

    axis: Axis = (1.0, 0.0)
    """Direction of sliding in A's frame [-]; its length does not matter."""

    angle: Angle = 0.0
    """Angle of B's frame relative to A's at the joint [rad]."""

    def slips_in(self, around: Around) -> Iterator[Complaint]:
        """Yield an angle that looks like degrees."""
        return degrees_as_radians("angle", self.angle)

    def held(self) -> tuple[Held, ...]:
        """Return what the joint holds: no distance across the axis, no turning."""
        return *(Shift(side) for side in across(self.axis)), Turn(self.angle)
