"""Couplings: what resists a sum of angles and distances of several joints, as gears, belts and cables do."""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.resistances import LinearSpring
from hfsim.mechanics.ties import GapTie, Tie

NO_FORCE = LinearSpring(0.0)


@frozen
class CountingTie(GapTie):
    """An angle of which the turns are counted for others, without a force of its own."""

    told: ClassVar[str] = "turns of an angle"
    why: ClassVar[str] = "a coupling counts them"
    measures: ClassVar[bool] = False
    counts_for_others: ClassVar[bool] = True

    @property
    def holds_together(self) -> bool:
        """Tell that it resists nothing."""
        return False


@frozen
class CoupledTie(Tie):
    """Resistances on a sum of coordinates, each times a factor.

    Attributes
    ----------
    parts : tuple of Tie
        What measures the coordinates; theirs are the ends, in order.
    factors : tuple of float
        One for each.
    """

    told: ClassVar[str] = "what couples angles and distances of several joints"
    unit: ClassVar[str] = "rad"
    parts: tuple[Tie, ...]
    factors: tuple[float, ...]

    @property
    def markers(self) -> tuple[Marker, ...]:
        """All points."""
        return tuple(marker for part in self.parts for marker in part.markers)

    @property
    def angles(self) -> tuple[ForcePart, ...]:
        """What measures the coordinates."""
        return self.parts

    def undirected(self, t: Array, x: Array) -> float:
        """Return the size of the force on a distance whose points are in one place, but for rounding."""
        pull = float(np.abs(self.effort(t, x, 0.0 * x)[0]))
        meeting = (abs(factor) for factor, part in self._weighted if part.meets(x))
        return pull * max(meeting, default=0.0)

    @cached_property
    def _weighted(self) -> tuple[tuple[float, Tie], ...]:
        return tuple(zip(self.factors, self.parts, strict=True))

    def measured(self, t: Array, x: Array) -> tuple[Array, list[Array]]:
        """Return the sum; its derivatives are those of the ends of one part after the other."""
        found = [(factor, *part.measured(t, x)) for factor, part in self._weighted]
        total = sum((factor * s for factor, s, _ in found[1:]), found[0][0] * found[0][1])
        return np.asarray(total), [factor * row for factor, _, rows in found for row in rows]

    def _curved(self, x: Array, force: Array, slope: Array) -> Entries:
        # a distance without direction grows every way by its own slope, which is the factor's square
        each = (part._curved(x, factor * force, factor**2 * slope) for factor, part in self._weighted)
        return Entries.joined(each)
