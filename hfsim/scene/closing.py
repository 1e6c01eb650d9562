"""Where rigid bodies are so that their joints hold: damped least squares from many starts at once.

Bodies start undeformed, so each has the freedom of its frame and points of it are those of a rigid body.  The
places of all frames, one after the other, are a vector x: that of an assembled scene of rigid bodies.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from functools import cached_property
from itertools import count, groupby, repeat
from typing import TypeAlias

import numpy as np

from hfsim.maths.arrays import Array, BoolArray, IntArray, magnitude
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries, Matrix, assemble, dense, is_sparse, rescaled, smallest_step
from hfsim.maths.rotations import freedoms, rotation, rotation_rates, rotation_vector, wrap
from hfsim.mechanics.body import Body, Place
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.joint_rows import JointRows
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.planar_markers import RigidMarker
from hfsim.mechanics.pose import Pose, Twist

LEVEL = np.eye(3)
CLOSED = 1e-9
"""Gap of a joint, relative to the size of the linkage or in radians, that counts as none."""
NO_LENGTH = 1e-13
"""Distance that is rounding of a deck's expressions, as of 0.1 + 0.2 - 0.3 [m]."""
BESIDE = 1e-6
"""Part of the largest gap up to which another one beside it counts as none."""
MOST_ROWS = 500
"""Equations of joints up to which all that they miss at the start is found by dense algebra."""
SWEEPS = 80
"""Steps of the damped iteration."""
STARTS = 48
"""Starts of the search for loops, fewer in scenes of many bodies."""
CUT = (1e-1, 1e-2, 1e-3, 1e-4)
"""Weights, one after the other, of the joint at which an open loop is cut, over those of all others."""


@frozen
class Frame(Body):
    """A body at the start, when it is undeformed: only its frame moves."""

    centre: Array | None
    n_axes: int = 3

    @classmethod
    def of(
        cls, bodies: Iterable[Body], n_dim: int, centres: Array | None, lines: Collection[str] = ()
    ) -> dict[str, Frame]:
        """Return the frames of bodies by name, in space turned from their centres.

        Of ``lines``, the bodies that are lines without sections, joints hold the tangent alone.
        """
        size = freedoms(n_dim)
        columns = (slice(k * size, (k + 1) * size) for k in count())
        places = repeat(None) if centres is None else centres
        every = zip(bodies, columns, places, strict=False)
        axes = dict.fromkeys(lines, 1)
        return {
            b.name: cls(b.name, own, _referred(b), at, axes.get(b.name, 3)) for b, own, at in every
        }

    @property
    def origin(self) -> Place:
        """The origin of the body frame."""
        return (0.0, 0.0) if self.centre is None else (0.0, 0.0, 0.0)

    def marker(self, place: Place) -> Marker:
        """Return the marker of a point that turns with the frame."""
        if self.centre is not None:
            from hfsim.mechanics.spatial_markers import FrameMarker

            return FrameMarker(self.columns, place, self.centre, self.n_axes)
        return RigidMarker(self.columns, (place[0], place[1]))


def _referred(body: Body) -> dict[str, Place]:
    return {name: body.reference(place) for name, place in body.points.items()}


Sense: TypeAlias = tuple[str, Marker, Marker, Array, Array]
"""A joint, its two points, and an axis in the frame of each."""


@frozen
class Linkage:
    """The joints of a scene between the frames of its bodies.

    Attributes
    ----------
    n : int
        Number of coordinates of all frames.
    centres : ndarray, shape (n_bodies, 3, 3), or None
        In space, from which the turns of the frames count, as rotation vectors.
    senses : tuple of Sense
        Axes that are not to point in opposite ways, though the constraints would allow it.
    bodies : tuple of Body
        Whose frames these are.
    far : float
        Largest of the places and distances that are stated [m].
    """

    constraints: tuple[Constraint, ...]
    n: int
    n_dim: int
    centres: Array | None = None
    senses: tuple[Sense, ...] = ()
    bodies: tuple[Body, ...] = ()
    far: float = 0.0

    def owner(self, marker: Marker) -> int | None:
        """Return the number of the body that a marker is on; None for the ground."""
        return None if marker.grounded else marker.columns.start // freedoms(self.n_dim)

    @cached_property
    def ends_on(self) -> dict[int, list[tuple[Constraint, Marker]]]:
        """The constraints on each body that is in any, with their points on it."""
        found: dict[int, list[tuple[Constraint, Marker]]] = {}
        for c in self.constraints:
            for marker in c.ends:
                if (body := self.owner(marker)) is not None:
                    found.setdefault(body, []).append((c, marker))
        return found

    def columns_of(self, body: int) -> IntArray:
        """Return the coordinates of the frame of a body."""
        return np.arange(body * freedoms(self.n_dim), (body + 1) * freedoms(self.n_dim))

    @cached_property
    def equations(self) -> JointRows:
        """What the joints hold: the gaps, one below the other, not in units."""
        return JointRows(self.constraints, self.n, sparse=sum(c.rows for c in self.constraints) > MOST_ROWS)

    @cached_property
    def turns(self) -> BoolArray:
        """Which coordinates are turns, (n,)."""
        return np.tile(np.arange(freedoms(self.n_dim)) >= self.n_dim, self.n // freedoms(self.n_dim))

    @cached_property
    def turning(self) -> BoolArray:
        """Which of these full turns may be added to, (n,): those that no gear counts."""
        free = self.turns.copy()
        for marker in (marker for c in self.constraints if c.against for marker in c.ends):
            free[marker.columns] &= marker.grounded
        return free

    @cached_property
    def size(self) -> float:
        """Largest distance of a joint from the origin of what it is on [m].

        Where all are none, what bodies extend over, or how far apart they are stated to be.
        """
        at_origin = np.zeros((1, self.n))
        marks = [marker.position(at_origin)[0] for c in self.constraints for marker in c.ends]
        size = max([float(np.linalg.norm(mark)) for mark in marks], default=0.0)
        return size if size > NO_LENGTH else max((*map(_reach, self.bodies), self.far)) or 1.0

    @cached_property
    def units(self) -> Array:
        """Unit of each coordinate, (n,): the size or a radian, by which points move as far."""
        return np.where(self.turns, 1.0, self.size)

    @cached_property
    def scales(self) -> Array:
        """Unit of each gap, (n_rows,): likewise."""
        return np.concatenate([np.zeros(0), *(np.full(c.rows, self._unit_of(c)) for c in self.constraints)])

    def _unit_of(self, constraint: Constraint) -> float:
        return self.size if constraint.unit == "m" else 1.0

    def gaps(self, x: Array) -> Array:
        """Return what joints miss at the start in places (n_batch, n), in units, shape (n_batch, n_rows)."""
        return np.asarray(self.equations.residual(np.zeros(len(x)), x) / self.scales)

    def slopes(self, x: Array, free: BoolArray | IntArray) -> Array:
        """Return the derivative of the gaps by some coordinates, in units, (n_batch or 1, n_rows, n_free)."""
        J = self.equations.jacobians(x)[:, :, free]
        return np.asarray(rescaled(J, self.units[free], self.scales))

    def slopes_at(self, x: Array, free: BoolArray | IntArray) -> Matrix:
        """Return the same at places (n,), (n_rows, n_free); sparse in large scenes."""
        return rescaled(self.equations.jacobian_at(x[None])[:, free], self.units[free], self.scales)

    def slopes_by_rates(self, x: Array) -> Matrix:
        """Return the derivative of the gaps' rates by velocities and spins at places (n,), likewise."""
        J = self.equations.jacobian_at(x[None])
        if self.centres is not None and is_sparse(J):
            J = J @ _by_spins(x.reshape(-1, 6)[:, 3:])
        elif self.centres is not None:
            for k, turn in enumerate(x.reshape(-1, 6)[:, 3:]):
                spins = slice(6 * k + 3, 6 * k + 6)
                J[:, spins] = J[:, spins] @ np.linalg.inv(rotation_rates(turn))
        return rescaled(J, self.units, self.scales)

    def poses(self, x: Array) -> list[Pose]:
        """Return the poses of all frames at places (n,)."""
        rows = x.reshape(-1, freedoms(self.n_dim))
        if self.centres is None:
            return [Pose(row[: self.n_dim], row[self.n_dim :]) for row in rows]
        turns = rotation_vector(rotation(rows[:, 3:]) @ self.centres)
        return [Pose(row[:3], turn) for row, turn in zip(rows, turns, strict=True)]

    def apart(self, one: Array, other: Array) -> float:
        """Return by how much turns differ between two places (n,) [rad], at most, full turns aside."""
        if self.centres is None:
            return magnitude(wrap(one - other)[self.turns])
        first, second = (rotation(x.reshape(-1, 6)[:, 3:]) for x in (one, other))
        return magnitude(np.linalg.norm(rotation_vector(first @ second.swapaxes(1, 2)), axis=-1))

    @cached_property
    def drift(self) -> Array:
        """How fast the gaps grow at the start if nothing moves: drivers; in units, shape (n_rows,)."""
        return np.asarray(self.equations.rate(np.zeros(1))[0] / self.scales)

    def worst(self, x: Array) -> tuple[Constraint, float]:
        """Return the constraint with the largest gap at places (n,), and its size [m or rad]."""
        return self.largest_of(self.gaps(x[None])[0])

    def largest_of(self, gaps: Array) -> tuple[Constraint, float]:
        """Return the last constraint with the largest of gaps (n_rows,), or nearly so, and its size [m, rad].

        A distance is named before an angle, but for one that closing leaves by rounding.
        """
        sizes = np.array([np.linalg.norm(gaps[rows]) for rows in self.equations.rows])
        apart = sizes > max(CLOSED, BESIDE * sizes.max())
        apart &= np.array([c.unit == "m" for c in self.constraints])
        ranked = np.where(apart, sizes, 0.0) if apart.any() else sizes
        k = int(np.flatnonzero(ranked >= 0.999 * ranked.max())[-1])
        return self.constraints[k], float(sizes[k]) * self._unit_of(self.constraints[k])

    def close(self, x: Array, free: BoolArray) -> float:
        """Close joints by Newton's steps of least size, in place (n,); return the largest gap left."""
        left = magnitude(self.gaps(x[None]))
        while left >= 1e-14 * max(1.0, magnitude(x / self.units)) and free.any():
            trial, J = x.copy(), self.slopes_at(x, free)
            trial[free] -= self.units[free] * smallest_step(J, self.gaps(x[None])[0])
            reached = magnitude(self.gaps(trial[None]))
            if not reached < 0.5 * left:
                break
            x[:], left = trial, reached
        return left

    def descend(self, x: Array, free: BoolArray, weights: Array | None = None) -> Array:
        """Return places where the gaps of (n_batch, n) are smallest nearby, by Levenberg and Marquardt.

        Parameters
        ----------
        x : ndarray, shape (n_batch, n)
        free : ndarray of bool, shape (n,)
            Which coordinates may change.
        weights : ndarray, shape (n_rows,), optional
            Of the gaps.
        """
        w, units = 1.0 if weights is None else weights, self.units[free]
        x, damping = x.copy(), np.full((len(x), 1, 1), 1e-2)
        gaps = w * self.gaps(x)
        for _ in range(SWEEPS):
            J = self.slopes(x, free) * np.reshape(w, (-1, 1))
            slope = gaps[:, None] @ J
            A = J.swapaxes(1, 2) @ J + damping * np.eye(J.shape[2])
            step = np.linalg.solve(A, slope.swapaxes(1, 2))[..., 0]
            trial = x.copy()
            trial[:, free] -= units * step
            reached = w * self.gaps(trial)
            better = np.sum(reached**2, axis=1) < np.sum(gaps**2, axis=1)
            x[better], gaps[better] = trial[better], reached[better]
            damping = np.clip(np.where(better[:, None, None], damping / 8.0, damping * 4.0), 1e-12, 1e6)
            if magnitude(gaps) < CLOSED or magnitude(step) < 1e-10:
                break
        return x

    def starts(self, x: Array, turns: BoolArray) -> Array:
        """Return places (n_batch, n): x itself, then others with some turns spread evenly over all angles."""
        turning = np.flatnonzero(turns)
        count = int(np.clip(4e6 / self.n**2, 2, STARTS)) if len(turning) else 1
        spread = np.repeat(x[None], count, axis=0)
        spread[1:, turning] += 2.0 * np.pi * _evenly(count - 1, len(turning))
        return spread

    def search(self, x: Array, free: BoolArray) -> list[Array]:
        """Return all places found near which, from places (n_batch, n) on, the joints hold."""
        found = self.descend(x, free)
        return [one for one in found if self.closes(one, free)]

    def closes(self, x: Array, free: BoolArray) -> bool:
        """Close joints, as `close` does, and tell whether they hold then, the right way round."""
        return self.close(x, free) < CLOSED and self.right_way_round(x)

    def right_way_round(self, x: Array) -> bool:
        """Tell whether axes that joints hold point the same way at places (n,)."""
        return not any(self.turned_over(x))

    def turned_over(self, x: Array) -> Iterator[str]:
        """Yield the joints that hold axes which point in opposite ways at places (n,), for each of these."""
        for item, a, b, own, other in self.senses:
            if not float(np.sum(a.turned(x[None], own) * b.turned(x[None], other))) > 0.0:
                yield item

    def faced(self, x: Array) -> Iterator[tuple[str, tuple[Marker, Marker], Array, Array]]:
        """Yield joints that hold three axes, their ends, and B's axes in A's: as held, and at places (n,)."""
        for item, group in groupby(self.senses, key=lambda sense: sense[0]):
            _, firsts, seconds, owns, others = zip(*group, strict=True)
            if len(owns) == 3:
                own, other = np.stack(owns, axis=1), np.stack(others, axis=1)
                a, b = firsts[0], seconds[0]
                first, second = (np.stack([end.turned(x[None], e)[0] for e in LEVEL]) for end in (a, b))
                yield item, (a, b), own @ other.T, first @ second.T

    def cut(self, x: Array, free: BoolArray) -> tuple[Constraint, float]:
        """Return the joint that stays open where all others close, from places (n_batch, n) on; its gap.

        Places with axes turned over count if all joints close there: others may come near to that, as angles
        about such axes have no value.
        """
        x = self._meant(self.descend(x, free))
        opened, _ = self.worst(self.nearest(x))
        own = self.equations.rows[self.constraints.index(opened)]
        weights = np.ones(self.equations.n_rows)
        for weights[own] in CUT:
            x = self._meant(self.descend(x, free, weights))
        return self.worst(self.nearest(x, np.where(weights < 1.0, 1.0, 1.0 / CUT[-1])))

    def _meant(self, x: Array) -> Array:
        """Return of places (n_batch, n) those with axes the right way round, or no gaps; all, for none."""
        closed = np.abs(self.gaps(x)).max(axis=1, initial=0.0) < CLOSED
        kept = closed | np.array([self.right_way_round(one) for one in x])
        return x[kept] if kept.any() else x

    def moves(self, x: Array, free: BoolArray) -> bool:
        """Return whether the joints leave the free coordinates a motion at places (n,)."""
        return bool(np.linalg.matrix_rank(dense(self.slopes_at(x, free)), 1e-9) < free.sum())

    def nearest(self, x: Array, weights: Array | float = 1.0) -> Array:
        """Return of places (n_batch, n) those, (n,), with the smallest sum of weighted squares of gaps."""
        return np.asarray(x[int(np.argmin(np.sum((weights * self.gaps(x)) ** 2, axis=1)))])


def _reach(body: Body) -> float:
    """Return how far points of a body are from its origin; its radius of gyration, if there is none [m]."""
    if body.still:
        return 0.0
    far = max((float(np.linalg.norm(place)) for place in body.points.values()), default=0.0)
    if far <= NO_LENGTH:
        pose, own = Pose.level(np.zeros(body.n_dim)), body.columns
        rows, columns, values = body.mass_entries()
        u = np.array([body.moving(pose, unit) for unit in Twist.units(body.n_dim)])
        twice = np.sum(u[:, rows - own.start] * values * u[:, columns - own.start], axis=1)
        far = float(np.sqrt(magnitude(twice[body.n_dim :]) / (magnitude(twice[: body.n_dim]) or 1.0)))
    return far


def _by_spins(turns: Array) -> Matrix:
    """Return the sparse matrix (n, n) from velocities and spins to rates of frames, turns (n_bodies, 3)."""
    blocks = np.tile(np.eye(6), (len(turns), 1, 1))
    blocks[:, 3:, 3:] = np.linalg.inv(rotation_rates(turns))
    places = np.arange(6 * len(turns)).reshape(-1, 6)
    return assemble([Entries.of_block(places, places, blocks)], (places.size, places.size), sparse=True)


def _evenly(count: int, n: int) -> Array:
    """Return points (count, n) spread evenly over the unit cube: multiples of powers of a golden ratio."""
    ratio = 2.0
    for _ in range(40):
        ratio = (1.0 + ratio) ** (1.0 / (n + 1))
    return np.asarray(np.arange(1.0, count + 1.0)[:, None] * ratio ** -np.arange(1.0, n + 1.0) % 1.0)
