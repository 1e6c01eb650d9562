"""What motors and servos are."""

from __future__ import annotations

from hfsim.maths.arrays import Array
from hfsim.mechanics.constraints import Held
from hfsim.parts.specs import JointSpec


class ActuatorSpec(JointSpec):
    """Base of joints that only exert a torque about an axis, or a force along it."""

    vectors = ("axis",)
    follows_start = True
    holds = False

    def held(self, facing: Array | None = None) -> tuple[Held, ...]:
        """Return nothing."""
        return ()
