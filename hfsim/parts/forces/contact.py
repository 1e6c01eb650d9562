"""Contact of a point, a ball or a wheel with a plane of another body."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, Literal

from hfsim.deck.complaints import Complaint
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
from hfsim.deck.spec import Around, Spec, entry_of
from hfsim.maths.arrays import Array
from hfsim.mechanics.contact import ContactTie
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.resistances import Stop
from hfsim.parts.specs import SpringSpec


class RubbingSpec(Spec):
    """Coulomb friction: coefficient times normal force times tanh(speed / velocity)."""

    coefficient: PositiveNumber
    """Friction of sliding over the normal force [-]."""

    velocity: PositiveVelocity = 1e-3
    """Speed at which it has 76 % of that, and at twice as much 96 % [m/s]; what would stick creeps."""


class ContactSpec(SpringSpec):
    """A stiff spring keeps B, a ball about it or the rim of a wheel on one side of a plane through A, in the
    plane of a line; they may rub.
    """

    vectors = ("normal", "axis")
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
    """Radius of a ball about B, or of a wheel [m]."""

    stiffness: PositiveStiffness
    """Stiffness of the contact [N/m]."""

    damping: Dissipation = 0.0
    """Factor c of Hunt and Crossley [s/m]: where it is pressed at a small rate w, the force is 1 + c w times
    that of the stiffness, and it never pulls."""

    transition: PositiveLength = 1e-3
    """Depth over which the stiffness sets in [m]."""

    axis: Axis | None = None
    """Of a wheel, in space, in B's frame [-]: its rim touches, a circle of the radius about B; that of a ball
    without it."""

    friction: Annotated[Any, entry_of("hfsim.parts.forces.contact.RubbingSpec")] | None = None
    """Friction where they touch."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield a wheel without a size."""
        if self.axis is not None and not self.radius:
            yield Complaint(("radius",), "missing key", "the radius of the wheel", True)

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield an axis in the plane, where a wheel is what a ball is."""
        yield from super().complaints_in(around)
        if self.axis is not None and around.n_dim == 2:
            yield Complaint(("axis",), "in the plane a wheel needs no axis", "remove this key", True)

    @property
    def framed(self) -> tuple[str, ...]:
        """The plane turns with A; a wheel, and a ball that rubs, with B."""
        turns = self.axis is not None or (self.radius and self.friction)
        return self.between if turns else self.between[:1]

    def frameless(self, end: str) -> str:
        """Return that of a ball on a line: its middle, which rubs as well."""
        rolls = self.axis is None and end != self.between[0]
        return "radius: 0 beside a plane moved by the radius: a point rubs without a turn" if rolls else ""

    def build(self, first: Marker, second: Marker, start: Array) -> ContactTie:
        """Return the force between two markers."""
        normal = _unit(self.normal or (0.0,) * (first.n_dim - 1) + (1.0,))
        stop = Stop(0.0, -1.0, self.stiffness, self.damping, self.transition)
        rubs = (self.friction.coefficient, self.friction.velocity) if self.friction else ()
        axis = None if self.axis is None else _unit(self.axis)
        return ContactTie(first, second, (stop,), normal, self.radius, axis, *rubs)


def _unit(a: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(x / math.hypot(*a) for x in a)
