"""Moment on the frame of a point."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from hfsim.deck.fields import Moment
from hfsim.deck.laws import Law, ScaleLaw
from hfsim.maths.arrays import Array, IntArray
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.markers import Marker
from hfsim.parts.specs import LoadSpec


class MomentSpec(LoadSpec):
    """Moment on the frame of a point, constant or scaled over time."""

    type: Literal["moment"]
    """Kind of load."""

    at: str
    """Point it acts on."""

    moment: Moment
    """Moment [N m], positive counter-clockwise."""

    law: ScaleLaw | None = None
    """Factor over time [-]; 1 without it."""

    @property
    def amount(self) -> tuple[float, ...]:
        """The moment."""
        return (self.moment,)

    def build(self, marker: Marker) -> "PointMoment":
        """Return the moment at a marker."""
        return PointMoment(marker, self.moment, self.law.build() if self.law else None)


@dataclass(frozen=True)
class PointMoment(ForcePart):
    """A moment on the direction of a marker; its work is power put in."""

    marker: Marker
    moment: float
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

    def _generalised(self, t: Array, x: Array) -> Array:
        moment = self.moment * (1.0 if self.law is None else self.law.value(t)[:, None])
        return np.asarray(moment * self.marker.angle_jacobian(x))

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add the generalised force."""
        out[:, self.marker.columns] += self._generalised(t, x)

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return moment times angular velocity."""
        return np.asarray(np.sum(self._generalised(t, x) * u[:, self.marker.columns], axis=-1))
