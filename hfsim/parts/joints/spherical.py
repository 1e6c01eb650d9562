"""Spherical joint: two points stay together in space."""

from typing import Literal

from hfsim.maths.arrays import Array
from hfsim.mechanics.constraints import Held, Shift
from hfsim.parts.specs import JointSpec


class SphericalSpec(JointSpec):
    """Two points stay together in space, the bodies may turn in every way."""

    spatial = True
    meets = True

    type: Literal["spherical"]

    def held(self, facing: Array | None = None) -> tuple[Held, ...]:
        """Return what the joint holds."""
        return (Shift(),)
