"""Loads on one point: forces and moments."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import NOTHING, Entries
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.ties import PointPart

if TYPE_CHECKING:
    from hfsim.deck.laws import Law


class Load(ForcePart):
    """A load on one body; its work is power put in.

    Attributes
    ----------
    law : Law, or None
        Factor over time; 1 without it.
    columns : slice
        Coordinates of the body.
    """

    law: Law | None
    exchanges_power: ClassVar[bool] = True

    @property
    def columns(self) -> slice:
        """Coordinates that it acts on."""
        raise NotImplementedError

    @property
    def laws(self) -> tuple[Law, ...]:
        """Its factor over time."""
        return () if self.law is None else (self.law,)

    def generalised(self, t: Array, x: Array) -> Array:
        """Return the generalised force, shape (n_batch or 1, n_columns)."""
        raise NotImplementedError

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add the generalised force."""
        out[:, self.columns] += self.generalised(t, x)

    def slopes(self, x: Array) -> Iterator[Entries]:
        """Yield what adds up to the derivative of the generalised force without its law in one state."""
        raise NotImplementedError

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the force by x in one state."""
        factor = -1.0 if self.law is None else -self.law.value(t)
        whole = Entries.joined([NOTHING, *self.slopes(x)])
        return whole._replace(values=factor * whole.values)

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return the generalised force times the rates."""
        return np.asarray(np.sum(self.generalised(t, x) * u[:, self.columns], axis=-1))


@frozen
class PointLoad(Load, PointPart):
    """A load on the place or the turn of a marker."""

    marker: Marker
    law: Law | None

    @property
    def markers(self) -> tuple[Marker, ...]:
        """Its point."""
        return (self.marker,)

    @property
    def columns(self) -> slice:
        """Coordinates that its point depends on."""
        return self.marker.columns

    def unscaled(self, x: Array) -> tuple[Array, Array]:
        """Return force or moment, shape (n_batch or 1, k), and the Jacobian of what it acts on."""
        raise NotImplementedError

    def generalised(self, t: Array, x: Array) -> Array:
        """Return the generalised force."""
        load, J = self.unscaled(x)
        if self.law is not None:
            load = load * self.law.value(t)[:, None]
        return np.asarray((load[:, None, :] @ J)[:, 0])


@frozen
class PointForce(PointLoad):
    """A force on a point, fixed in direction or turning with the frame there; its work is power put in."""

    told: ClassVar[str] = "force on a point"

    force: tuple[float, ...]
    follower: bool

    def unscaled(self, x: Array) -> tuple[Array, Array]:
        """Return the force and the position's Jacobian."""
        force = np.array(self.force)
        turned = self.marker.turned(x, force) if self.follower else force[None]
        return turned, self.marker.position_jacobian(x)

    def slopes(self, x: Array) -> Iterator[Entries]:
        """Yield what bends the place, and what turns the force."""
        return force_slopes(self.marker, x, np.array(self.force), self.follower)


def force_slopes(marker: Marker, x: Array, force: Array, follower: bool) -> Iterator[Entries]:
    """Yield what the derivative of a force on a point, (n_dim,) in its axes if it follows, consists of."""
    yield marker.position_stiffness(x, marker.turned(x, force)[0] if follower else force)
    if follower:
        yield marker.on_place(x, marker.turned_jacobian(x, force)[0])


@frozen
class PointMoment(PointLoad):
    """A moment on the frame of a marker, fixed in direction or turning with it; its work is power put in."""

    told: ClassVar[str] = "moment on a point"

    moment: tuple[float, ...]
    follower: bool = False

    def unscaled(self, x: Array) -> tuple[Array, Array]:
        """Return the moment and the turn's Jacobian."""
        moment = np.array(self.moment)
        turned = self.marker.turned(x, moment) if self.follower else moment[None]
        return turned, self.marker.spin_jacobian(x)

    def slopes(self, x: Array) -> Iterator[Entries]:
        """Yield what bends the turn, and what turns the moment."""
        moment, turned = np.array(self.moment), self.unscaled(x)[0][0]
        yield self.marker.spin_stiffness(x, turned)
        if self.follower:
            yield self.marker.on_turn(x, self.marker.turned_jacobian(x, moment)[0])
