"""Revolute joint: two points stay together."""

from typing import Literal

from hfsim.deck.fields import Between
from hfsim.mechanics.constraints import Held, Shift
from hfsim.parts.specs import JointSpec


class RevoluteSpec(JointSpec):
    """Two points stay together, the bodies may turn."""

    meets = True

    type: Literal["revolute"]
    """Kind of joint."""

    between: Between
    """The two points, [A, B]."""

    def held(self) -> tuple[Held, ...]:
        """Return what the joint holds."""
        return (Shift(),)
