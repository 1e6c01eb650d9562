"""Coulomb friction on one coordinate, as of bearings and brakes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.mechanics.resistances import Resistance

if TYPE_CHECKING:
    from hfsim.deck.laws import Law

SLIDING = 4.0
"""Rate, in velocities, from which friction is as good as that of sliding: tanh is 0.9993 there."""


@dataclass(frozen=True)
class Friction(Resistance):
    """Coulomb friction, regularised: level tanh(w / velocity), scaled over time.

    At twice the velocity it has 96 % of its level; below, it is a damper, so that what would stick creeps.

    Attributes
    ----------
    level : float
        Force [N] or torque [N m] of sliding.
    velocity : float
        In units of w.
    law : Law, or None
        Factor over time, never negative; 1 without it.
    """

    level: float
    velocity: float
    law: Law | None = None
    holds: ClassVar[bool] = False
    uses_rates: ClassVar[bool] = True

    @property
    def laws(self) -> tuple[Law, ...]:
        """Its factor over time."""
        return () if self.law is None else (self.law,)

    @property
    def rate_edges(self) -> tuple[float, ...]:
        """Where it begins to turn round."""
        return -SLIDING * self.velocity, SLIDING * self.velocity

    def force(self, t: Array, s: Array, w: Array) -> Array:
        """Return level tanh(w / velocity)."""
        return np.asarray(self._level(t) * np.tanh(w / self.velocity))

    def slopes(self, t: Array, s: Array, w: Array) -> tuple[Array, Array]:
        """Return zero, and level / velocity (1 - tanh^2)."""
        steep = self._level(t) / self.velocity * (1.0 - np.tanh(w / self.velocity) ** 2)
        return np.zeros_like(s), np.asarray(steep)

    def stuck(self, t: Array, w: Array) -> float:
        """Return its slope."""
        return float(self.slopes(t, 0.0 * w, w)[1][0]) if abs(w[0]) < SLIDING * self.velocity else 0.0

    def _level(self, t: Array) -> float | Array:
        return self.level if self.law is None else self.level * self.law.value(t)
