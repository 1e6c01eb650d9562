"""Force on a point."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from hfsim.deck.fields import Flag, ForceVector
from hfsim.deck.law_specs import ScaleLaw
from hfsim.maths.arrays import Array
from hfsim.mechanics.markers import Marker
from hfsim.parts.forces._base import Load
from hfsim.parts.specs import LoadSpec


class ForceSpec(LoadSpec):
    """Force on a point, constant or scaled over time."""

    vectors = ("force",)
    carries = True

    type: Literal["force"]
    """Kind of load."""

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

    def build(self, marker: Marker) -> "PointForce":
        """Return the force at a marker."""
        return PointForce(marker, self.law.build() if self.law else None, self.force, self.follower)


@dataclass(frozen=True)
class PointForce(Load):
    """A force on a point, fixed in direction or turning with the frame there; its work is power put in."""

    told: ClassVar[str] = "force on a point"

    force: tuple[float, ...]
    follower: bool

    def unscaled(self, x: Array) -> tuple[Array, Array]:
        """Return the force and the position's Jacobian."""
        force = np.array(self.force)
        turned = self.marker.turned(x, force) if self.follower else force[None]
        return turned, self.marker.position_jacobian(x)
