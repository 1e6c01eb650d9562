"""Force on a point."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from hfsim.deck.fields import Flag, ForceVector
from hfsim.deck.laws import Law, ScaleLaw
from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.rotations import rotate
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.markers import Marker
from hfsim.parts.specs import LoadSpec


class ForceSpec(LoadSpec):
    """Force on a point, constant or scaled over time."""

    vectors = ("force",)

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
        law = self.law.build() if self.law else None
        return PointForce(marker, (self.force[0], self.force[1]), self.follower, law)


@dataclass(frozen=True)
class PointForce(ForcePart):
    """A force on a point, fixed in direction or turning with the frame there; its work is power put in."""

    marker: Marker
    force: tuple[float, float]
    follower: bool
    law: Law | None

    @property
    def markers(self) -> tuple[Marker, ...]:
        """Its point."""
        return (self.marker,)

    @cached_property
    def support(self) -> IntArray:
        """Coordinates of its point."""
        return self.marker.support

    @property
    def exchanges_power(self) -> bool:
        """Return True: a load does work."""
        return True

    def _force(self, t: Array, x: Array) -> Array:
        force = np.broadcast_to(np.array(self.force), (len(x), 2))
        if self.follower:
            force = rotate(self.marker.angle(x), force)
        return force if self.law is None else force * self.law.value(t)[:, None]

    def _generalised(self, t: Array, x: Array) -> Array:
        return np.asarray((self._force(t, x)[:, None, :] @ self.marker.position_jacobian(x))[:, 0])

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add the generalised force."""
        out[:, self.marker.columns] += self._generalised(t, x)

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return force times velocity."""
        return np.asarray(np.sum(self._generalised(t, x) * u[:, self.marker.columns], axis=-1))
