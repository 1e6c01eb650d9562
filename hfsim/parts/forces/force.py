"""Force on a point."""

from typing import Literal

from hfsim.deck.fields import Flag, ForceVector
from hfsim.deck.law_specs import ScaleLaw
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.point_loads import PointForce
from hfsim.parts.specs import LoadSpec


class ForceSpec(LoadSpec):
    """Force on a point, constant or scaled over time."""

    vectors = ("force",)
    carries = True

    type: Literal["force"]

    at: str
    """Point it acts on."""

    force: ForceVector
    """Force [N], in the ground frame; in the frame of the point if it follows."""

    follower: Flag = False
    """Whether the force turns with the frame of its point."""

    law: ScaleLaw | None = None
    """Factor over time [-]; 1 without it."""

    @property
    def amount(self) -> tuple[float, ...]:
        """The force."""
        return self.force

    def build(self, marker: Marker) -> PointForce:
        """Return the force at a marker."""
        return PointForce(marker, self.law.build() if self.law else None, self.force, self.follower)
