"""Revolute joint: two points stay together, and in space an axis."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Literal

from hfsim.deck.fields import Axis
from hfsim.maths.arrays import Array
from hfsim.mechanics.constraints import Held, Shift, Turn
from hfsim.parts.resistances import TurningResistanceSpec
from hfsim.parts.specs import JointSpec

if TYPE_CHECKING:
    from hfsim.mechanics.resistances import Resistance


class RevoluteSpec(JointSpec, TurningResistanceSpec):
    """Two points stay together, the bodies may turn; in space about an axis that both share.

    What resists the turn knows its angle as a driver of the same points and axis has it.
    """

    vectors = spatial = ("axis",)
    meets = turns = follows_start = True

    type: Literal["revolute"]

    axis: Axis | None = None
    """Axis in A's frame, in space [-]; [0, 0, 1] without it."""

    def held(self, facing: Array | None = None) -> tuple[Held, ...]:
        """Return what the joint holds."""
        if facing is None:
            return (Shift(),)
        from hfsim.mechanics.directions import shared_axis

        return Shift(), shared_axis(self.axis, facing)

    def resisted(self, facing: Array | None = None) -> "Iterator[tuple[str, Held, tuple[Resistance, ...]]]":
        """Yield the turn."""
        if not self.resistances:
            return
        if facing is None:
            yield "", Turn(), self.resistances
        else:
            from hfsim.mechanics.spatial_turns import about

            yield "", about(self.axis, facing), self.resistances
