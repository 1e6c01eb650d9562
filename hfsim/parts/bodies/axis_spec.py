"""How decks state the centre line of a beam in space that is not straight."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import numpy as np
from annotated_types import MinLen

from hfsim.deck.fields import Angle, PositiveLength, SpatialPlace
from hfsim.deck.spec import Complaint, Spec

if TYPE_CHECKING:
    from hfsim.parts.bodies.beam_axis import Arc, Curve

_SAME = 1e-6
"""Distance of points that follow one another, relative to all of the curve's size, that counts as none."""


class ArcSpec(Spec):
    """An arc of a circle from the origin of the body frame along its first axis, in the plane of x and y."""

    radius: PositiveLength
    """Radius [m]."""

    angle: Angle
    """Angle of the arc [rad]; negative: it bends away from y."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield an arc without length."""
        if self.angle == 0.0:
            yield Complaint(("angle",), "an arc has an angle", "leave axis out for a straight beam")


class AxisSpec(Spec):
    """Undeformed centre line of a beam, in its body frame."""

    spatial = True

    arc: ArcSpec | None = None
    """An arc of a circle."""

    points: Annotated[tuple[SpatialPlace, ...], MinLen(2)] | None = None
    """Points of a cubic spline, the first of them the origin [m]."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield a line that is stated in no form or in both, and points that make none."""
        if (self.arc is None) == (self.points is None):
            yield Complaint((), "states one form of a line", "give arc: {radius, angle} or points")
        elif self.points is not None:
            gaps = np.linalg.norm(np.diff(np.array(self.points), axis=0), axis=1)
            if any(self.points[0]):
                yield Complaint(("points", 0), "a beam starts at its origin", "[0, 0, 0]")
            if gaps.min() <= _SAME * gaps.sum():
                index = int(np.argmin(gaps)) + 1
                yield Complaint(("points", index), "is where the point before it is", "leave it out")

    @property
    def shape(self) -> "Arc | Curve":
        """The line."""
        from hfsim.parts.bodies.beam_axis import Arc, Curve

        if self.arc is not None:
            return Arc(float(np.copysign(self.arc.radius, self.arc.angle)))
        return Curve(np.array(self.points))

    @property
    def length(self) -> float:
        """Its length [m]."""
        if self.arc is not None:
            return self.arc.radius * abs(self.arc.angle)
        from hfsim.parts.bodies.beam_axis import Curve

        return Curve(np.array(self.points)).length
