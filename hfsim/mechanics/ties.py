"""Forces between two markers on one coordinate: their distance, or an angle or a distance about an axis."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import NOTHING, Entries
from hfsim.mechanics.constraints import Constraint, Held
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.markers import Marker, joint_support
from hfsim.mechanics.resistances import Resistance
from hfsim.mechanics.turns import TurnCount

if TYPE_CHECKING:
    from hfsim.deck.laws import Law
    from hfsim.mechanics.once import Event

TOGETHER = 1e-12
"""Distance of two points, over their distances from the origin and in their bodies, that is rounding."""


@frozen
class PointPart(ForcePart):
    """A force that acts on points only."""

    @cached_property
    def support(self) -> IntArray:
        """Coordinates of its points."""
        return joint_support(*self.markers)


@frozen
class Tie(PointPart):
    """What resists one coordinate between two markers; a kind says how that is measured.

    Attributes
    ----------
    resistances : tuple of Resistance
        Their forces add up.
    """

    first: Marker
    second: Marker
    resistances: tuple[Resistance, ...]
    unit: ClassVar[str] = ""

    @property
    def markers(self) -> tuple[Marker, ...]:
        """Both points."""
        return self.first, self.second

    @property
    def measures(self) -> bool:
        """Whether the coordinate has a value, not a rate alone."""
        return True

    @property
    def rubs(self) -> bool:
        """Whether its friction is that of what it presses together."""
        return False

    @property
    def holds_together(self) -> bool:
        """Whether it holds what moves on evenly to what it ties it to."""
        return any(one.holds for one in self.resistances)

    @property
    def holds(self) -> bool:
        """Whether that is the ground."""
        return self.holds_together and any(one.grounded for one in self.markers)

    @cached_property
    def _ends(self) -> tuple[tuple[int, Marker], ...]:
        """The ends that can move, with their numbers."""
        return tuple((k, marker) for k, marker in enumerate(self.markers) if not marker.grounded)

    @cached_property
    def uses_rates(self) -> bool:
        """Whether any resistance depends on the rate."""
        return any(one.uses_rates for one in self.resistances)

    @cached_property
    def exchanges_power(self) -> bool:
        """Whether any resistance is more than the slope of its energy."""
        return any(one.exchanges_power for one in self.resistances)

    @property
    def events(self) -> tuple[Event, ...]:
        """What changes resistances once along the motion."""
        found = {id(event): event for one in self.resistances if (event := one.event) is not None}
        return tuple(found.values())

    @property
    def laws(self) -> tuple[Law, ...]:
        """Those of all resistances."""
        return tuple(law for one in self.resistances for law in one.laws)

    @property
    def has_edges(self) -> bool:
        """Whether any resistance changes its form at a value of the coordinate or of its rate."""
        return any(one.edges or one.rate_edges for one in self.resistances)

    def edges(self, t: Array, x: Array, u: Array) -> Array:
        """Return by how much coordinate and rate are beyond these values."""
        s, rows = self.measured(t, x)
        w = self._rate(rows, u)
        return np.concatenate([one.past_edges(t, s, w) for one in self.resistances], axis=1)

    def meets(self, x: Array) -> bool:
        """Tell whether the coordinate has no direction in one state."""
        return False

    def measured(self, t: Array, x: Array) -> tuple[Array, list[Array]]:
        """Return the coordinate, shape (n_batch,), and its derivative by the coordinates of each moving end.

        Derivatives have shape (n_batch or 1, n_columns).
        """
        raise NotImplementedError

    def beyond(self, t: Array, x: Array) -> float:
        """Return how far beyond the limits of resistances the coordinate is in one state."""
        s = float(self.measured(t, x)[0][0])
        return max((one.beyond(s) for one in self.resistances), default=0.0)

    def _rate(self, rows: list[Array], u: Array) -> Array:
        """Return the rate of the coordinate, shape (n_batch,)."""
        rates = [(J * u[:, end.columns]).sum(axis=-1) for (_, end), J in zip(self._ends, rows, strict=True)]
        first, *others = rates or [np.zeros(len(u))]
        return np.asarray(sum(others, first))

    def rate(self, t: Array, x: Array, u: Array) -> Array:
        """Return the rate of the coordinate, shape (n_batch,)."""
        return self._rate(self.measured(t, x)[1], u)

    def effort(self, t: Array, x: Array, u: Array) -> Array:
        """Return what it does to the second end along the coordinate [N or N m], shape (n_batch,)."""
        s, w, _ = self._all(t, x, u)
        return -self._sum(t, s, w)

    def slip(self, t: Array, x: Array, u: Array) -> Array:
        """Return the rates that friction resists, shape (n_batch, k)."""
        return self.rate(t, x, u)[:, None]

    def stuck(self, t: Array, x: Array, u: Array) -> float:
        """Return the slope by these of friction that sticks in one state; zero where nothing does."""
        w = self.rate(t, x, u)
        return sum(one.stuck(t, w) for one in self.resistances)

    def delivered(self, t: Array, x: Array, u: Array) -> Array:
        """Return what all resistances put into both bodies [W], shape (n_batch,)."""
        return self.effort(t, x, u) * self.rate(t, x, u)

    def exerted(self, t: Array, x: Array, u: Array) -> dict[str, Array]:
        """Return what it does to the second end, (n_batch, n), by its unit over that of an effort: m, rad."""
        return {self.unit: self.effort(t, x, u)[:, None]}

    def _all(self, t: Array, x: Array, u: Array) -> tuple[Array, Array, list[Array]]:
        """Return the coordinate, its rate where that counts, and its derivatives."""
        s, rows = self.measured(t, x)
        return s, self._rate(rows, u) if self.uses_rates else s, rows

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add the forces of all resistances on both ends."""
        for marker, force in self.on_points(t, x, u):
            out[:, marker.columns] += force

    def on_points(self, t: Array, x: Array, u: Array) -> Iterator[tuple[Marker, Array]]:
        """Yield the ends that can move, with the forces of all resistances there."""
        s, w, rows = self._all(t, x, u)
        force = -self._sum(t, s, w)[:, None]
        for (_, marker), J in zip(self._ends, rows, strict=True):
            yield marker, force * J

    def _sum(self, t: Array, s: Array, w: Array) -> Array:
        forces = [one.force(t, s, w) for one in self.resistances]
        return forces[0] if len(forces) == 1 else sum(forces[1:], forces[0])

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return what stiffness and curvature make of it in one state."""
        if not self._ends:
            return NOTHING
        s, w, rows = self._all(t, x, u)
        by_s, by_w = self._slopes(t, s, w)
        change = self._by_place(x, u, rows, by_s, by_w)
        stiff = Entries.of_block(self.support, self.support, self._whole(rows)[:, None] * change)
        return Entries.joined([stiff, self._curved(x, self._sum(t, s, w), by_s)])

    def _slopes(self, t: Array, s: Array, w: Array) -> tuple[Array, Array]:
        """Return the derivatives of all resistances by the coordinate and by its rate, (n_batch,)."""
        slopes = [one.slopes(t, s, w) for one in self.resistances]
        by_s, by_w = (sum(kind, 0.0 * s) for kind in zip(*slopes, strict=True))
        return by_s, by_w

    def _by_place(self, x: Array, u: Array, rows: list[Array], by_s: Array, by_w: Array) -> Array:
        """Return the derivative of all resistances by x in one state, (n_support,)."""
        change = by_s * self._whole(rows)
        if not self.uses_rates:
            return np.asarray(change)
        bent = self._curved(x, np.ones(1), np.zeros(1))
        along = np.bincount(bent.rows, bent.values * u[0, bent.columns], x.shape[1])
        return np.asarray(change + by_w * along[self.support])

    def _curved(self, x: Array, force: Array, slope: Array) -> Entries:
        """Return the force times the second derivative of the coordinate, in one state.

        Parameters
        ----------
        x : ndarray, shape (1, n_x)
        force, slope : ndarray, shape (1,)
            And its derivative by the coordinate, for where that has no derivative.
        """
        raise NotImplementedError

    def rate_tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return J^T J times the derivative by the rate in one state."""
        if not self.uses_rates or not self._ends:
            return NOTHING
        s, w, rows = self._all(t, x, u)
        row, factor = self._whole(rows), self._slopes(t, s, w)[1]
        return Entries.of_block(self.support, self.support, factor * row[:, None] * row)

    def _whole(self, rows: list[Array]) -> Array:
        """Return the sum (..., n_support) of what stands in rows (1, ..., n_columns) of the moving ends."""
        whole = np.zeros((*rows[0].shape[1:-1], max(marker.columns.stop for _, marker in self._ends)))
        for (_, marker), J in zip(self._ends, rows, strict=True):
            whole[..., marker.columns] += J[0]
        return whole[..., self.support]

    def potential_energy(self, t: Array, x: Array) -> Array:
        """Return what all resistances store."""
        s = self.measured(t, x)[0]
        return np.asarray(sum((one.energy(t, s) for one in self.resistances), np.zeros_like(s)))

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return the power of what is not the slope of an energy, and of what moves that on by a law."""
        s, rows = self.measured(t, x)
        w = self._rate(rows, u)
        exchanging = [one for one in self.resistances if one.exchanges_power]
        others = (one.force(t, s, w) - one.elastic(t, s) for one in exchanging)
        fed = (one.fed(t, s) for one in exchanging)
        return np.asarray(sum(fed, -w * sum(others, np.zeros_like(s))))


@frozen
class DistanceTie(Tie):
    """Resistances on the distance of two points.

    Attributes
    ----------
    together : float
        Distance up to which both points are in one place [m].
    """

    together: float = field(default=0.0, kw_only=True)
    told: ClassVar[str] = "what resists the distance of two points"
    unit: ClassVar[str] = "m"

    def measured(self, t: Array, x: Array) -> tuple[Array, list[Array]]:
        """Return the distance; where the points meet, it has no direction."""
        distance, direction = self._line(x)
        along = ((sign, direction[:, None] @ marker.position_jacobian(x)) for sign, marker in self._signed)
        return distance, [sign * row[:, 0] for sign, row in along]

    def reaction(self, t: Array, x: Array, u: Array) -> tuple[Array, Array]:
        """Return the force [N], (n_batch, n_dim), on the second body, and no moment, (n_batch, n_spin)."""
        force = self.effort(t, x, u)[:, None] * self._line(x)[1]
        return force, np.zeros((len(x), self.first.n_spin))

    def undirected(self, t: Array, x: Array) -> float:
        """Return the size of the force where both points are in one place, but for rounding."""
        nothing = np.zeros(len(x))
        return float(np.abs(self._sum(t, nothing, nothing)[0])) if self.meets(x) else 0.0

    @classmethod
    def between(cls, first: Marker, second: Marker, x: Array) -> DistanceTie:
        """Return one without resistances of a scene that starts in a state (n,)."""
        ends = (np.append(one.position(x[None]), one.offset or 0.0) for one in (first, second))
        return cls(first, second, (), together=TOGETHER * max(float(np.abs(one).max()) for one in ends))

    def meets(self, x: Array) -> bool:
        """Tell whether both points are in one place, but for rounding, in one state."""
        return bool(self._line(x)[0][0] == 0.0)

    @cached_property
    def _signed(self) -> tuple[tuple[float, Marker], ...]:
        """The ends that can move, with the sign of their places in the gap."""
        return tuple((1.0 if end else -1.0, marker) for end, marker in self._ends)

    def _line(self, x: Array) -> tuple[Array, Array]:
        """Return distance and direction, (n_batch, n_dim): none where the points are in one place."""
        gap = self.second.position(x) - self.first.position(x)
        distance = np.sqrt(np.sum(gap * gap, axis=-1))
        met = distance <= self.together
        return np.where(met, 0.0, distance), gap / np.where(met, np.inf, distance)[:, None]

    def _curved(self, x: Array, force: Array, slope: Array) -> Entries:
        """Return what turns of the line make of the force; where the points meet, it grows every way."""
        (s,), (e,) = self._line(x)
        pull = np.where(s == 0.0, slope, force / np.where(s == 0.0, 1.0, s))
        gap = self._whole([sign * marker.position_jacobian(x) for sign, marker in self._signed])
        turned = gap.T @ (pull * (np.eye(len(e)) - e[:, None] * e)) @ gap
        parts = [marker.position_stiffness(x, sign * force * e) for sign, marker in self._signed]
        parts.append(Entries.of_block(self.support, self.support, turned))
        return Entries(*(np.concatenate(kind) for kind in zip(*parts, strict=True)))


@frozen
class GapTie(Tie):
    """Resistances on what a joint or driver would hold: an angle, or a distance along an axis.

    An angle counts full turns: where vectors of a body give it, along the motion.

    Attributes
    ----------
    measure : Constraint
        Whose gap is the coordinate.
    counter : TurnCount or None
        None where nothing turns, and between bodies whose coordinates keep their turns.
    """

    told: ClassVar[str] = "what resists an angle, or a distance along an axis"
    measure: Constraint
    counter: TurnCount | None = None

    @property
    def unit(self) -> str:  # type: ignore[override]
        """Of the gap."""
        return self.measure.unit

    @classmethod
    def on(cls, measure: Constraint, resistances: tuple[Resistance, ...]) -> GapTie:
        """Return it between the markers of a constraint."""
        first, second = measure.ends
        turns = measure.unit == "rad" and measure.counts_turns
        known = not turns or (first.keeps_turns and second.keeps_turns)
        return cls(first, second, resistances, measure, None if known else TurnCount())

    @property
    def measures(self) -> bool:
        """Whether the gap is more than a rate."""
        return self.measure.counts_turns

    @property
    def quartic(self) -> bool:
        """Whether the coordinate is linear in those of the bodies, and the resistances suit."""
        angle = self.measure.holds_turn and self.first.linear_turn and self.second.linear_turn
        return angle and all(one.quartic for one in self.resistances)

    def angle(self, x: Array) -> Array:
        """Return how far the second frame has turned against the first."""
        return np.asarray(self.measure.gap(x)[:, 0])

    def spin(self, x: Array, u: Array) -> Array:
        """Return the rate of that."""
        return self._rate(self._seen(x)[1], u)

    def _seen(self, x: Array) -> tuple[Array, list[Array]]:
        gaps, slopes = self.measure.measured(x, [end for end, _ in self._ends])
        return gaps[:, 0], [J[:, 0] for J in slopes]

    def measured(self, t: Array, x: Array) -> tuple[Array, list[Array]]:
        """Return the gap, with all its turns."""
        gap, rows = self._seen(x)
        return gap if self.counter is None else self.counter.counted(t, gap), rows

    def unit_effort(self, x: Array) -> tuple[Array, Array]:
        """Return the force, and the moment, on the second body that go with an effort of one."""
        return self.measure.reaction(x, -np.ones((len(x), 1)))

    def reaction(self, t: Array, x: Array, u: Array) -> tuple[Array, Array]:
        """Return the force [N], (n_batch, n_dim), and moment [N m], (n_batch, n_spin), on the second body."""
        s, w, _ = self._all(t, x, u)
        return self.measure.reaction(x, self._sum(t, s, w)[:, None])

    def exerted(self, t: Array, x: Array, u: Array) -> dict[str, Array]:
        """Return the force and the moment: several turns together are about axes that lean on one another."""
        return dict(zip(("m", "rad"), self.reaction(t, x, u), strict=True))

    def _curved(self, x: Array, force: Array, slope: Array) -> Entries:
        return self.measure.stiffness(x, force[:, None])


def tie_on(held: Held, first: Marker, second: Marker, resistances: tuple[Resistance, ...]) -> GapTie:
    """Return what resists, between two markers, one thing that a joint could hold."""
    (measure,) = held.between(first, second)
    return GapTie.on(measure, resistances)
