"""Fixed joint: two points stay together and do not turn."""

from typing import Literal

from hfsim.deck.fields import Angle, Between
from hfsim.mechanics.constraints import Coincide, Constraint, RelativeAngle
from hfsim.mechanics.markers import Marker
from hfsim.parts.specs import JointSpec


class FixedSpec(JointSpec):
    """Two points stay together and the frames there keep their relative angle."""

    meets = welds = True

    type: Literal["fixed"]
    """Kind of joint."""

    between: Between
    """The two points, [A, B]."""

    angle: Angle = 0.0
    """Angle of B's frame relative to A's at the joint [rad]."""

    def build(self, first: Marker, second: Marker) -> tuple[Constraint, ...]:
        """Return the equations of this joint."""
        return (Coincide(first, second), RelativeAngle(first, second, self.angle))
