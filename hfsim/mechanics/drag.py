"""Drag of a medium at rest or in flow: forces by the square of the speed against it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.maths.rotations import dot
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.line_force import LineLoad
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.ties import PointPart

if TYPE_CHECKING:
    from hfsim.deck.laws import Law


class Slopes(NamedTuple):
    """How one state resists at a place, and how that changes.

    Attributes
    ----------
    resistance : ndarray, shape (n_dim,)
        Minus the force there [N].
    by_velocity : ndarray, shape (n_dim, n_dim)
        Its derivative by the velocity of the place.
    by_turn : ndarray, shape (n_dim, n_columns), or None
        That by the coordinates of the body, at one velocity; None where no turn counts.
    """

    resistance: Array
    by_velocity: Array
    by_turn: Array | None


def _speed(w: Array) -> Array:
    """Return the lengths of vectors (n_batch, n_dim), shape (n_batch, 1)."""
    return np.sqrt(dot(w, w))


def _square_slope(w: Array) -> Array:
    """Return the derivative of |w| w by w, (n_dim, n_dim), of a vector (1, n_dim): zero where that is."""
    speed = _speed(w)
    return np.asarray(speed * np.eye(w.shape[1]) + w.T @ (w / np.where(speed == 0.0, 1.0, speed)))


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

    def slopes(self, t: Array, x: Array, u: Array) -> Iterator[tuple[Marker, Slopes]]:
        """Yield each point, with how one state resists there."""
        raise NotImplementedError

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the forces by x in one state."""
        parts = []
        for marker, own in self.slopes(t, x, u):
            parts.append(marker.position_stiffness(x, own.resistance))
            if own.by_turn is not None:
                parts.append(marker.on_place(x, own.by_turn))
            if not marker.linear:
                parts.append(marker.on_place(x, own.by_velocity @ _velocity_by_place(marker, x, u)))
        return Entries.joined(parts)

    def rate_tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the forces by u in one state."""
        every = self.slopes(t, x, u)
        return Entries.joined(
            marker.on_place(x, own.by_velocity @ marker.position_jacobian(x)[0]) for marker, own in every
        )

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return what they put into the body [W]."""
        each = (np.sum(force * u[:, one.columns], axis=-1) for one, force in self.on_points(t, x, u))
        return np.asarray(sum(each, np.zeros(len(x))))


def _velocity_by_place(marker: Marker, x: Array, u: Array) -> Array:
    """Return the derivative of a velocity by the coordinates of the body in one state, (n_dim, n_columns)."""
    rows = []
    for way in np.eye(marker.n_dim):
        bent = marker.position_stiffness(x, way)
        whole = np.bincount(bent.columns, bent.values * u[0, bent.rows], x.shape[1])
        rows.append(whole[marker.columns])
    return np.stack(rows)


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

    def slopes(self, t: Array, x: Array, u: Array) -> Iterator[tuple[Marker, Slopes]]:
        """Yield the point, with the derivative of |w| w there."""
        w = self.marker.velocity(x, u) - self.wind(t)
        yield self.marker, Slopes((self.size * _speed(w) * w)[0], self.size * _square_slope(w), None)


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
            w, axis = marker.velocity(x, u) - wind, self._axis(k, x)[0]
            found.append(-self._resistance_at(k, *_parted(w, axis), axis))
        return found

    def _axis(self, k: int, x: Array) -> tuple[Array, Array]:
        """Return the tangent at a place, (n_batch, n_dim), and by what it is made of unit length."""
        axis = self.places[k].axis(x, self.axes[k])
        length = _speed(axis)
        return axis / length, length

    def _resistance_at(self, k: int, slide: Array, side: Array, axis: Array) -> Array:
        force = self.across[k] * _speed(side) * side
        if self.along[k]:
            force = force + self.along[k] * np.abs(slide) * slide * axis
        return np.asarray(force)

    def slopes(self, t: Array, x: Array, u: Array) -> Iterator[tuple[Marker, Slopes]]:
        """Yield each place, with the derivatives of |side| side and |slide| slide axis there."""
        wind, unit = self.wind(t), np.eye(len(self.flow))
        for k, marker in enumerate(self.places):
            w, (axis, length) = marker.velocity(x, u) - wind, self._axis(k, x)
            slide, side = _parted(w, axis)
            across, along = self.across[k] * _square_slope(side), 2.0 * self.along[k] * np.abs(slide)
            level, dyad = unit - axis.T @ axis, axis.T @ w
            by_velocity = across @ level + along * axis.T @ axis
            by_axis = along * (dyad + 0.5 * slide * unit) - across @ (dyad + slide * unit)
            turn = level @ marker.axis_jacobian(x, self.axes[k])[0] / length
            yield marker, Slopes(self._resistance_at(k, slide, side, axis)[0], by_velocity, by_axis @ turn)


def _parted(w: Array, axis: Array) -> tuple[Array, Array]:
    """Return the part of velocities along axes of unit length, (n_batch, 1), and that across these."""
    slide = dot(w, axis)
    return slide, w - slide * axis
