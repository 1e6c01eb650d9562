"""Rigid motions along which steps in space are guessed: of rotors, and of whatever flies or rolls.

They are those of everything, or of each part that neither joints nor springs connect with others.

A turn about an axis that stands still or moves on evenly is known for all times: rates u of it lead after
an angle to changes (sin(angle) / r) u + ((1 - cos(angle)) / r^2) w x u at a spin w of size r (Rodrigues).
What is left is small, seen from axes that turn as well.  In the plane natural increments do this, body by
body.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.rank import null_space
from hfsim.maths.rotations import cross
from hfsim.mechanics.force import ConstantForce
from hfsim.mechanics.reduction import Reduction
from hfsim.mechanics.ties import Tie
from hfsim.mechanics.turning import Turning, undriven

if TYPE_CHECKING:
    from hfsim.mechanics.body import Body
    from hfsim.mechanics.force import ForcePart
    from hfsim.mechanics.system import System

_EVEN = 1e-6
"""Part of its size in others from which on a rigid motion counts as one by itself."""
TOLD = 0.1
"""Part of the square of accelerations that may be other than those of an axis which moves on evenly."""
HARDLY = 1e-2
"""Rate of what holds to the ground, over those of all that moves, that is next to none: shafts may sag."""
_FLAT = 1e-4
"""Size of a motion about one axis, over that about another, from which down it is next to nothing."""
MOST = 8
"""Parts that are carried each by itself: of more everything is, as one."""
SLIGHT = 1e-3
"""Angle in a step [rad] for which nothing need be carried along."""
_TINY = 1e-300


@frozen
class Carried:
    """A state that is carried along, at some times.

    Attributes
    ----------
    moved : ndarray, shape (n_times, n)
        Changes of the coordinates by that.
    v, a : ndarray, shape (n,)
        Rates and accelerations that are left, as seen from axes that turn as well.
    """

    moved: Array
    v: Array
    a: Array
    carrying: Carrying
    spin: Array
    once: Array
    twice: Array

    def seen(self, changes: Array) -> Array:
        """Return changes (n_times, n) in these axes as changes of the coordinates."""
        return np.asarray(changes + self.turned_on(changes))

    def turned_on(self, changes: Array) -> Array:
        """Return what turning along adds to changes (n_times, n)."""
        first = self.carrying.turned(self.spin, changes)
        return np.asarray(self.once * first + self.twice * self.carrying.turned(self.spin, first))


@frozen
class CarriedApart:
    """A state of which several parts are carried along, each by itself; attributes as those of `Carried`."""

    moved: Array
    v: Array
    a: Array
    each: tuple[Carried, ...]

    def seen(self, changes: Array) -> Array:
        """Return changes (n_times, n) in these axes as changes of the coordinates."""
        return np.asarray(sum((one.turned_on(changes) for one in self.each), changes))


@frozen
class CarryingApart:
    """Rigid motions of several parts that neither joints nor springs connect.

    Attributes
    ----------
    each : tuple of Carrying
    others : ndarray, shape (n,)
        One for coordinates of what is not carried, zero for those of these parts.
    """

    each: tuple[Carrying, ...]
    others: Array

    @cached_property
    def steady(self) -> Array | None:
        """As of `Carrying`."""
        found = [one.steady for one in self.each if one.steady is not None]
        return sum(found[1:], found[0]) if found else None

    def along(self, q: Array, v: Array, a: Array, times: Array) -> CarriedApart:
        """Carry a state (n,) on as its rates and accelerations say, by times (n_times,) [s]."""
        each = tuple(one.along(q, v, a, times) for one in self.each)
        left = (sum((one.v for one in each), self.others * v), sum((one.a for one in each), self.others * a))
        return CarriedApart(sum((one.moved for one in each[1:]), each[0].moved), *left, each)


@frozen
class Carrying:
    """Rigid motions of everything, or of a part, in space, where all coordinates are those of vectors.

    What joints with the ground forbid is none of them: it would strain what they hold.  Nor is what springs
    and stops on the ground resist, which stiffness has to guess.

    Attributes
    ----------
    shifts : ndarray, shape (3, n)
        Changes of the free coordinates by shifts along the axes of the ground.
    ways : ndarray, shape (k, 6)
        Velocities and spins of the motions that nothing hinders, shifts first.
    straight : int
        How many of them are shifts.
    mass : ndarray, shape (n, n)
    own : ndarray, shape (n,), or None
        One for coordinates of the part, zero for others; None where it is everything.
    rolls : bool
        Whether it is one rigid body that rubs, without springs: what moves it on goes on, as where a ball
        rolls down a slope.  As seen from axes that turn along, its friction would have that die out at once.
    """

    reduction: Reduction
    shifts: Array
    ways: Array
    straight: int
    mass: Array
    own: Array | None = None
    rolls: bool = False

    @cached_property
    def steady(self) -> Array | None:
        """One for coordinates whose accelerations last, zero for others, (n,); None where there are none."""
        if not self.rolls:
            return None
        return np.ones(len(self.reduction.rows)) if self.own is None else self.own

    @classmethod
    def of(cls, system: System, bodies: Sequence[Body], at: Array) -> Carrying | CarryingApart | None:
        """Return those that nothing hinders at coordinates ``at`` (n_x,): of a constant mass.

        None is returned where no turn is among them, or others than vectors turn.
        """
        units, x = Turning.units(bodies, 3), np.arange(1.0, system.n_x + 1.0)[None]
        for unit, spin in zip(units[3:], np.eye(3), strict=True):
            if not np.array_equal(unit.rates(x), _turned(spin, x)):
                return None
        rates = np.concatenate([one.rates(at[None]) for one in units])
        parts, rows = _parts(system, bodies), system.reduction.rows
        if not 1 < len(parts) <= MOST:
            return cls._of(system, at, rates, _rolls(system, bodies, np.ones(system.n_x)))
        kinds = [(own, _rolls(system, bodies, own)) for own in parts]
        found = [(own, cls._of(system, at, rates * own, rolls, own[rows])) for own, rolls in kinds]
        left = [own[rows] for own, one in found if one is None]
        each = tuple([one for _, one in found if one is not None])
        return CarryingApart(each, sum(left, np.zeros(len(rows)))) if each else None

    @classmethod
    def _of(
        cls, system: System, at: Array, rates: Array, rolls: bool, own: Array | None = None
    ) -> Carrying | None:
        """Return those of rates (6, n_x), of the unit motions, that nothing hinders."""
        ways = _unresisted(undriven(system.equations, at, rates), system.forces, at, rates)
        straight = null_space(ways[:, 3:].T, 1.0).T @ ways
        if len(straight) == len(ways):
            return None
        turns = null_space(straight @ ways.T, 1.0).T @ ways
        shifts, mass = system.reduction.free_rates(rates[:3]), system.equations.free_mass
        ways = np.concatenate([straight, turns])
        return cls(system.reduction, shifts, ways, len(straight), mass, own, rolls)

    def along(self, q: Array, v: Array, a: Array, times: Array) -> Carried:
        """Carry a state (n,) on as its rates and accelerations say, by times (n_times,) [s].

        Of the rigid motions that is the nearest to its rates; nothing is carried where it hardly turns.
        """
        x = self.reduction.expand(q[None])
        v, a = self._of_own(v), self._of_own(a)
        turns = [self._of_own(self.reduction.free_rates(_turned(axis, x))) for axis in np.eye(3)]
        units = self.ways @ np.concatenate([self.shifts, *turns])
        factors = self._nearest(units, v)
        whole, spin = factors @ units, (factors @ self.ways)[3:]
        far = spin @ spin * times[-1] ** 2 > SLIGHT**2
        part = np.where(far, 1.0, 0.0)
        factors, whole, spin = part * factors, part * whole, part * spin
        square = spin @ spin
        travel = self._travel(whole, (factors @ self.ways)[:3], spin, a)
        turn = whole - travel
        bent = self.turned(spin, turn[None])[0]
        square = square + (1e-3 * SLIGHT / times[-1]) ** 2
        rate, tau = np.sqrt(square), times[:, None]
        half = np.sin(0.5 * rate * tau)
        once, twice = np.sin(rate * tau) / rate, 2.0 * half * half / square
        moved = once * turn + twice * bent + tau * travel
        rest = v - whole
        seen = a - bent - 2.0 * self.turned(spin, rest[None])[0]
        return Carried(moved, rest, seen, self, spin, once, twice)

    def turned(self, spin: Array, changes: Array) -> Array:
        """Return the rates of changes (n_batch, n) that turn along."""
        return self._of_own(self.reduction.free_rates(_turned(spin, self.reduction.expand_rates(changes))))

    def _of_own(self, changes: Array) -> Array:
        return changes if self.own is None else changes * self.own

    def _travel(self, whole: Array, velocity: Array, spin: Array, a: Array) -> Array:
        """Return the rates (n,) by which the axis moves on, of those of everything, ``whole``.

        Along itself it does as all does; across, accelerations tell: of what moves on by m they are w x m
        less than of a turn about where nothing moves now.
        """
        own: Array = np.zeros(3)
        if self.straight:
            ways = self.ways[: self.straight, :3]
            whirls, missed = self.turned(spin, ways @ self.shifts), self.turned(spin, whole[None])[0] - a
            own = self._nearest(whirls, missed)
            told = self._square(missed - own @ whirls) <= TOLD * self._square(a)
            own = np.where(told, 1.0, 0.0) * (own @ ways)
        along = (velocity - own) @ spin / (spin @ spin + _TINY)
        return np.asarray((own + along * spin) @ self.shifts)

    def _square(self, v: Array) -> Array:
        """Return twice the energy of rates (n,), shape ()."""
        return np.asarray((v @ self.mass) @ v)

    def _nearest(self, rows: Array, wanted: Array) -> Array:
        """Return factors (k,) of rates (k, n) that come nearest to wanted ones, in the metric of the mass.

        They are shifts or turns along three axes: one that is next to nothing beside the others is none.
        """
        momenta = rows @ self.mass
        sizes = np.sqrt(np.maximum(np.sum(momenta * rows, axis=1), 0.0))
        alike = (sizes[: self.straight], sizes[self.straight :])
        sizes = np.concatenate([np.maximum(one, _FLAT * one.max(initial=0.0)) for one in alike]) + _TINY**0.5
        scaled, unit = momenta / sizes[:, None], rows / sizes[:, None]
        inverse = np.linalg.inv(scaled @ unit.T + _EVEN * np.eye(len(rows)))
        found = inverse @ (scaled @ wanted)
        found = found + inverse @ (scaled @ (wanted - found @ unit))
        return np.asarray(found / sizes)


def _parts(system: System, bodies: Sequence[Body]) -> list[Array]:
    """Return one at the coordinates of each part that joints and springs connect, zero elsewhere, (n_x,)."""
    part = np.zeros(system.n_x)
    for body in bodies:
        part[body.columns] = body.columns.start
    held = (one.markers for one in system.forces if isinstance(one, Tie) and one.holds_together)
    for ends in (*(one.ends for one in system.equations.constraints), *held):
        joined = [part[end.columns.start] for end in ends if not end.grounded]
        for other in joined[1:]:
            part[part == other] = joined[0]
            joined = [joined[0] if one == other else one for one in joined]
    return [np.where(part == one, 1.0, 0.0) for one in np.unique(part)]


def _rolls(system: System, bodies: Sequence[Body], part: Array) -> bool:
    """Tell whether a part, ones at its coordinates (n_x,), is a rigid body that rubs, without springs."""
    own = [body for body in bodies if part[body.columns].any()]
    weights = (isinstance(force, ConstantForce) for body in own for force in body.forces(system.n_x))
    ties = [one for one in system.forces if isinstance(one, Tie)]
    on = [one for one in ties if any(part[marker.columns].any() for marker in one.markers)]
    free = len(own) == 1 and all(weights) and not any(one.holds_together for one in on)
    return free and any(one.rubs for one in on)


def _unresisted(ways: Array, forces: Iterable[ForcePart], x: Array, units: Array) -> Array:
    """Return those of motions (k, 6) that change no length or angle which holds what moves to the ground."""
    held = [part for part in forces if isinstance(part, Tie) and part.holds]
    if not held or not len(ways):
        return ways
    rates, here = ways @ units, (np.zeros(len(ways)), np.repeat(x[None], len(ways), axis=0))
    _, sizes, right = np.linalg.svd(np.array([part.rate(*here, rates) for part in held]))
    return np.asarray(right[np.count_nonzero(sizes > HARDLY * np.abs(rates).max()) :] @ ways)


def _turned(spin: Array, changes: Array) -> Array:
    """Return w x of all vectors in changes (n_batch, n_x) of the coordinates."""
    vectors = changes.reshape(len(changes), -1, 3)
    return np.asarray(cross(spin, vectors).reshape(len(changes), -1))
