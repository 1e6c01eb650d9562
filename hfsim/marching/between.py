"""Channels between the output times, read from the steps: what curves are drawn through."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from hfsim.integrators import Trajectory
from hfsim.marching.integration import Leg
from hfsim.marching.sampling import samples_at, table_of
from hfsim.marching.solution import Channel
from hfsim.maths.arrays import Array, BoolArray, distinct
from hfsim.maths.frozen import frozen

ENOUGH = 1200
"""Times that make a smooth curve where there are few steps; of many steps, all ends are shown."""
MOST = 4000
"""Times between those of the output at most."""
MOST_NUMBERS = 4e5
"""Coordinates of all these states at most: large scenes have fewer of them."""
INSIDE = 16
"""Times in one of few steps at most."""
STAGES = 2
"""Times in one long step among many at most, over the number of its polynomials."""
VISIBLE, ROUNDING = 5e-4, 1e-7
"""Part of its range by which a curve may be missed unseen; what changes by less of its size is rounding."""


@frozen
class Between:
    """The rows of a run with others between them.

    Attributes
    ----------
    legs : sequence of Leg
        Their steps; those from before a run was put down are gone, and its rows stand alone there.
    t : ndarray, shape (n_rows,)
        Output times [s].
    channels : tuple of Channel
        At the output times.
    """

    legs: Sequence[Leg]
    t: Array
    channels: tuple[Channel, ...]

    @cached_property
    def curves(self) -> tuple[Array, tuple[Channel, ...]]:
        """Times [s] in order, the output's among them, and the channels there."""
        table, between = self._rough
        if between:
            bent = bends(table, [channel.unit for channel in self.channels])
            table = self._with(table, [_within(one, table[:, 0], bent) for one in between])
        return self._columns(table)

    @cached_property
    def _rough(self) -> tuple[Array, list[Array]]:
        """Every second row of the curves, and the times of each leg between these."""
        rows = np.column_stack([self.t, *(channel.values for channel in self.channels)])
        if len(rows) < 2:
            return rows, []
        times = [self._times(leg) for leg in self.legs]
        return self._with(rows, [one[::2] for one in times]), [one[1::2] for one in times]

    def _columns(self, table: Array) -> tuple[Array, tuple[Channel, ...]]:
        columns = np.ascontiguousarray(table.T)
        named = zip(self.channels, columns[1:], strict=True)
        return columns[0], tuple(channel._replace(values=values) for channel, values in named)

    def _times(self, leg: Leg) -> Array:
        room = int(min(MOST, MOST_NUMBERS / max(1, leg.scene.system.n)))
        return times_between(leg.done.trajectory, self.t, room)

    def _with(self, table: Array, times: Sequence[Array]) -> Array:
        """Return a table in order of time with rows at more times of each leg."""
        wanted = [pair for pair in zip(self.legs, times, strict=True) if len(pair[1])]
        table = np.concatenate([table, *(_read(leg, own) for leg, own in wanted)])
        table = table[np.isfinite(table).all(axis=1)]
        _, first = np.unique(table[:, 0], return_index=True)  # of one time, the row of the output
        return np.asarray(table[first])


def bends(table: Array, units: Sequence[str]) -> BoolArray:
    """Return between which rows of a table, times and channels, a straight line may be seen to miss a curve.

    What is constant, but for rounding beside its value or beside others of its unit, needs no more rows.
    """
    t, values = table[:, 0], table[:, 1:]
    ranges, size = np.ptp(values, axis=0), np.abs(values).max(axis=0)
    largest = dict.fromkeys(units, 0.0)
    for unit, one in zip(units, ranges.tolist(), strict=True):
        largest[unit] = max(largest[unit], one)
    beside = np.array([largest[unit] for unit in units])
    told = (ranges > ROUNDING * size) & (ranges > ROUNDING * beside)
    part = ((t[1:-1] - t[:-2]) / (t[2:] - t[:-2]))[:, None]
    straight = (1.0 - part) * values[:-2] + part * values[2:]
    # a line over half the time misses a quarter
    missed = (np.abs(values[1:-1] - straight) > 4.0 * VISIBLE * ranges)[:, told].any(axis=1)
    bent = np.zeros(len(t) - 1, dtype=bool)
    bent[:-1] |= missed
    bent[1:] |= missed
    return bent


def _within(times: Array, ends: Array, chosen: BoolArray) -> Array:
    """Return those times that are in chosen intervals."""
    return times[chosen[np.clip(np.searchsorted(ends, times) - 1, 0, len(chosen) - 1)]]


def _read(leg: Leg, times: Array) -> Array:
    """Return rows, times [s] and channels, read from the steps at sorted times."""
    with np.errstate(all="ignore"):
        return table_of(samples_at(leg.scene, leg.done.trajectory, times, leg.record.begin_angles))


def times_between(path: Trajectory, rows: Array, room: int) -> Array:
    """Return times in a trajectory at which curves are drawn beside its rows, in order.

    Parameters
    ----------
    rows : ndarray, shape (n_rows,)
        Output times; none is after the last.
    room : int
        How many there may be.
    """
    ends = path.step_ends()
    ends = ends[ends <= rows[-1]]
    count = len(ends) - 1
    if count < 1:
        return np.empty(0)
    each = 1 if path.condensed else min(INSIDE, max(1, -(-ENOUGH // count)))
    here = rows[(rows >= ends[0]) & (rows <= ends[-1])]
    if len(here) >= count * each:
        return np.empty(0)
    every = _spread(path, ends, each)
    kept = distinct(np.linspace(0, len(every) - 1, min(room, len(every))).round().astype(int))
    times: Array = every[kept]
    return times[~np.isin(times, rows)]


def _spread(path: Trajectory, ends: Array, each: int) -> Array:
    """Return times in steps between ``ends``: as many in each, more in long ones that turn often inside."""
    steps = np.diff(ends)
    counts = np.full(len(steps), each)
    if not path.condensed:
        most = STAGES * np.array([len(one.series) for one in path.segments[: len(steps)]])
        counts = np.maximum(counts, np.minimum(most, np.ceil(ENOUGH * steps / steps.sum()))).astype(int)
    own = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.asarray(np.repeat(ends[:-1], counts) + np.repeat(steps / counts, counts) * own)
