"""Cylindrical joint: one point slides along an axis, and the bodies turn about it."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Literal

from hfsim.deck.fields import Axis, Orientation
from hfsim.maths.arrays import Array
from hfsim.maths.rotations import across
from hfsim.mechanics.constraints import Held, Shift
from hfsim.parts.joints._coordinate import coordinate
from hfsim.parts.resistances import SlidingResistanceSpec, TurningResistanceSpec
from hfsim.parts.specs import JointSpec

if TYPE_CHECKING:
    from hfsim.mechanics.resistances import Resistance


class CylindricalSpec(JointSpec):
    """Point B slides along an axis through A; the bodies may turn about it."""

    vectors = ("axis",)
    spatial = turns = follows_start = True
    measures = (("rad", ""), ("m", ""))

    type: Literal["cylindrical"]

    axis: Axis | None = None
    """Axis in A's frame [-]; [0, 0, 1] without it."""

    orientation: Orientation | None = None
    """Orientation of B's frame relative to A's where the angle is zero, and where B starts if nothing else
    says so; the axis in B follows from it, whatever is said of where B starts. Without it the smallest
    rotation that takes the axis in B to that in A, and that axis is where B is said to start."""

    turning: TurningResistanceSpec | None = None
    """Damping, friction, stops and latch of the turn."""

    sliding: SlidingResistanceSpec | None = None
    """Damping, friction, stops and latch of the shift."""

    def held(self, facing: Array | None = None) -> tuple[Held, ...]:
        """Return what the joint holds."""
        from hfsim.mechanics.directions import THIRD, shared_axis

        assert facing is not None
        return *(Shift(side) for side in across(self.axis or THIRD)), shared_axis(self.axis, facing)

    def coordinates(self, facing: Array | None = None) -> Iterator[tuple[str, Held]]:
        """Yield turn and shift."""
        yield "turning", coordinate(self.axis, True, facing, self.orientation)
        yield "sliding", coordinate(self.axis, False, facing)

    @property
    def resisting(self) -> "Mapping[str, tuple[Resistance, ...]]":
        """What resists both."""
        both = {"turning": self.turning, "sliding": self.sliding}
        return {key: one.resistances for key, one in both.items() if one is not None}
