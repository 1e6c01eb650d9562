"""Driver: a relative angle or distance follows a law of time."""

from collections.abc import Iterator
from typing import Literal

from hfsim.deck.fields import Axis, Between
from hfsim.deck.law_specs import AngleLaw, PositionLaw
from hfsim.deck.spec import Complaint
from hfsim.mechanics.constraints import Held, Shift, Turn
from hfsim.parts.specs import JointSpec


class DriverSpec(JointSpec):
    """Imposes the angle of B relative to A, or the distance of B from A along an axis."""

    vectors = ("axis",)

    type: Literal["driver"]
    """Kind of joint."""

    between: Between
    """The two points, [A, B]."""

    angle: AngleLaw | None = None
    """Angle of B's frame relative to A's over time [rad]; or give the position."""

    position: PositionLaw | None = None
    """Distance of B from A along the axis over time [m]; or give the angle."""

    axis: Axis = (1.0, 0.0)
    """Direction in A's frame along which the position is measured [-]; its length does not matter."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield a driver of nothing or of two things."""
        if (self.angle is None) == (self.position is None):
            yield Complaint((), "a driver needs an angle or a position, one of the two")

    @property
    def stands(self) -> bool:
        """Whether the law is a constant angle, or the position zero."""
        if self.angle is not None:
            return self.angle.constant is not None
        return self.position is not None and self.position.constant == 0.0

    def held(self) -> tuple[Held, ...]:
        """Return the angle or the distance that follows the law."""
        if self.angle is not None:
            return (Turn(law=self.angle.build()),)
        assert self.position is not None
        return (Shift(self.axis, self.position.build()),)
