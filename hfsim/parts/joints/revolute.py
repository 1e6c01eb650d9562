"""Revolute joint: two points stay together, and in space an axis."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Literal

from hfsim.deck.fields import Axis, Orientation
from hfsim.maths.arrays import Array
from hfsim.mechanics.constraints import Held, Shift
from hfsim.parts.joints._coordinate import coordinate
from hfsim.parts.resistances import TurningResistanceSpec
from hfsim.parts.specs import JointSpec

if TYPE_CHECKING:
    from hfsim.mechanics.resistances import Resistance


class RevoluteSpec(JointSpec, TurningResistanceSpec):
    """Two points stay together, the bodies may turn; in space about an axis that both share.

    What resists the turn knows its angle as a driver of the same points and axis has it.
    """

    vectors = ("axis",)
    spatial = ("axis", "orientation")
    meets = turns = follows_start = True
    measures = (("rad", ""),)

    type: Literal["revolute"]

    axis: Axis | None = None
    """Axis in A's frame, in space [-]; [0, 0, 1] without it."""

    orientation: Orientation | None = None
    """Orientation of B's frame relative to A's where the angle is zero, in space, and where B starts if
    nothing else says so; the axis in B follows from it, whatever is said of where B starts. Without it the
    smallest rotation that takes the axis in B to that in A, and that axis is where B is said to start."""

    def held(self, facing: Array | None = None) -> tuple[Held, ...]:
        """Return what the joint holds."""
        if facing is None:
            return (Shift(),)
        from hfsim.mechanics.directions import shared_axis

        return Shift(), shared_axis(self.axis, facing)

    def coordinates(self, facing: Array | None = None) -> Iterator[tuple[str, Held]]:
        """Yield the turn."""
        yield "", coordinate(self.axis, True, facing, self.orientation)

    @property
    def resisting(self) -> "Mapping[str, tuple[Resistance, ...]]":
        """What resists the turn."""
        return {"": self.resistances}
