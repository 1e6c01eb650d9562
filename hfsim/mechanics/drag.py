"""Drag of a medium at rest or in flow: forces by the square of the speed against it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import dot
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.line_force import LineLoad
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.ties import PointPart

if TYPE_CHECKING:
    from hfsim.deck.laws import Law


def _speed(w: Array) -> Array:
    """Return the lengths of vectors (n_batch, n_dim), shape (n_batch, 1)."""
    return np.sqrt(dot(w, w))


class Drag(ForcePart):
    """What a medium does to one body.

    Attributes
    ----------
    flow : tuple of float
        Velocity of the medium, in ground axes [m/s].
    law : Law, or None
        Factor on that over time; 1 without it.
    """

    flow: tuple[float, ...]
    law: Law | None
    uses_rates: ClassVar[bool] = True
    exchanges_power: ClassVar[bool] = True
    stiff: ClassVar[bool] = False

    @property
    def laws(self) -> tuple[Law, ...]:
        """That of the flow."""
        return () if self.law is None else (self.law,)

    def wind(self, t: Array) -> Array:
        """Return the velocity of the medium [m/s], (n_batch or 1, n_dim)."""
        flow = np.array([self.flow])
        return flow if self.law is None else flow * self.law.value(t)[:, None]

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add the forces on all points."""
        for marker, force in self.on_points(t, x, u):
            out[:, marker.columns] += force

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return what they put into the body [W]."""
        each = (np.sum(force * u[:, one.columns], axis=-1) for one, force in self.on_points(t, x, u))
        return np.asarray(sum(each, np.zeros(len(x))))


@frozen
class PointDrag(Drag, PointPart):
    """Drag on a point, the same in all directions.

    Attributes
    ----------
    size : float
        Force over the square of the speed [N s^2/m^2].
    """

    marker: Marker
    size: float
    flow: tuple[float, ...]
    law: Law | None
    told: ClassVar[str] = "drag on a point"

    @property
    def markers(self) -> tuple[Marker, ...]:
        """Its point."""
        return (self.marker,)

    def on_points(self, t: Array, x: Array, u: Array) -> Iterator[tuple[Marker, Array]]:
        """Yield the point, with the force there."""
        w = self.marker.velocity(x, u) - self.wind(t)
        force = -self.size * _speed(w) * w
        yield self.marker, (force[:, None] @ self.marker.position_jacobian(x))[:, 0]


@frozen
class LineDrag(Drag, LineLoad):
    """Drag all along a beam, by its velocity across the axis and by that along it.

    Attributes
    ----------
    axes : ndarray, shape (n_places, n_dim)
        Tangents, in axes of the places.
    across, along : ndarray, shape (n_places,)
        Forces over the squares of these [N s^2/m^2].
    """

    places: tuple[Marker, ...]
    cells: Array
    axes: Array
    across: Array
    along: Array
    flow: tuple[float, ...]
    law: Law | None
    told: ClassVar[str] = "drag along a beam"

    def at_places(self, t: Array, x: Array, u: Array) -> list[Array]:
        """Return the force at each place [N], (n_batch, n_dim)."""
        wind, found = self.wind(t), []
        for k, marker in enumerate(self.places):
            w, axis = marker.velocity(x, u) - wind, marker.turned(x, self.axes[k])
            slide = dot(w, axis)
            side = w - slide * axis
            force = self.across[k] * _speed(side) * side
            if self.along[k]:
                force = force + self.along[k] * np.abs(slide) * slide * axis
            found.append(-force)
        return found
