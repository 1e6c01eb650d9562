"""Moment on the frame of a point."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from hfsim.deck.fields import Torque
from hfsim.deck.law_specs import ScaleLaw
from hfsim.maths.arrays import Array
from hfsim.mechanics.markers import Marker
from hfsim.parts.forces._base import Load
from hfsim.parts.specs import LoadSpec


class MomentSpec(LoadSpec):
    """Moment on the frame of a point, constant or scaled over time."""

    vectors = ("moment",)

    type: Literal["moment"]
    """Kind of load."""

    at: str
    """Point it acts on."""

    moment: Torque
    """Moment [N m]: a number, counter-clockwise, in space about z; or three in ground axes."""

    law: ScaleLaw | None = None
    """Factor over time [-]; 1 without it."""

    @property
    def amount(self) -> tuple[float, ...]:
        """The moment."""
        return self.moment if isinstance(self.moment, tuple) else (self.moment,)

    def build(self, marker: Marker) -> "PointMoment":
        """Return the moment at a marker."""
        moment = (0.0,) * (marker.n_spin - len(self.amount)) + self.amount
        return PointMoment(marker, self.law.build() if self.law else None, moment)


@dataclass(frozen=True)
class PointMoment(Load):
    """A moment on the direction of a marker; its work is power put in."""

    moment: tuple[float, ...]

    def unscaled(self, x: Array) -> tuple[Array, Array]:
        """Return the moment and the turn's Jacobian."""
        return np.array([self.moment]), self.marker.spin_jacobian(x)
