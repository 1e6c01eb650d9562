"""How decks state the centre line of a beam that is not straight."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated

import numpy as np
from annotated_types import MinLen

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import Angle, LengthVector, PositiveLength
from hfsim.deck.reader import Path
from hfsim.deck.spec import Spec
from hfsim.deck.units import RANGES

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
        """Yield an arc without length, or with one that no beam has."""
        if self.angle == 0.0:
            yield Complaint(("angle",), "an arc has an angle", "leave axis out for a straight beam")
        else:
            yield from _of_no_length(("angle",), "arc", self.radius * abs(self.angle))


def _of_no_length(path: Path, line: str, length: float) -> Iterator[Complaint]:
    """Yield a line that is as long as no beam is."""
    least, most = RANGES["length"]
    if not least <= length <= most:
        yield Complaint(path, f"the {line} would be {length:.3g} m long", f"from {least:g} to {most:g} m")


class AxisSpec(Spec):
    """Undeformed centre line of a beam, in its body frame."""

    arc: ArcSpec | None = None
    """An arc of a circle."""

    points: Annotated[tuple[LengthVector, ...], MinLen(2)] | None = None
    """Points of a cubic spline, the first of them the origin [m]."""

    def _vectors(self) -> Iterator[tuple[Path, Sequence[float]]]:
        yield from ((("points", index), point) for index, point in enumerate(self.points or ()))

    def complaints(self) -> Iterator[Complaint]:
        """Yield a line that is stated in no form or in both, and points that make none."""
        if (self.arc is None) == (self.points is None):
            yield Complaint((), "states one form of a line", "give arc: {radius, angle} or points")
        elif self.points is not None:
            counts = [len(point) for point in self.points]
            if len(set(counts)) > 1:
                index = next(k for k, count in enumerate(counts) if count != counts[0])
                message = f"has {counts[index]} numbers, the first point {counts[0]}"
                yield Complaint(("points", index), message)
                return
            gaps = np.linalg.norm(np.diff(np.array(self.points), axis=0), axis=1)
            if any(self.points[0]):
                origin = f"[{', '.join('0' for _ in self.points[0])}]"
                yield Complaint(("points", 0), "a beam starts at its origin", origin)
            if gaps.min() <= _SAME * gaps.sum():
                index = int(np.argmin(gaps)) + 1
                yield Complaint(("points", index), "is where the point before it is", "leave it out")
            yield from _of_no_length(("points",), "line", float(gaps.sum()))

    @property
    def shape(self) -> "Arc | Curve":
        """The line."""
        from hfsim.parts.bodies.beam_axis import Arc, Curve

        if self.arc is not None:
            return Arc(float(np.copysign(self.arc.radius, self.arc.angle)))
        points = np.array(self.points)
        return Curve(np.pad(points, ((0, 0), (0, 3 - points.shape[1]))))

    @property
    def length(self) -> float:
        """Its length [m]."""
        from hfsim.parts.bodies.beam_axis import Curve

        if self.arc is not None:
            return self.arc.radius * abs(self.arc.angle)
        assert isinstance(self.shape, Curve)
        return self.shape.length
