"""Revolute joint: two points stay together."""

from typing import Literal

from hfsim.deck.fields import Between
from hfsim.mechanics.constraints import Coincide, Constraint
from hfsim.mechanics.markers import Marker
from hfsim.parts.specs import JointSpec


class RevoluteSpec(JointSpec):
    """Two points stay together, the bodies may turn."""

    meets = True

    type: Literal["revolute"]
    """Kind of joint."""

    between: Between
    """The two points, [A, B]."""

    def build(self, first: Marker, second: Marker) -> tuple[Constraint, ...]:
        """Return the equations of this joint."""
        return (Coincide(first, second),)
