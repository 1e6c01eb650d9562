"""Driver: a relative angle or distance follows a law of time."""

from collections.abc import Iterator
from typing import Literal

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import Axis, Orientation
from hfsim.deck.law_specs import AngleLaw, PositionLaw
from hfsim.maths.arrays import Array
from hfsim.mechanics.constraints import Held, Shift, Turn
from hfsim.parts.joints._driven import DrivenSpec


class DriverSpec(DrivenSpec):
    """Imposes the angle of B relative to A, or the distance of B from A along an axis."""

    led = ("angle", "position")
    led_angle = "angle"
    vectors = ("axis",)
    spatial = ("orientation",)
    follows_start = True
    measures = (("rad", "angle"), ("m", "position"))

    type: Literal["driver"]

    angle: AngleLaw | None = None
    """Angle of B's frame relative to A's over time [rad]; or give the position."""

    position: PositionLaw | None = None
    """Distance of B from A along the axis over time [m]; or give the angle."""

    axis: Axis | None = None
    """Axis in A's frame along which the position is measured, or in space about which the angle is [-];
    without it the first axis, in space [0, 0, 1]."""

    orientation: Orientation | None = None
    """Orientation of B's frame relative to A's where the angle is zero, in space; without it the smallest
    rotation that takes the axis in B to that in A. The axis in B is what lies along A's at the start."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield a driver of nothing or of two things."""
        yield from super().complaints()
        if (self.angle is None) == (self.position is None):
            yield Complaint((), "a driver needs an angle or a position, one of the two")
        if self.orientation is not None and self.angle is None:
            why = "says where an angle is zero, and there is none"
            yield Complaint(("orientation",), why, "remove this key", True)

    @property
    def stands(self) -> bool:
        """Whether the law is a constant angle, or the position zero."""
        if self.angle is not None:
            return self.angle.constant is not None
        return self.position is not None and self.position.constant == 0.0

    def coordinates(self, facing: Array | None = None) -> Iterator[tuple[str, Held]]:
        """Yield what it drives."""
        yield from (("", held) for held in self.held(facing))

    @property
    def carries(self) -> bool:
        """Whether it drives a distance."""
        return self.position is not None

    def held(self, facing: Array | None = None) -> tuple[Held, ...]:
        """Return the angle or the distance that follows the law."""
        if facing is not None:
            from hfsim.mechanics.directions import THIRD
            from hfsim.mechanics.spatial_turns import About

            axis = self.axis or THIRD
            if self.angle is not None:
                return (About.of(axis, facing, self.angle.build(), self.orientation),)
        elif self.angle is not None:
            return (Turn(law=self.angle.build()),)
        assert self.position is not None
        return (Shift(self.axis or ((1.0, 0.0) if facing is None else THIRD), self.position.build()),)


class PacerSpec(DriverSpec):
    """Imposes a rate at the start, whatever the angle or the distance is there."""

    holds = False
