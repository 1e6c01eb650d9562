"""A collocation step: its first guess, its Newton iteration and its end.

All that is done with arrays in a step stands here; what it decides, and Python's numbers, stand in
`hfsim.integrators.collocation`.  So a step can be replayed natively (`hfsim.integrators._replayed`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hfsim.integrators._derivative import Derivative, Stages, Start, Strained
from hfsim.integrators._ending import MAX_ITERATIONS, Ending, size_of
from hfsim.integrators._problem import Increments, PlainIncrements, Problem, Project
from hfsim.integrators._tableau import Collocation
from hfsim.maths.arrays import Array

LINEAR = 1e-3
"""Natural increments below which their linear map to the state is good enough."""
STRAY = 30.0
"""Change of accelerations at a stage, over that at any other, from which it goes along with these."""
DIGITS = 1e-15
"""Rounding of places over their size; in very short steps, accelerations found from places are no more."""
TAIL = 0.25
"""Part of the last terms of the Legendre series that is an error of the positions, as measured."""


class Place(NamedTuple):
    """Where a step begins, and its length."""

    t: float
    q: Array
    v: Array
    h: float


class Kind(NamedTuple):
    """What steps have in common that one recording serves."""

    table: Collocation
    natural: bool
    """Whether corrections are made in natural coordinates."""
    strained: bool
    """Whether strains are variables of the iteration."""

    def increments(self, problem: Problem) -> Increments:
        """Return the coordinates of the corrections."""
        return problem.increments if self.natural else PlainIncrements()


class End(NamedTuple):
    """What a step leads to."""

    q: Array
    v: Array
    series: Array
    """Of the accelerations, as in `Segment`."""
    error: Array | float
    """Size of the last terms in the Legendre series of the positions, relative above 1, shape ()."""
    rate_error: Array | float
    """The same of the velocities, in a unit of time."""
    closed: bool = False
    """Whether it was moved onto the constraints."""
    seen: Array | None = None
    """Of angles along the step, as `Turns.looked` returns it, where that is known."""


class Middle(NamedTuple):
    """The stage in the middle of a step, where its derivative is taken."""

    t: Array
    q: Array
    v: Array
    expected: Array | None
    """Strains, (n_strains,), if they are variables."""


class Iteration:
    """A step at work.

    Parameters
    ----------
    problem : Problem
    derivative : Derivative
    table : Collocation
    place : Place
    strained : bool
        Whether strains are variables of the iteration.

    Attributes
    ----------
    derivative : Derivative
        May be replaced when the step has been guessed.
    strained : bool
    a : ndarray, shape (s, n)
        Accelerations at the stages.
    correction_found : ndarray, shape (s, n)
        The last one, in natural increments.
    expected : ndarray, shape (s, n_strains), or None
        Strains to which the guess, or the last correction, leads if these go along with it.
    """

    a: Array
    correction_found: Array
    _q: Array

    def __init__(
        self,
        problem: Problem,
        derivative: Derivative,
        table: Collocation,
        place: Place,
        strained: bool = False,
    ) -> None:
        self.derivative, self.strained = derivative, strained
        self.expected: Array | None = None
        self._problem, self._table, self._place = problem, table, place
        t, q, v, h = place
        times = h * table.nodes
        self._t, self._uniform = t + times, q + times[:, None] * v
        # from accelerations at the stages to displacements and rates, and back
        self._moved, self._rates = h * h * table.A2, h * table.A
        self._back = table.A2_inverse / (h * h)

    def guess(self, a0: Array) -> None:
        """Let modes swing freely from the start of the step, where accelerations are ``a0``.

        They do so while everything turns on, where it turns as one.
        """
        _, q, v, h = self._place
        natural, times, carrying = self.derivative.increments, h * self._table.nodes, self._problem.carrying()
        carried = None if carrying is None else carrying.along(q, v, a0, times)
        at = natural.geometry(q[None])
        v0, a0 = (v, a0) if carried is None else (carried.v, carried.a)
        rates = (rate[0] for rate in natural.rates(at, v0[None], a0[None]))
        start = Start(at, a0, *rates)
        y = self.derivative.free_motion(self._table, start, h)
        if carrying is not None and (steady := carrying.steady) is not None:
            lasting = times[:, None] * (start.first + 0.5 * times[:, None] * start.second)
            y = y + steady * (lasting - y)
        moved = natural.advance(at, y)
        moved = moved if carried is None else carried.moved + carried.seen(moved)
        if self._problem.strains is not None:
            seen = self._problem.strains.seen(q[None])
            self.expected = np.asarray(seen + self.derivative.strain_changes(y))
        a = self._back @ (moved - times[:, None] * v)
        blur = DIGITS * size_of(q) * np.abs(self._back).sum(axis=1).max()
        self.a = np.where(np.abs(a - a0).max() > blur, a, a0)

    def middle(self) -> Middle:
        """Return the stage in the middle as it is guessed."""
        (t, q, v, h), table, k = self._place, self._table, len(self._t) // 2
        tau, expected = h * table.nodes[k], self.expected
        q, v = q + tau * v + h * h * (table.A2[k] @ self.a), v + h * (table.A[k] @ self.a)
        return Middle(np.asarray(t + tau), q, v, None if expected is None else expected[k].copy())

    def reach(self) -> None:
        """Find where the stages are; corrections move them from there."""
        self._q = self._uniform + self._moved @ self.a

    def prepare(self) -> None:
        """Make ready for corrections with the derivative of now."""
        self._correction = self.derivative.correction(self._table, self._place.h)

    def correct(self) -> tuple[Array, Array]:
        """Find a correction in natural increments.

        Returns
        -------
        change, size : ndarray, shape ()
            Size of the correction's consequence, and of the correction.
        """
        problem, strained = self._problem, None
        q, v = self._q, self._place.v + self._rates @ self.a
        self._at: Any = self.derivative.increments.geometry(q)
        if self.strained and self.expected is not None:
            assert problem.strains is not None
            strained = Strained(problem.strains.seen(q), self.expected)
        r = self.derivative.residual(problem, Stages(self._at, self._t, q, v, self.a, strained))
        self.correction_found, change = self._correction(r)
        if strained is not None:
            self.expected = strained.seen + self.derivative.strain_changes(self.correction_found)
        return change, np.abs(self.correction_found).max()

    def advance(self, finite: bool) -> None:
        """Add the correction, as finite increments or as small ones."""
        natural = self.derivative.increments
        add = natural.advance if finite else natural.from_natural
        moved = add(self._at, self.correction_found)
        self._q += moved
        self.a += self._back @ moved

    def solve(self, ending: Ending) -> tuple[bool, int]:
        """Correct until that ends; return whether it converges, and the number of corrections."""
        self.reach()
        self.prepare()
        counts = self._problem.counts
        for k in range(MAX_ITERATIONS):
            change, size = map(float, self.correct())
            self.advance(finite=not size < LINEAR)
            counts.iterations += 1
            converged = ending.after(k, change, size)
            if converged is not None:
                return converged, k + 1
        return False, MAX_ITERATIONS

    def settle(self, project: Project, a0: Array, ending: Ending) -> tuple[bool, int]:
        """Take the accelerations of stages moved onto the constraints until they stay; return as `solve`.

        Where joints are about to lose their rank, accelerations have no derivative to go by: off the
        constraints they change beyond all bounds, along them as smoothly as elsewhere. A stage that meets
        such a position itself goes along with all others.
        """
        problem, v = self._problem, self._place.v
        self.a = np.repeat(a0[None], len(self._t), axis=0)
        for k in range(MAX_ITERATIONS):
            try:
                reached = self._uniform + self._moved @ self.a, v + self._rates @ self.a
                a = self._together(problem.evaluate(self._t, *project(self._t, *reached)))
            except np.linalg.LinAlgError:
                return False, k
            change = float(np.abs(self._moved @ (a - self.a)).max())
            self.a = a
            problem.counts.iterations += 1
            converged = ending.after(k, change, change)
            if converged is not None:
                return converged, k + 1
        return False, MAX_ITERATIONS

    def _together(self, a: Array) -> Array:
        """Return accelerations of stages; one that changes by far the most goes along with the others."""
        changes, last, a = np.abs(a - self.a).max(axis=1), self._table.to_legendre[-1], a.copy()
        k = int(changes.argmax())
        if len(a) > 2 and changes[k] > STRAY * np.delete(changes, k).max():
            a[k] -= last @ a / last[k]
        return a

    def end(self) -> End:
        """Return what the step leads to."""
        (_, q, v, h), table, a = self._place, self._table, self.a
        scale = 1.0 + np.abs(q)
        last = table.to_legendre[-2:]
        errors = (np.abs(last @ (one @ a)).max(axis=0) / scale for one in (table.A2, table.A))
        first, second = (TAIL * one.max() for one in errors)
        return End(
            q + h * v + h * h * (table.b2 @ a),
            v + h * (table.b @ a),
            table.to_legendre @ a,
            np.asarray(h * h * first),
            np.asarray(h * second),
        )
