"""Gear: a body turns, or slides, in a ratio to how another turns."""

from collections.abc import Iterator
from typing import Annotated, Literal

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import Angle, Axis, Length, measures, read_text
from hfsim.deck.spec import Around, ReadBy
from hfsim.maths.arrays import Array
from hfsim.mechanics.constraints import Held
from hfsim.parts.specs import JointSpec


class GearSpec(JointSpec):
    """B turns by a ratio times the turn of A, or as a rack slides by a radius times it, against a carrier:
    rigid bodies in the plane, with all their turns.
    """

    angles = ("angle",)

    type: Literal["gear"]

    carrier: Annotated[str, ReadBy(read_text, type="string")] = "ground"
    """Point of the body that bears both."""

    ratio: Annotated[float, measures()] | None = None
    """Turn of B over that of A [-], negative where both turn in opposite ways; or give a radius."""

    radius: Length | None = None
    """Distance that B slides along the axis while A turns by one radian [m]."""

    axis: Axis | None = None
    """Direction in which B slides, in the carrier's frame [-]; the first axis without it."""

    angle: Angle = 0.0
    """Angle of B against the carrier where that of A is zero [rad]."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield a gear of nothing or of two things, and what does not go with a rack or without."""
        if (self.ratio is None) == (self.radius is None):
            yield Complaint((), "a gear needs a ratio, or as a rack a radius, one of the two")
        elif not (self.ratio or self.radius):
            yield Complaint(("ratio" if self.radius is None else "radius",), "must not be zero")
        elif self.axis is not None and self.radius is None:
            yield Complaint(("axis",), "nothing slides without a radius", "remove this key", True)
        elif self.axis is not None and len(self.axis) != 2:
            yield Complaint(("axis",), "must be a list of 2 numbers: gears are planar")
        elif self.angle and self.ratio is None:
            yield Complaint(("angle",), "a rack has a distance", "shift its point, or the carrier's", True)

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield a gear in space."""
        if around.n_dim == 3:
            yield Complaint((), f"gears are planar, this scene is spatial: {around.why}")

    @property
    def points(self) -> tuple[str, ...]:
        """The two points and that of the carrier."""
        return *self.between, self.carrier

    @property
    def carries(self) -> bool:
        """Whether it is a rack."""
        return self.radius is not None

    def held(self, facing: Array | None = None) -> tuple[Held, ...]:
        """Return what it holds."""
        from hfsim.mechanics.gears import Mesh

        if self.radius is not None:
            return (Mesh(self.radius, self.axis or (1.0, 0.0)),)
        return (Mesh(self.ratio or 0.0, angle=self.angle),)
