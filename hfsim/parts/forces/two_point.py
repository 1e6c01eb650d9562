"""Spring and damper along the line between two points."""

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import Between, Force, Stiffness, table_of
from hfsim.deck.law_specs import PositionLaw
from hfsim.deck.spec import Around
from hfsim.maths.arrays import Array
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.ties import DistanceTie
from hfsim.parts.forces._spring import CoordinateSpringSpec
from hfsim.parts.resistances import SlidingResistanceSpec

if TYPE_CHECKING:
    from hfsim.deck.laws import Law


class TwoPointSpec(SlidingResistanceSpec, CoordinateSpringSpec):
    """Spring and damper on the distance of two points."""

    carries = True
    measures = (("m", ""),)
    limits = ("force",)

    type: Literal["two_point"]
    """Kind of spring."""

    between: Between
    """The two points, [A, B]."""

    stiffness: Stiffness = 0.0
    """Stiffness [N/m]."""

    rest_length: PositionLaw | None = None
    """Distance without force, but for the preload [m]; without it, the distance at the start. As a law of
    time, that of a winch or a cylinder."""

    preload: Force = 0.0
    """Tension at the rest length [N]."""

    table: Annotated[tuple[tuple[float, float], ...], table_of("length", "force")] | None = None
    """Instead of stiffness and preload: rows [stretch from the rest length, tension], between them monotone
    cubics, beyond them straight lines [m, N]."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield a rest length that is negative, or moves where a table counts from it."""
        yield from super().complaints()
        rest = None if self.rest_length is None else self.rest_length.constant
        if rest is not None and rest < 0.0:
            yield Complaint(("rest_length",), f"must be at least 0, not {rest:g}")
        elif rest is None and self.rest_length is not None and self.table is not None:
            yield Complaint(("table",), "a rest length that moves takes a stiffness, no table", on_key=True)

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield a rest length that becomes negative before the spring lets go, if it does."""
        yield from super().complaints_in(around)
        if self.rest_length is None or self.rest_length.constant is not None:
            return
        if around.duration is not None and self.release is not None and self.release.time is not None:
            around = around._replace(duration=min(around.duration, self.release.time))
        if told := self.rest_length.below_zero(around):
            yield Complaint(("rest_length",), f"{told}, and no length is negative", "at least 0 at all times")

    def build(self, first: Marker, second: Marker, start: Array) -> DistanceTie:
        """Return the force between two markers of a scene with coordinates (n,) at the start."""
        loose = DistanceTie.between(first, second, start)
        return replace(loose, resistances=self.from_rest(self._rest(loose, start)))

    def _rest(self, loose: DistanceTie, start: Array) -> "float | Law":
        if self.rest_length is None:
            if loose.meets(start[None]):  # the stiffness of what is there for rounding would be anything
                return 0.0
            return float(loose.measured(np.zeros(1), start[None])[0][0])
        known = self.rest_length.constant
        return self.rest_length.build() if known is None else known
