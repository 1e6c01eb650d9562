"""Gears and racks: what turns follows another turn in a ratio, both against a carrier, in the plane."""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.mechanics.constraints import Along, Constraint, RelativeAngle
from hfsim.mechanics.markers import Marker


class Mesh(NamedTuple):
    """A joint holds the turn of B, or its distance along an axis, in a ratio to the turn of A.

    Attributes
    ----------
    ratio : float
        Of turns [-], or distance per turn [m/rad].
    axis : tuple of float, or None
        In the carrier's frame, of any length; None where B turns.
    angle : float
        Of B where that of A is zero [rad].
    """

    ratio: float
    axis: tuple[float, ...] | None = None
    angle: float = 0.0

    def between(self, first: Marker, second: Marker) -> tuple[Constraint, ...]:
        """Return the equation for two markers."""
        length = np.linalg.norm(self.axis or ())
        along = tuple(float(part / length) for part in self.axis) if self.axis else None
        return ((Racked if along else Geared)(first, second, self.ratio, along, offset=self.angle),)

    def fits(self, first: bool, second: bool) -> bool:
        """Return True: in the plane, lines have directions."""
        return True


@frozen
class Geared(Constraint):
    """The turn of the second body is that of the first times a ratio, against a third; full turns count."""

    ratio: float
    direction: tuple[float, ...] | None
    unit: ClassVar[str] = "rad"
    why_kept: ClassVar[str] = "it ties the turns of bodies"

    @cached_property
    def _parts(self) -> tuple[tuple[float, Constraint], ...]:
        """What it compares, with factors: motions of the second and of the first against the third."""
        carrier, axis = self.against[0], self.direction
        moved = RelativeAngle(carrier, self.second) if axis is None else Along(carrier, self.second, axis)
        return (1.0, moved), (-self.ratio, RelativeAngle(carrier, self.first))

    @cached_property
    def still(self) -> tuple[bool, ...]:
        """Whether turns and place are linear functions of the coordinates."""
        (moved, second), (turned, first) = (part.still for _, part in self._parts)
        return first, second, moved and turned

    def gap(self, x: Array) -> Array:
        """Return what is compared [rad or m]."""
        return np.asarray(sum(factor * part.gap(x) for factor, part in self._parts))

    def jacobian(self, end: int, x: Array) -> Array:
        """Return the Jacobian of one of the three ends."""
        own = self._parts if end == 2 else self._parts[1 - end : 2 - end]
        return np.asarray(sum(factor * part.jacobian(int(end < 2), x) for factor, part in own))

    def bias(self, x: Array, u: Array) -> Array:
        """Return the same of the biases."""
        return np.asarray(sum(factor * part.bias(x, u) for factor, part in self._parts))

    def stiffness(self, x: Array, multipliers: Array) -> Entries:
        """Return the same of what bends these."""
        return Entries.joined(part.stiffness(x, factor * multipliers) for factor, part in self._parts)

    def reaction(self, x: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return what acts on the second body; the first and the third bear the rest."""
        return self._parts[0][1].reaction(x, multipliers)


@frozen
class Racked(Geared):
    """The same for a distance along a direction fixed to the third body, a unit vector in its frame."""

    unit: ClassVar[str] = "m"
