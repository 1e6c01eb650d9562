"""Joints that hold the same motion more than once: refused in the plane, told in space where they agree.

Spatial mechanisms may move though their joints hold too much: every plane one with parallel hinges, a door on
two of them, Bennett's and Bricard's loops.  Whether joints agree is tried by moving the scene along what they
leave free.  Rows that others make superfluous are left out then, of few joints, and such that the rest stays
independent along all of the motion that was tried; the multipliers of a smaller set are unique, the reactions
in the joints are not.  Where no rows of few joints are surely such, any of the loop are, those that keep axes
of its bodies among them: these are as superfluous.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from hfsim.errors import DeckError
from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.matrices import Matrix, dense
from hfsim.maths.rank import LOST, dependence
from hfsim.mechanics.equations import Equations
from hfsim.mechanics.statics.gauge import Gauge
from hfsim.mechanics.system import System
from hfsim.scene.loading import LoadedDeck

STEP = 0.2
"""Largest change of a coordinate in a step of the motion that is tried, over its unit in the gauge."""
MOST_STEPS, EFFORT = 100, 1.2e6
"""Steps at most, and products of rows and coordinates of all of them."""
ROUND = 10
"""Steps from which the motion may have come round to where it began."""
ITERATIONS = 12
"""Corrections that close the joints after a step."""
AGREE = 1e-8
"""Gap, per unit of a row's derivative, up to which joints agree."""
SLIGHT = 1e-2
"""Gap of independent rows, over that of the others, that is left where these do not agree."""
TAKES_PART = 1e-6
"""Component of a null vector from which a row takes part in a dependence."""
NEGATIVE = 1e-3
"""Imaginary part over the real one up to which an eigenvalue is real."""
SURE = 0.1
"""How independent rows stay in all steps, at least, so that they surely do between these."""
EXCHANGES, GAIN, SMALLER = 100, 0.01, 0.1
"""Of rows that are left out, at most; what each has to gain, and to keep of what they have at most."""
MOST_ROWS = 1500
"""Joint equations up to which redundant ones are sought and left out."""

TOLD = 8
"""Joints that are named in a message."""


class Redundancy(NamedTuple):
    """Joint equations that others make superfluous.

    Attributes
    ----------
    joints : tuple of str
        Joints that take part.
    missing, of : int
        Number of equations that are superfluous, and of all joints together.
    left_out : dict of int to list of int
        Constraints of the system, with the rows that are left out.
    """

    joints: tuple[str, ...] = ()
    missing: int = 0
    of: int = 0
    left_out: Mapping[int, Sequence[int]] = {}

    def told(self, loaded: LoadedDeck) -> Iterator[tuple[str, str]]:
        """Yield what a user should know of it, with the deck path of a joint."""
        if self.joints:
            names = _listed(loaded, list(self.joints))
            message = (
                f"{names} hold more than they must: {self.missing} of {self.of} joint equations are redundant"
            )
            hint = "their forces and moments are not unique, one set of many is computed"
            yield f"joints.{self.joints[-1]}", f"{message}; {hint}"


def redundancy(
    loaded: LoadedDeck, system: System, joints: dict[str, tuple[int, ...]], x: Array, gauge: Gauge
) -> Redundancy:
    """Return which joint equations are superfluous at the start, coordinates (n_x,), of a scene.

    Raises
    ------
    DeckError
        Naming the joints whose equations depend on one another, where these contradict each other as soon as
        anything moves, or in the plane.
    """
    own = system.equations
    basis = own.reduction.basis / np.sqrt(own.reduction.reduced(gauge.whole).diagonal())
    missing = dependence(own.phi.jacobian_at(x[None]) @ basis, own.rows, {}).missing
    if not missing:
        return Redundancy()
    equations = system.unreduced
    found = dependence(equations.phi.jacobian_at(x[None]) * gauge.unit, equations.rows, joints)
    count = sum(system.constraints[k].rows for members in joints.values() for k in members)
    if loaded.deck.dimension == 2 or own.n_rows > MOST_ROWS:
        raise _refusal(loaded, found.joints, found.missing, count)
    motion = _Motion(own, missing, own.reduction.expand(own.reduction.free(x[None])), basis, gauge.unit)
    if gap := motion.contradiction():
        why = f": these agree at the start alone, and miss by {gap:.3g} after a motion of {STEP:g}"
        raise _refusal(loaded, found.joints, found.missing, count, why)
    if any(own.constraints[k].driven for k in motion.taking_part):
        raise _refusal(loaded, found.joints, found.missing, count, ", that of a driver among them")
    return Redundancy(found.joints, missing, count, _numbered(own, motion.superfluous()))


def _refusal(loaded: LoadedDeck, joints: Sequence[str], missing: int, count: int, why: str = "") -> DeckError:
    *others, last = joints
    return loaded.problem(
        f"joints.{last}",
        f"blocks what {_listed(loaded, others) or 'it'} already block{'s' if len(others) < 2 else ''}: "
        f"{missing} of {count} joint equations are redundant{why}",
        "remove a joint or free one of its motions",
    )


def _listed(loaded: LoadedDeck, names: list[str]) -> str:
    shown = names if len(names) <= TOLD + 1 else names[:TOLD]
    lines = {name: loaded.line_of(f"joints.{name}") for name in shown}
    told = [f"'{name}' (line {line})" if line else f"'{name}'" for name, line in lines.items()]
    more = len(names) - len(told)
    return ", ".join([*told, *([f"and {more} more"] if more else [])])


def _numbered(own: Equations, rows: Sequence[int]) -> dict[int, list[int]]:
    """Return rows of Phi by the number of their constraint among all."""
    numbers = [k for k in range(len(own.all_constraints)) if k not in own.reduction.eliminated]
    found: dict[int, list[int]] = {}
    for k, place in zip(numbers, own.rows, strict=True):
        if inside := [row - place.start for row in rows if place.start <= row < place.stop]:
            found[k] = inside
    return found


class _Decomposed(NamedTuple):
    """Joint equations in some state by what is independent of them: singular vectors of rows of unit length.

    Attributes
    ----------
    left : ndarray, shape (n_rows, n_rows)
    sizes : ndarray, shape (n_rows - missing,)
    right : ndarray, shape (n, n)
    lengths : ndarray, shape (n_rows,)
    """

    left: Array
    sizes: Array
    right: Array
    lengths: Array

    @property
    def null(self) -> Array:
        """Left null vectors, shape (n_rows, missing)."""
        return self.left[:, len(self.sizes) :].copy()  # the others are many

    def parted(self, gaps: Array) -> tuple[Array, Array]:
        """Return what gaps (n_rows,) are of independent rows, and of the rest."""
        parts = (gaps / self.lengths) @ self.left
        return parts[: len(self.sizes)], parts[len(self.sizes) :]


class _Motion:
    """A motion of a scene along what its joints leave free: x = start + basis s.

    Attributes
    ----------
    null : list of ndarray, shape (n_rows, missing)
        Left null vectors of the joint equations, of rows of unit length, along the motion.
    """

    def __init__(self, own: Equations, missing: int, start: Array, basis: Matrix, unit: Array) -> None:
        self._own, self._missing = own, missing
        self._start, self._basis, self._unit = start, dense(basis), unit
        self.null: list[Array] = []

    def contradiction(self) -> float:
        """Move on from the start; return by how much rows miss that agreed there, or 0."""
        ahead = first = None
        s: Array = np.zeros(self._own.n)
        here = self._decomposed(s)
        for _ in range(int(np.clip(EFFORT / (self._own.n_rows * self._own.n), 4, MOST_STEPS))):
            if self.null and here.sizes[-1] <= LOST**0.5 * here.sizes[0]:
                break
            self.null.append(here.null)
            free = here.right[len(here.sizes) :]
            if not len(free):
                break
            step = free.T @ (free @ (np.sin(np.arange(1.0, len(s) + 1.0) ** 2) if ahead is None else ahead))
            ahead = step * STEP / self._size(step)
            first = ahead if first is None else first
            s = self._closed(s + ahead)
            here = self._decomposed(s)
            rest, apart = (float(np.abs(gaps).max(initial=0.0)) for gaps in here.parted(self._gaps(s)))
            if rest > max(AGREE, SLIGHT * apart):
                break
            if apart > AGREE:
                return apart
            if len(self.null) > ROUND and self._size(s) < STEP and ahead @ first > 0.0:
                break
        return 0.0

    def _size(self, s: Array) -> float:
        """Return the largest change of a coordinate, over its unit."""
        return float(np.abs(self._basis @ s / self._unit).max())

    def _decomposed(self, s: Array) -> _Decomposed:
        J = dense(self._own.phi.jacobian_at(self._start + self._basis @ s) @ self._basis)
        lengths = np.maximum(np.linalg.norm(J, axis=1), 1e-300)
        left, sizes, right = np.linalg.svd(J / lengths[:, None])
        return _Decomposed(left, sizes[: len(J) - self._missing], right, lengths)

    def _gaps(self, s: Array) -> Array:
        return np.asarray(self._own.phi.residual(np.zeros(1), self._start + self._basis @ s)[0])

    def _closed(self, s: Array) -> Array:
        """Return the nearest state in which independent rows hold, as far as corrections lead there."""
        there, before = self._decomposed(s), np.inf
        for _ in range(ITERATIONS):
            rest, _ = there.parted(self._gaps(s))
            size = np.abs(rest).max(initial=0.0)
            if size < 1e-3 * AGREE or not size < before:
                break
            before = size
            s = s - (rest / np.maximum(there.sizes, LOST)) @ there.right[: len(rest)]
        return s

    @property
    def _weights(self) -> Array:
        return np.asarray(np.linalg.norm(self.null[0], axis=1))

    @property
    def taking_part(self) -> list[int]:
        """Numbers of the constraints whose rows depend on others."""
        pairs = enumerate(self._own.rows)
        return [k for k, rows in pairs if self._weights[rows].max(initial=0.0) > TAKES_PART]

    def superfluous(self) -> list[int]:
        """Return the rows without which the others stay farthest from depending on one another."""
        items: dict[str, list[int]] = {}
        for k in self.taking_part:
            rows = self._own.rows[k]
            items.setdefault(self._own.constraints[k].item, []).extend(range(rows.start, rows.stop))
        places = [np.array(rows) for item, rows in items.items() if item.startswith("joints.")]
        pools = [np.concatenate(places)]
        if self._own.ballast is None:  # else rows that keep axes stand in for mass
            pools.append(np.concatenate([np.array(rows) for rows in items.values()]))
        trials = [
            chosen
            for null in self.null[:: max(1, len(self.null) // 4)]
            for first in range(len(places))
            if len(chosen := _cut(null, places, first)) == self._missing
        ]
        best = max(trials or [self._farthest(pools[0])], key=self._margin)
        for pool in pools:
            for start in (best, self._farthest(pool)):
                if self._margin(best) < (0, SURE):
                    best = max(best, self._exchanged(start, pool), key=self._margin)
        return best

    def _farthest(self, pool: IntArray) -> list[int]:
        """Return rows of a pool that take most part in null vectors on average, each beside those before."""
        rest, rows = self._carried[:, pool].mean(axis=0), list[int]()
        for _ in range(self._missing):
            sizes = np.linalg.norm(rest, axis=1)
            sizes[rows] = -1.0
            rows.append(int(np.argmax(sizes)))
            unit = rest[rows[-1]] / max(sizes[rows[-1]], 1e-300)
            rest = rest - np.outer(rest @ unit, unit)
        return [int(row) for row in pool[rows]]

    def _exchanged(self, rows: list[int], pool: IntArray) -> list[int]:
        """Return rows, exchanged one by one for others of a pool, so that what is left depends less."""
        null, chosen = self._carried[:, pool], [int(np.flatnonzero(pool == row)[0]) for row in rows]
        for _ in range(EXCHANGES):
            now, others = _volumes(null, chosen)
            least, sizes = _least(now), _least(others)
            # what is all but dependent throughout has no sign to speak of
            sizes[np.abs(others).max(axis=0) < SMALLER * np.abs(now).max()] = -1.0
            row, k = np.unravel_index(np.argmax(sizes), sizes.shape)
            if not sizes[row, k] > least + GAIN * abs(least):
                break
            chosen[k] = int(row)
        return [int(row) for row in pool[chosen]]

    @cached_property
    def _carried(self) -> Array:
        """Null vectors of all steps, (n_steps, n_rows, missing), such that they turn least between these."""
        found = self.null[:1]
        for null in self.null[1:]:
            left, _, right = np.linalg.svd(null.T @ found[-1])
            found.append(null @ left @ right)
        return np.array(found)

    def _margin(self, rows: list[int]) -> tuple[int, float]:
        """Return how independent the other rows stay along the motion.

        Returns
        -------
        crossings : int
            Minus the number of times that they depend on one another between two steps.
        least : float
            How independent they are in all steps, at least.
        """
        parts = np.array([null[rows] for null in self.null])
        least = float(np.linalg.svd(parts, compute_uv=False)[:, -1].min())
        if least < TAKES_PART:
            return -len(parts) * self._missing, least
        # from one step straight to the next something is zero where this has a negative eigenvalue
        ratios = np.linalg.eigvals(np.linalg.solve(parts[:-1], parts[1:] @ self._turns))
        return -int(((ratios.real < 0.0) & (np.abs(ratios.imag) < NEGATIVE * -ratios.real)).sum()), least

    @cached_property
    def _turns(self) -> Array:
        """What turns null vectors of each step, but the first, into those of the step before."""
        turns = [other.T @ one for one, other in pairwise(self.null)]
        return np.array(turns).reshape(-1, self._missing, self._missing)


def _volumes(null: Array, rows: Sequence[int]) -> tuple[Array, Array]:
    """Return determinants of rows of null vectors (n_steps, n_rows, missing): zero where the others depend.

    Returns
    -------
    now : ndarray, shape (n_steps,)
        Of these rows.
    others : ndarray, shape (n_steps, n_rows, missing)
        With any row in place of each of these.
    """
    left, sizes, right = np.linalg.svd(null[:, rows])
    signs = np.linalg.det(left) * np.linalg.det(right)
    without = np.where(np.eye(len(rows), dtype=bool), 1.0, sizes[:, None]).prod(axis=2)
    adjugates = right.swapaxes(1, 2) * (signs[:, None] * without)[:, None] @ left.swapaxes(1, 2)
    return signs * sizes.prod(axis=1), null @ adjugates


def _least(volumes: Array) -> Array:
    """Return how far volumes (n_steps, ...) stay from zero, also halfway between steps.

    Of those that change their sign it is below zero: how far they get beyond, over the other way.
    """
    every = volumes
    if len(volumes) > 2:
        before, after = (3.0 * (a - b) + c for a, b, c in (volumes[:3], volumes[:-4:-1]))
        around = np.concatenate([before[None], volumes, after[None]])
        halfway = (9.0 * (around[1:-2] + around[2:-1]) - around[:-3] - around[3:]) / 16.0
        every = np.concatenate([volumes, halfway])
    low, high = every.min(axis=0), every.max(axis=0)
    least = np.maximum(low, -high)
    return np.asarray(np.where(least > 0.0, least, least / np.maximum(np.maximum(high, -low), 1e-300)))


def _cut(null: Array, places: Sequence[IntArray], first: int) -> list[int]:
    """Return as many rows as there are null vectors, joint after joint, on which none of these is zero.

    Parameters
    ----------
    null : ndarray, shape (n_rows, missing)
    places : sequence of ndarray of int
        Rows of each joint.
    first : int
        The joint to begin with; then come those that take most.
    """
    chosen: list[int] = []
    left = list(range(len(places)))
    joint = first
    while null.shape[1]:
        rest = null[places[joint]].copy()
        rows: list[int] = []
        while len(rows) < null.shape[1]:
            sizes = np.linalg.norm(rest, axis=1)
            k = int(np.argmax(sizes))
            if sizes[k] < 0.1 * np.linalg.norm(null[places[joint]]) or sizes[k] < TAKES_PART:
                break
            rows.append(int(places[joint][k]))
            rest = rest - np.outer(rest @ rest[k], rest[k]) / sizes[k] ** 2
        chosen += rows
        null = null @ np.linalg.svd(null[rows])[2][len(rows) :].T if rows else null
        left.remove(joint)
        if not left:
            break
        joint = max(left, key=lambda one: float(np.linalg.norm(null[places[one]])))
    return chosen
