"""Cylindrical joint: one point slides along an axis, and the bodies turn about it."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Literal

from hfsim.deck.fields import Axis
from hfsim.maths.arrays import Array
from hfsim.maths.rotations import across
from hfsim.mechanics.constraints import Held, Shift
from hfsim.parts.resistances import SlidingResistanceSpec, TurningResistanceSpec
from hfsim.parts.specs import JointSpec

if TYPE_CHECKING:
    from hfsim.mechanics.resistances import Resistance


class CylindricalSpec(JointSpec):
    """Point B slides along an axis through A; the bodies may turn about it."""

    vectors = ("axis",)
    spatial = turns = follows_start = True

    type: Literal["cylindrical"]

    axis: Axis | None = None
    """Axis in A's frame [-]; [0, 0, 1] without it."""

    turning: TurningResistanceSpec | None = None
    """Damping, friction and stops of the turn."""

    sliding: SlidingResistanceSpec | None = None
    """Damping, friction and stops of the shift."""

    def held(self, facing: Array | None = None) -> tuple[Held, ...]:
        """Return what the joint holds."""
        from hfsim.mechanics.directions import THIRD, shared_axis

        assert facing is not None
        return *(Shift(side) for side in across(self.axis or THIRD)), shared_axis(self.axis, facing)

    def resisted(self, facing: Array | None = None) -> "Iterator[tuple[str, Held, tuple[Resistance, ...]]]":
        """Yield turn and shift."""
        from hfsim.mechanics.directions import THIRD
        from hfsim.mechanics.spatial_turns import about

        assert facing is not None
        if self.turning is not None and self.turning.resistances:
            yield "turning", about(self.axis, facing), self.turning.resistances
        if self.sliding is not None and self.sliding.resistances:
            yield "sliding", Shift(self.axis or THIRD), self.sliding.resistances
