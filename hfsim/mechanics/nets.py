"""Nets: springs and dampers between many pairs of points, which are called together."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, IntArray, distinct
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import NOTHING, Entries, Matrix, assemble, is_sparse
from hfsim.maths.traced import changeable, product
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.resistances import LinearSpring, Resistance
from hfsim.mechanics.ties import DistanceTie

MANY = 4
"""Distances from which one call for all takes less time."""


def knotted(parts: tuple[ForcePart, ...], n: int) -> tuple[ForcePart, ...]:
    """Return the parts of a scene with n coordinates, with a `Net` for the distances that can be in one."""
    ties, others = list[DistanceTie](), list[ForcePart]()
    for part in parts:
        if isinstance(part, DistanceTie) and _suits(part):
            ties.append(part)
        else:
            others.append(part)
    return parts if len(ties) < MANY else (*others, Net(tuple(ties), n))


def _suits(tie: DistanceTie) -> bool:
    return all(marker.linear for marker in tie.markers) and not all(one.grounded for one in tie.markers)


class _Pairs(NamedTuple):
    """Pairs of slopes of one gap each, by its number: their axes, columns of x and product, (n_pairs,)."""

    number: IntArray
    axes: tuple[IntArray, IntArray]
    columns: tuple[IntArray, IntArray]
    products: Array

    def sandwiched(self, blocks: Array) -> Entries:
        """Return the slopes, times blocks (n_ties, n_dim, n_dim), times the slopes."""
        return Entries(*self.columns, self.products * blocks[self.number, *self.axes])


@frozen
class Net(ForcePart):
    """Resistances on the distances of many pairs of points, whose places are linear in the coordinates.

    Attributes
    ----------
    ties : tuple of DistanceTie
    n : int
        Number of coordinates.
    """

    ties: tuple[DistanceTie, ...]
    n: int

    @cached_property
    def support(self) -> IntArray:
        """Coordinates of all points."""
        return distinct(np.concatenate([tie.support for tie in self.ties]))

    @cached_property
    def uses_rates(self) -> bool:
        """Whether any of them does."""
        return any(tie.uses_rates for tie in self.ties)

    @cached_property
    def exchanges_power(self) -> bool:
        """Whether any of them does."""
        return any(tie.exchanges_power for tie in self.ties)

    # ------------------------------------------------------------------ places

    @cached_property
    def _slopes(self) -> Entries:
        """Derivatives of the gaps by x: rows are axes of one gap after the other."""
        at, found = np.zeros((1, self.n)), []
        for k, tie in enumerate(self.ties):
            for sign, marker in zip((-1.0, 1.0), tie.markers, strict=True):
                J = sign * marker.position_jacobian(at)[0]
                axes, columns = np.nonzero(J)
                rows = k * self._n_dim + axes
                found.append(Entries(rows, marker.columns.start + columns, J[axes, columns]))
        return Entries.joined(found)

    @property
    def _n_dim(self) -> int:
        return self.ties[0].first.n_dim

    @cached_property
    def _gather(self) -> Matrix:
        return assemble([self._slopes], (len(self.ties) * self._n_dim, self.n))

    @cached_property
    def _scatter(self) -> Matrix:
        return self._gather.T.tocsr() if is_sparse(self._gather) else self._gather.T

    @cached_property
    def _offset(self) -> Array:
        """The gaps where all coordinates are zero."""
        at = np.zeros((1, self.n))
        return np.array([(tie.second.position(at) - tie.first.position(at))[0] for tie in self.ties])

    @cached_property
    def _pairs(self) -> _Pairs:
        rows, columns, values = self._slopes
        number, axes = np.divmod(rows, self._n_dim)
        many = np.bincount(number)
        # those of one gap stand together
        starts, each = np.cumsum(many) - many, many[number]
        first = np.repeat(np.arange(len(rows)), each)
        second = np.arange(len(first)) - np.repeat(np.cumsum(each) - each, each) + starts[number[first]]
        return _Pairs(
            number[first],
            (axes[first], axes[second]),
            (columns[first], columns[second]),
            values[first] * values[second],
        )

    def _gaps(self, x: Array) -> Array:
        """Return products of the slopes with coordinates or rates, (n_batch, n_ties, n_dim)."""
        return np.asarray(product(self._gather, x.T).T.reshape(len(x), len(self.ties), self._n_dim))

    def _lines(self, x: Array) -> tuple[Array, Array]:
        """Return distances (n_batch, n_ties) and directions (..., n_dim), as `DistanceTie` has them."""
        gaps = self._gaps(x) + self._offset
        distance = np.sqrt(np.sum(gaps * gaps, axis=-1))
        met = distance <= self._meeting
        return np.where(met, 0.0, distance), gaps / np.where(met, np.inf, distance)[..., None]

    @cached_property
    def _meeting(self) -> Array:
        """Distances up to which points are in one place, (n_ties,)."""
        return np.array([tie.together for tie in self.ties])

    def _rates(self, directions: Array, u: Array) -> Array:
        return np.asarray(np.sum(directions * self._gaps(u), axis=-1))

    # ------------------------------------------------------------------ resistances

    @cached_property
    def _springs(self) -> Array:
        """Stiffness, damping, rest and preload of a linear spring of each tie, (4, n_ties): zeros of none."""
        found = np.zeros((4, len(self.ties)))
        for k, spring in self._linear.items():
            found[:, k] = spring.stiffness, spring.damping, spring.rest, spring.preload
        return found

    @cached_property
    def _linear(self) -> dict[int, LinearSpring]:
        every = ((k, one) for k, tie in enumerate(self.ties) for one in tie.resistances)
        return {k: one for k, one in every if isinstance(one, LinearSpring)}

    @cached_property
    def _others(self) -> tuple[tuple[int, Resistance], ...]:
        """All else, with the numbers of the ties."""
        every = ((k, one) for k, tie in enumerate(self.ties) for one in tie.resistances)
        return tuple((k, one) for k, one in every if one is not self._linear.get(k))

    def _all(self, x: Array, u: Array) -> tuple[Array, Array, Array]:
        """Return distances, their rates where these count, and directions."""
        s, e = self._lines(x)
        return s, self._rates(e, u) if self.uses_rates else s, e

    def _sum(self, t: Array, s: Array, w: Array) -> Array:
        """Return the forces of all resistances, (n_batch, n_ties)."""
        stiffness, damping, rest, preload = self._springs
        forces = preload + stiffness * (s - rest)
        if damping.any():
            forces = forces + damping * w
        for k, one in self._others:
            forces[:, k] += one.force(t, s[:, k], w[:, k])
        return np.asarray(forces)

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add the forces of all on their ends."""
        s, w, e = self._all(x, u)
        forces = (self._sum(t, s, w)[..., None] * e).reshape(len(x), -1)
        out -= product(self._scatter, forces.T).T

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return what stiffnesses and turns of the lines make of it in one state."""
        s, w, e = self._all(x, u)
        by_s, by_w = (kind[0, :, None, None] for kind in self._by_length(t, s, w))
        (s,), (force,), (e,) = s[..., None, None], self._sum(t, s, w)[..., None, None], e
        met, along = s == 0.0, e[:, :, None] * e[:, None]
        across, length = np.eye(self._n_dim) - along, np.where(met, 1.0, s)
        blocks = by_s * along + np.where(met, by_s, force / length) * across
        if self.uses_rates:
            turned = np.where(met, 0.0, across / length) @ self._gaps(u)[0, :, :, None]
            blocks = blocks + by_w * e[:, :, None] * turned[:, None, :, 0]
        return self._pairs.sandwiched(blocks)

    def rate_tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return what dampers make of it in one state."""
        if not self.uses_rates:
            return NOTHING
        s, w, (e,) = self._all(x, u)
        by_w = self._by_length(t, s, w)[1][0, :, None, None]
        return self._pairs.sandwiched(by_w * e[:, :, None] * e[:, None])

    def _by_length(self, t: Array, s: Array, w: Array) -> tuple[Array, Array]:
        """Return the derivatives of all resistances by distances and rates, (n_batch, n_ties)."""
        by_s, by_w = (changeable(np.repeat(kind[None], len(s), axis=0)) for kind in self._springs[:2])
        for k, one in self._others:
            more, faster = one.slopes(t, s[:, k], w[:, k])
            by_s[:, k] += more
            by_w[:, k] += faster
        return by_s, by_w

    def potential_energy(self, t: Array, x: Array) -> Array:
        """Return what all resistances store."""
        s, (stiffness, _, rest, preload) = self._lines(x)[0], self._springs
        stored = np.sum((preload + 0.5 * stiffness * (s - rest)) * (s - rest), axis=-1)
        return np.asarray(sum((one.energy(t, s[:, k]) for k, one in self._others), stored))

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return the power of all that is not the slope of an energy; see `Tie`."""
        s, e = self._lines(x)
        w = self._rates(e, u)
        power = -np.sum(self._springs[1] * w * w, axis=-1)
        for k, one in self._others:
            if one.exchanges_power:
                own, rate = s[:, k], w[:, k]
                power = power + one.fed(t, own) - rate * (one.force(t, own, rate) - one.elastic(t, own))
        return np.asarray(power)
