"""What integrators give: steps with a polynomial inside."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar

import numpy as np

from hfsim.integrators._tableau import legendre
from hfsim.maths.arrays import Array, IntArray, distinct, slices
from hfsim.maths.shapes import gauss_legendre
from hfsim.mechanics.counting import Past

_Key = TypeVar("_Key", int, float)
Watch = Callable[[float, Array, Array], None]
"""Is told (t, q, v) of every kept step's end; may raise to end the run."""


class Segment(NamedTuple):
    """One step: start state and the accelerations within it as a Legendre series.

    Attributes
    ----------
    t, h : float
    q, v : ndarray, shape (n,)
        State at the start.
    series : ndarray, shape (m, n)
        Coefficients of the shifted Legendre polynomials in (time - t) / h.
    """

    t: float
    h: float
    q: Array
    v: Array
    series: Array

    def at(self, times: Array) -> tuple[Array, Array]:
        """Return (q, v) at times within the step, shape (n_times, n) each."""
        theta = (times - self.t) / self.h
        return self.read(theta, *legendre(theta, len(self.series))[1:])

    def inside(self, shares: Array) -> tuple[Array, Array]:
        """Return the same at shares of its length, which are those of many steps."""
        return self.read(shares, *_polynomials(shares.tobytes(), self.series.shape[-2]))

    def positions(self, shares: Array) -> Array:
        """Return q at shares of its length, shape (n_shares, n)."""
        return self._positions(shares, _polynomials(shares.tobytes(), len(self.series))[1])

    def read(self, theta: Array, once: Array, twice: Array) -> tuple[Array, Array]:
        """Return the same at places 0 to 1, from integrals of the polynomials there."""
        return self._positions(theta, twice), self.v + self.h * (once @ self.series)

    def _positions(self, theta: Array, twice: Array) -> Array:
        return self.q + self.h * theta[..., None] * self.v + self.h**2 * (twice @ self.series)


@lru_cache(maxsize=64)
def _polynomials(places: bytes, count: int) -> tuple[Array, Array]:
    """Return the integrals of polynomials at places, as `Segment.read` wants them."""
    return legendre(np.frombuffer(places), count)[1:]


@lru_cache(maxsize=1)
def _two_point_inverse() -> Array:
    values, _, _ = legendre(np.array([0.0, 1.0]), 4)
    _, once, twice = legendre(np.array([1.0]), 4)
    return np.linalg.inv(np.concatenate([values, once, twice]))


_State = tuple[Array, Array, Array]


def two_point_series(h: float | Array, ends: _State, start: _State) -> Array:
    """Return the cubic accelerations that join (q, v, a) at both ends of a step, shape (4, n)."""
    q0, v0, a0 = start
    q1, v1, a1 = ends
    rhs = np.stack([a0, a1, (v1 - v0) / h, (q1 - q0 - h * v0) / h**2])
    return np.asarray(_two_point_inverse() @ rhs)


AT_ONCE = 4096
"""Times that are read in one go: bounds the memory that takes."""
MOST = 1 << 15
"""Numbers in the series of steps that are read in one go, for the same reason."""
JUMP = 0.5
"""Change of a coordinate between two steps that projection never makes: it goes over to another chart."""
WHOLE = 1.0 - 1e-12
"""Share of a step from which a stretch is all of it."""
RECENT = 64
"""Steps at the end of a trajectory that are kept as they are."""


def _alike(
    steps: Sequence[Segment], keys: Sequence[_Key]
) -> Iterator[tuple[_Key, list[int], Segment]]:
    """Yield steps with equal keys and series as long, as many as are read in one go.

    Each time with their key, their numbers, and as one step whose arrays have an axis for them first.
    """
    groups: dict[tuple[_Key, int], list[int]] = {}
    for k, (key, step) in enumerate(zip(keys, steps, strict=True)):
        groups.setdefault((key, step.series.size), []).append(k)
    for (key, size), found in groups.items():
        for own in (found[some] for some in slices(len(found), MOST // size)):
            fields: list[Any] = [np.array(one) for one in zip(*(steps[k] for k in own), strict=True)]
            t, h, q, v, series = fields
            yield key, own, Segment(t[:, None], h[:, None, None], q[:, None], v[:, None], series)


def _halved(steps: list[Segment], after: Segment) -> list[Segment]:
    """Return one step, right at its ends, in place of two each, of an even number of them.

    Both stay where one of them ends in other coordinates than the next has.
    """
    every, n = [*steps, after], len(after.q)
    t, q, v = (np.array([getattr(step, name) for step in every]) for name in ("t", "q", "v"))
    end, first, last = np.empty((3, len(steps), n))
    for _, own, alike in _alike(steps, [0] * len(steps)):
        end[own] = alike.inside(np.ones(1))[0][:, 0]
        first[own] = (-1.0) ** np.arange(alike.series.shape[1]) @ alike.series
        last[own] = alike.series.sum(axis=1)
    whole = (np.abs(end - q[1:]) <= JUMP).all(axis=1).reshape(-1, 2).all(axis=1)
    h = np.diff(t[::2])
    ends = q[2::2].ravel(), v[2::2].ravel(), last[1::2].ravel()
    starts = q[:-1:2].ravel(), v[:-1:2].ravel(), first[::2].ravel()
    series = two_point_series(np.repeat(h, n), ends, starts).reshape(4, -1, n).swapaxes(0, 1).copy()
    found = list[Segment]()
    for k, joins in enumerate(whole.tolist()):
        both = steps[2 * k : 2 * k + 2]
        found += [both[0]._replace(h=float(h[k]), series=series[k])] if joins else both
    return found


@dataclass(eq=False)
class Trajectory:
    """All kept steps of a run, readable at any time between its start and its end.

    Attributes
    ----------
    t_start, t_end : float
    q, v : ndarray, shape (n,)
        State at ``t_end``.
    segments : list of Segment
    methods : list of str
        Labels of what made the steps, in the order in which they were first used; see `Stepper.label`.
    condensed : bool
        Whether some steps are right at their ends only.
    past : Past
        What forces remember of it once it has ended; until then, nothing but it is followed.
    """

    t_start: float
    t_end: float
    q: Array
    v: Array
    segments: list[Segment] = field(default_factory=list)
    methods: list[str] = field(default_factory=list)
    condensed: bool = False
    past: Past = field(default_factory=Past)

    def at(self, times: Array) -> tuple[Array, Array]:
        """Return (q, v) at sorted times, shape (n_times, n) each."""
        if not self.segments:
            return np.repeat(self.q[None], len(times), 0), np.repeat(self.v[None], len(times), 0)
        starts = np.array([s.t for s in self.segments])
        owner = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, len(starts) - 1)
        q, v = np.empty((len(times), len(self.q))), np.empty((len(times), len(self.q)))
        for some in slices(len(times), AT_ONCE):
            self._read(times[some], owner[some], q[some], v[some])
        return q, v

    def inside(self, some: slice, shares: Array) -> tuple[Array, Array]:
        """Return (q, v) at shares of the length of some steps, shape (n_steps, n_shares, n) each.

        That of the last one is what is kept of it: models may change within it.
        """
        steps, last = self.segments[some], self.segments[-1]
        q = np.empty((len(steps), len(shares), len(self.q)))
        v = np.empty_like(q)
        kept = (self.t_end - last.t) / last.h
        parts = [kept if step is last and kept < WHOLE else 1.0 for step in steps]
        for part, own, alike in _alike(steps, parts):
            q[own], v[own] = alike.inside(part * shares)
        return q, v

    def _read(self, times: Array, owner: IntArray, q: Array, v: Array) -> None:
        """Fill in states at sorted times within the steps that own them: those of steps alike in one go."""
        own = distinct(owner)
        steps, first = [self.segments[k] for k in own.tolist()], np.searchsorted(owner, own)
        counts = np.diff(first, append=len(owner))
        begin, length = (np.repeat([getattr(s, name) for s in steps], counts) for name in ("t", "h"))
        theta = (times - begin) / length
        _, once, twice = legendre(theta, max(len(s.series) for s in steps))
        for count, some, alike in _alike(steps, counts.tolist()):
            rows, m = first[some][:, None] + np.arange(count), alike.series.shape[1]
            q[rows], v[rows] = alike.read(theta[rows], once[rows, :m], twice[rows, :m])

    def part(self, some: slice, t_end: float, q: Array, v: Array) -> Trajectory:
        """Return some of its steps, up to a time and the state (n,) there."""
        steps = self.segments[some]
        begin = steps[0].t if steps else t_end
        return replace(self, t_start=begin, t_end=t_end, q=q, v=v, segments=steps)

    @property
    def names(self) -> list[str]:
        """Names of the methods that made the steps."""
        return list(dict.fromkeys(label.partition(":")[0] for label in self.methods))

    @property
    def numbers(self) -> dict[str, int]:
        """Most stages, or the highest order, of the steps of each method that has several."""
        found: dict[str, int] = {}
        for name, _, number in (label.partition(":") for label in self.methods):
            if number:
                found[name] = max(found.get(name, 0), int(number))
        return found

    @property
    def size(self) -> int:
        """Bytes that the steps take."""
        return sum(s.series.nbytes + s.q.nbytes + s.v.nbytes for s in self.segments)

    def condense(self) -> None:
        """Join neighbouring steps two by two, but for the last: between their ends less is kept of them."""
        self.condensed = True
        steps, count = self.segments, max(0, len(self.segments) - RECENT) // 2 * 2
        parts = slices(count, 2 * max(1, MOST // len(self.q)))
        joined = [step for some in parts for step in _halved(steps[some], steps[some.stop])]
        self.segments = [*joined, *steps[count:]]

    def step_ends(self) -> Array:
        """Return all step boundaries, the start and the end included."""
        return np.array([s.t for s in self.segments] + [self.t_end])


def joined(
    paths: list[tuple[Trajectory, IntArray]], whole: Trajectory, t_end: float
) -> tuple[list[Segment], Array, Array]:
    """Return the steps by which parts that were integrated apart carry a whole on to a time.

    Its steps end wherever one of any part does; within them the parts' polynomials are the same.

    Parameters
    ----------
    paths : list of (Trajectory, ndarray of int)
        Each part with the columns that its state has in the whole; all have reached ``t_end``.
    whole : Trajectory
        What there is already.
    t_end : float

    Returns
    -------
    steps : list of Segment
    q, v : ndarray, shape (n,)
        State at ``t_end``.
    """
    n = sum(len(columns) for _, columns in paths)
    ends = distinct(np.concatenate([path.step_ends() for path, _ in paths]))
    ends = np.concatenate([[whole.t_end], ends[(ends > whole.t_end) & (ends < t_end)], [t_end]])
    q, v = np.empty((len(ends), n)), np.empty((len(ends), n))
    count = max((len(s.series) for path, _ in paths for s in path.segments), default=1)
    series = np.zeros((len(ends) - 1, count, n))
    for path, columns in paths:
        q[:, columns], v[:, columns] = path.at(ends)
        if path.t_end == t_end:
            q[-1, columns], v[-1, columns] = path.q, path.v
        series[:, :, columns] = _cut(path.segments, ends, count)
    steps = [Segment(a, b - a, q[k], v[k], series[k]) for k, (a, b) in enumerate(pairwise(map(float, ends)))]
    return steps, q[-1], v[-1]


def _cut(segments: list[Segment], ends: Array, count: int) -> Array:
    """Return the series of steps over the stretches between ``ends``, shape (n_stretches, count, n)."""
    places, weights = gauss_legendre(count)
    basis, _, _ = legendre(places, count)
    fit = (2.0 * np.arange(count) + 1.0)[:, None] * basis.T * weights
    inside = ends[:-1, None] + np.diff(ends)[:, None] * places
    starts = np.array([step.t for step in segments])
    owner = np.clip(np.searchsorted(starts, ends[:-1], side="right") - 1, 0, len(starts) - 1)
    out = np.zeros((len(inside), count, segments[0].series.shape[1]))
    for k in distinct(owner):
        mine, step = np.flatnonzero(owner == k), segments[k]
        if len(mine) == 1 and ends[mine[0]] == step.t and ends[mine[0] + 1] >= step.t + step.h * WHOLE:
            out[mine[0], : len(step.series)] = step.series
            continue
        values, _, _ = legendre((inside[mine].ravel() - step.t) / step.h, len(step.series))
        out[mine] = fit @ (values @ step.series).reshape(len(mine), count, -1)
    return out
