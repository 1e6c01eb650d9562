"""Contact of a point, or a ball about it, with a plane of another body."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from hfsim.deck.fields import (
    Axis,
    Between,
    Dissipation,
    NonNegativeLength,
    PositiveLength,
    PositiveNumber,
    PositiveStiffness,
    PositiveVelocity,
)
from hfsim.deck.spec import Spec, entry_of
from hfsim.maths.arrays import Array
from hfsim.mechanics.constraints import Shift
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.resistances import Stop
from hfsim.mechanics.ties import GapTie, tie_on
from hfsim.parts.specs import SpringSpec


class RubbingSpec(Spec):
    """Coulomb friction: coefficient times normal force times tanh(speed / velocity)."""

    coefficient: PositiveNumber
    """Friction of sliding over the normal force [-]."""

    velocity: PositiveVelocity = 1e-3
    """Speed at which it has 76 % of that, and at twice as much 96 % [m/s]; what would stick creeps."""


class ContactSpec(SpringSpec):
    """A stiff spring keeps B, or a ball about it, on one side of a plane through A, in the plane a line; they
    may rub.
    """

    vectors = ("normal",)
    carries = True
    measures = (("m", ""),)
    limits = ("force",)
    lasting = ()

    type: Literal["contact"]
    """Kind of spring."""

    between: Between
    """The point that the plane goes through, and the one that is kept on its side, [A, B]."""

    normal: Axis | None = None
    """Direction to that side in A's frame [-]; without it the last axis, [0, 1], in space [0, 0, 1]."""

    radius: NonNegativeLength = 0.0
    """Radius of the ball about B [m]."""

    stiffness: PositiveStiffness
    """Stiffness of the contact [N/m]."""

    damping: Dissipation = 0.0
    """Factor c of Hunt and Crossley [s/m]: where it is pressed at a small rate w, the force is 1 + c w times
    that of the stiffness, and it never pulls."""

    transition: PositiveLength = 1e-3
    """Depth over which the stiffness sets in [m]."""

    friction: Annotated[Any, entry_of("hfsim.parts.forces.contact.RubbingSpec")] | None = None
    """Friction where they touch."""

    @property
    def framed(self) -> tuple[str, ...]:
        """The plane turns with A; a ball that rubs turns B."""
        return self.between if self.radius and self.friction else self.between[:1]

    def build(self, first: Marker, second: Marker, start: Array) -> GapTie:
        """Return the force between two markers."""
        axis = self.normal or (0.0,) * (first.n_dim - 1) + (1.0,)
        stop = Stop(self.radius, -1.0, self.stiffness, self.damping, self.transition)
        tie = tie_on(Shift(axis), first, second, (stop,))
        if self.friction is None:
            return tie
        from hfsim.mechanics.rubbing import RubbingTie

        return RubbingTie.with_friction(tie, self.radius, self.friction.coefficient, self.friction.velocity)
