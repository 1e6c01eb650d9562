"""What springs have in common, and what loads have."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.matrices import NOTHING, Entries
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.markers import Marker, joint_support

if TYPE_CHECKING:
    from hfsim.deck.laws import Law


@dataclass(frozen=True)
class PointPart(ForcePart):
    """A force that acts on points only."""

    @cached_property
    def support(self) -> IntArray:
        """Coordinates of its points."""
        return joint_support(*self.markers)


@dataclass(frozen=True)
class Spring(PointPart):
    """Spring and damper on a deflection between two markers: k deflection + d deflection' resists it.

    Attributes
    ----------
    first, second : Marker
    stiffness, damping : float
        k and d, in newtons or newton metres per deflection and per its rate.
    rest : float
        Distance [m] or angle [rad] without force.
    """

    first: Marker
    second: Marker
    stiffness: float
    damping: float
    rest: float

    @property
    def markers(self) -> tuple[Marker, ...]:
        """Both points."""
        return self.first, self.second

    @cached_property
    def _ends(self) -> tuple[tuple[float, Marker], ...]:
        """The ends that can move, each with the sign it has in a difference of second and first."""
        pairs = ((-1.0, self.first), (1.0, self.second))
        return tuple((sign, marker) for sign, marker in pairs if not marker.grounded)

    @property
    def uses_rates(self) -> bool:
        """Whether there is a damper."""
        return self.damping > 0.0

    def measured(self, t: Array, x: Array) -> tuple[Array, list[Array]]:
        """Return the deflection, shape (n_batch,), and its derivative by the coordinates of each moving end.

        Derivatives have shape (n_batch or 1, n_columns).
        """
        raise NotImplementedError

    def _rate(self, rows: list[Array], u: Array) -> Array:
        """Return the rate of the deflection, shape (n_batch,)."""
        ends = zip(self._ends, rows, strict=True)
        return np.asarray(sum(np.sum(J * u[:, marker.columns], axis=-1) for (_, marker), J in ends))

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add the forces of spring and damper on both ends."""
        deflection, rows = self.measured(t, x)
        force = self.stiffness * deflection
        if self.damping:
            force = force + self.damping * self._rate(rows, u)
        for (_, marker), J in zip(self._ends, rows, strict=True):
            out[:, marker.columns] -= force[:, None] * J

    def rate_tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return d J^T J in one state."""
        return self._dyad(t, x, self.damping) if self.damping else NOTHING

    def _dyad(self, t: Array, x: Array, factor: float) -> Entries:
        row = np.zeros(x.shape[1])
        for (_, marker), J in zip(self._ends, self.measured(t, x)[1], strict=True):
            row[marker.columns] += J[0]
        row = row[self.support]
        return Entries.of_block(self.support, self.support, factor * np.outer(row, row))

    def potential_energy(self, t: Array, x: Array) -> Array:
        """Return 1/2 k deflection^2."""
        return 0.5 * self.stiffness * self.measured(t, x)[0] ** 2

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return minus the power lost in the damper."""
        return -self.damping * self._rate(self.measured(t, x)[1], u) ** 2


@dataclass(frozen=True)
class Load(PointPart):
    """A load on the place or the turn of a marker; its work is power put in.

    Attributes
    ----------
    marker : Marker
    law : Law, or None
        Factor over time; 1 without it.
    """

    marker: Marker
    law: Law | None

    @property
    def markers(self) -> tuple[Marker, ...]:
        """Its point."""
        return (self.marker,)

    @property
    def laws(self) -> tuple[Law, ...]:
        """Its factor over time."""
        return () if self.law is None else (self.law,)

    @property
    def exchanges_power(self) -> bool:
        """Return True: a load does work."""
        return True

    def unscaled(self, x: Array) -> tuple[Array, Array]:
        """Return force or moment, shape (n_batch or 1, k), and the Jacobian of what it acts on."""
        raise NotImplementedError

    def _generalised(self, t: Array, x: Array) -> Array:
        load, J = self.unscaled(x)
        if self.law is not None:
            load = load * self.law.value(t)[:, None]
        return np.asarray((load[:, None, :] @ J)[:, 0])

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add the generalised force."""
        out[:, self.marker.columns] += self._generalised(t, x)

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return the generalised force times the rates."""
        return np.asarray(np.sum(self._generalised(t, x) * u[:, self.marker.columns], axis=-1))
