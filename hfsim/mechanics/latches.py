"""Latches: what holds a coordinate, as of a hinge that unfolds, from when it comes to where they catch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.traced import live
from hfsim.mechanics.once import Event
from hfsim.mechanics.resistances import Resistance

NOISE = 1e-9
"""Distance from the place, over the largest coordinate, up to which one catches where a motion starts."""


@dataclass(frozen=True)
class Latch(Event, Resistance):
    """A spring and a damper that are there from a time on: k (s - place) + d w.

    Attributes
    ----------
    place : float
        Where it catches, and is without force.
    stiffness, damping : float
        k and d.
    """

    told: ClassVar[str] = "latches"
    place: float
    stiffness: float
    damping: float

    @property
    def event(self) -> Event:
        """Itself."""
        return self

    @property
    def uses_rates(self) -> bool:
        """Whether it is damped."""
        return self.damping > 0.0

    def _held(self, t: Array, what: Array) -> Array:
        """Return what there is where it holds, zero where it is open."""
        return np.where(t >= live(self.since), what, 0.0)

    def energy(self, t: Array, s: Array) -> Array:
        """Return 1/2 k (s - place)^2."""
        return self._held(t, 0.5 * self.stiffness * (s - self.place) ** 2)

    def elastic(self, t: Array, s: Array) -> Array:
        """Return k (s - place)."""
        return self._held(t, self.stiffness * (s - self.place))

    def force(self, t: Array, s: Array, w: Array) -> Array:
        """Return that and d w."""
        elastic = self.stiffness * (s - self.place)
        return self._held(t, elastic + self.damping * w if self.damping else elastic)

    def slopes(self, t: Array, s: Array, w: Array) -> tuple[Array, Array]:
        """Return k and d."""
        held = self._held(t, np.ones_like(s))
        return self.stiffness * held, self.damping * held

    def past(self, ties: Sequence[Any], t: Array, x: Array, u: Array) -> Array:
        """Return how far its coordinate is beyond its place."""
        return np.asarray(ties[0].measured(t, x)[0] - self.place)

    def happens_at_start(self, t: float, past: float, size: float, moving: bool) -> bool:
        """Tell whether it holds: at its place."""
        return abs(past) <= NOISE * size
