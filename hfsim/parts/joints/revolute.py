"""Revolute joint: two points stay together."""

from typing import Literal

from hfsim.deck.fields import Between
from hfsim.deck.spec import Spec
from hfsim.mechanics.constraints import Coincide, Constraint
from hfsim.mechanics.markers import Marker


class RevoluteSpec(Spec):
    """Two points stay together, the bodies may turn."""

    type: Literal["revolute"]
    """Kind of joint."""

    between: Between
    """The two points, [A, B]."""

    def build(self, first: Marker, second: Marker) -> tuple[Constraint, ...]:
        """Return the equations of this joint."""
        return (Coincide(first, second),)
