"""Moment on the frame of a point."""

from collections.abc import Iterator
from typing import Literal

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import Flag, Torque
from hfsim.deck.law_specs import ScaleLaw
from hfsim.deck.spec import Around
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.point_loads import PointMoment
from hfsim.parts.specs import LoadSpec


class MomentSpec(LoadSpec):
    """Moment on the frame of a point, constant or scaled over time."""

    vectors = ("moment",)

    type: Literal["moment"]

    at: str
    """Point it acts on."""

    moment: Torque
    """Moment [N m]: a number, counter-clockwise, in space about z; or three in ground axes, or in those
    of the point's frame if it follows."""

    follower: Flag = False
    """Whether, in space, the moment turns with the frame of its point."""

    law: ScaleLaw | None = None
    """Factor over time [-]; 1 without it."""

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield a moment that cannot turn."""
        yield from super().complaints_in(around)
        if self.follower and around.n_dim == 2:
            message = "a moment in the plane has no direction that could turn"
            yield Complaint(("follower",), message, "remove this key", True)

    @property
    def amount(self) -> tuple[float, ...]:
        """The moment."""
        return self.moment if isinstance(self.moment, tuple) else (self.moment,)

    def build(self, marker: Marker) -> PointMoment:
        """Return the moment at a marker."""
        moment = (0.0,) * (marker.n_spin - len(self.amount)) + self.amount
        return PointMoment(marker, self.law.build() if self.law else None, moment, self.follower)
