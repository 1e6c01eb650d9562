"""An explicit step on a tape; it is checked against NumPy before it is used."""

from __future__ import annotations

import numpy as np

from hfsim.integrators._iteration import Place
from hfsim.integrators._marched import Marched
from hfsim.integrators._nystrom import Nystrom, Step
from hfsim.integrators._problem import Problem
from hfsim.integrators._trial import closed, common, looked
from hfsim.maths.arrays import Array
from hfsim.maths.replayed import agree, jittered, shaken
from hfsim.maths.traced import plain

UNKNOWN = np.zeros(0)
"""Accelerations at the start of a step that are not known."""
PARTS = ("stage", "end")
"""What steps are put together from, in the order in which it is recorded."""


class Staged(Marched):
    """Explicit steps as programs on fixed memory.

    Parameters
    ----------
    problem : Problem
        To be evaluated in NumPy.
    table : Nystrom
    place : Place
        A step of this kind.
    known : ndarray, shape (n,) or (0,)
        Accelerations at its start, if they are known.

    Raises
    ------
    UNREADABLE
        If they cannot be recorded.
    """

    def __init__(self, problem: Problem, table: Nystrom, place: Place, known: Array = UNKNOWN) -> None:
        # NumPy goes first: what is kept when it is first asked for must not be made on the tape
        expected = self._in_numpy(problem, table, place, known)
        super().__init__(place)
        self._record(problem, table)

        def near() -> list[Array]:
            other = place._replace(q=jittered(place.q), v=jittered(place.v))
            return common(self._in_numpy(problem, table, other, UNKNOWN), found)

        self.begin(place)
        found = self._tried(table, place)
        agree(common(expected, found), common(found, found), 1.0 + np.abs(place.q).max(), near)

    def _record(self, problem: Problem, table: Nystrom) -> None:
        from hfsim.maths.recording import on_tape

        tape, place = self._tape, self._inputs
        rows, s, n = table.rows, len(table.nodes), len(place.q)
        a, row = (tape.input(np.zeros(shape)) for shape in ((s, n), rows.shape[1]))
        step = Step(problem, table, place)

        def made() -> Array:
            there = step.stage(row, a)
            tape.cut()
            end = step.end(a)
            tape.cut()
            self.follow(problem, end)
            return there

        with np.errstate(all="ignore"):
            there = on_tape(tape, made)
        self.assemble(PARTS, there)
        self.a0, self.a, self.taken_at = np.zeros(n), plain(a), np.zeros(0)
        self._row, self._there = plain(row), plain(there)
        self.make_ready(problem, {"rows": rows, "row": self._row, "found": self._there}, {})

    def _in_numpy(self, problem: Problem, table: Nystrom, place: Place, known: Array) -> list[list[Array]]:
        """Return what a step finds, all of whose stages but the last are like the one before that."""
        step = Step(problem, table, place)
        a = _like(known if len(known) else problem.single(*place[:3]), table)
        a[-1] = step.stage(table.rows[-1], a)
        end, at = step.end(a), (shaken(place.q), shaken(place.v))
        found = _as_lengths(place.h, a, *end[:5])
        return [found, looked(problem, place, end.series, *at), closed(problem, place, *at)]

    def _tried(self, table: Nystrom, place: Place) -> list[list[Array]]:
        """Return the same as it is recorded."""
        self.a[...] = 0.0
        self.a[...] = _like(self._stage(table.rows[0]), table)
        self.a[-1] = self._stage(table.rows[-1])
        end, at = self.end(), (shaken(place.q), shaken(place.v))
        found = _as_lengths(place.h, self.a, *end[:5])
        return [found, self.looked(end.series, *at), self.closed(*at)]

    def _stage(self, row: Array) -> Array:
        self._row[...] = row
        self.run("stage")
        return self._there


def _like(a0: Array, table: Nystrom) -> Array:
    """Return accelerations at the stages that differ a little from those at the start."""
    return np.stack([(1.0 + 1e-3 * k) * a0 for k in range(len(table.nodes))])


def _as_lengths(h: float, *found: Array | float) -> list[Array]:
    units = (h * h, 1.0, h, h * h, 1.0, h)
    return [np.asarray(unit * one) for unit, one in zip(units, found, strict=True)]
