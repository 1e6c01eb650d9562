"""Collocation by full Newton iteration, with the derivative of the accelerations at every stage.

In few coordinates that is cheap, and spinning bodies need it: in a step of some radians no one derivative
serves all stages.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.polynomial.legendre import legvander

from hfsim.integrators._base import Attempt
from hfsim.integrators._ending import Ending
from hfsim.integrators._iteration import Iteration, Place
from hfsim.integrators._problem import Problem
from hfsim.integrators.collocation import CollocationMethod, CollocationStepper
from hfsim.maths.arrays import Array

MAX_ITERATIONS = 9
FAR = 1e2
"""Correction, relative to the largest coordinate, from which an iteration is lost."""


class StagewiseStepper(CollocationStepper):
    """Collocation at work where slopes of the accelerations are cheap."""

    replays = False
    growths = ((3, 3.0), (4, 1.3), (5, 1.0), (MAX_ITERATIONS, 0.85))
    remembers = (*CollocationStepper.remembers, "_course", "_length")

    def __init__(self, method: CollocationMethod, problem: Problem, t: float, q: Array, v: Array) -> None:
        super().__init__(method, problem, t, q, v)
        if method.stagewise is not None:
            self._usual = method.stagewise()
            self._choose(False)
        self._course: Array = np.zeros((0, len(q)))
        self._length = 1.0
        """Of the last step, whose Legendre series of the accelerations is the course."""

    def attempt(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        """Solve the stage equations for one step and estimate its error."""
        found = super().attempt(t, q, v, h)
        self._made = found.series, h
        return found

    def accept(self, t: float, q: Array, v: Array) -> None:
        """Take note of the accelerations in the step."""
        super().accept(t, q, v)
        self._old = False
        self._course, self._length = self._made

    def _guess(self, place: Place) -> Iteration:
        """Return a step with accelerations that go on from the last step, at first those of the start."""
        step = Iteration(self._problem, self._own_derivative(), self.table, place)
        a0 = self._start_acceleration(place)
        if not len(self._course):
            step.a = np.repeat(a0[None], self.table.stages, axis=0)
        else:
            places = 1.0 + 2.0 * place.h / self._length * self.table.nodes
            step.a = np.asarray(legvander(places, len(self._course) - 1) @ self._course)
        return step

    def _renew(self, t: Any, q: Array, v: Array, expected: Array | None, h: float) -> None:
        """Keep the derivative at the start: it takes no part in the steps."""

    def _solve(self, place: Place) -> Iteration | None:
        """Return a step whose stage accelerations either guess leads to."""
        step = self._guess(place)
        found = self._newton(*place, step.a)
        if found is None and len(self._course):
            found = self._newton(*place, np.repeat(self._known[None], self.table.stages, axis=0))
        if found is None:
            return None
        step.a = found
        return step

    def _newton(self, t: float, q: Array, v: Array, h: float, a: Array) -> Array | None:
        problem, counts = self._problem, self._problem.counts
        name = f"correction {self.label} {self.table.longest}"
        ending, far = Ending(q, self._tolerance), FAR * (1.0 + float(np.abs(q).max()))
        for k in range(MAX_ITERATIONS):
            problem.count(a)
            counts.iterations, counts.factorisations = counts.iterations + 1, counts.factorisations + 1
            a, sizes = problem.often.call(name, self._corrected, (t, q, v, h, a))
            self._iterations = k + 1
            change, size = map(float, sizes)
            if not size < far:
                return None
            converged = ending.after(k, change, size)
            if converged is not None:
                return a if converged and np.isfinite(a).all() else None
        return None

    def _corrected(self, t: float, q: Array, v: Array, h: float, a: Array) -> tuple[Array, Array]:
        """Return corrected accelerations, and the sizes of what that changes: the end, and the motion."""
        assert self._problem.slopes is not None
        table, (s, n) = self.table, a.shape
        A2, A = h * h * table.A2, h * table.A
        positions = q + (h * table.nodes)[:, None] * v + A2 @ a
        there, by_q, by_v = self._problem.slopes(t + h * table.nodes, positions, v + A @ a)
        matrix = A2[:, None, :, None] * by_q[:, :, None] + A[:, None, :, None] * by_v[:, :, None]
        matrix = np.eye(s * n) - matrix.reshape(s * n, s * n)
        step = np.linalg.solve(matrix, (there - a).ravel()).reshape(s, n)
        y = A2 @ step
        # what the change of the velocity at the end does as if all motions were slow
        sizes = np.stack([table.slow(h) * np.abs(table.end_rate @ y).max() / h, np.abs(y).max()])
        return a + step, sizes
