"""Simplified Newton iteration for one state, with a derivative that serves as long as it can."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import numpy as np

from hfsim.integrators._derivative import ByStep, Derivative
from hfsim.integrators._problem import Problem
from hfsim.integrators.derivative import derivative, taken_again
from hfsim.maths.arrays import Array

SLOW = 0.9
"""Size of a correction over that of the one before, from which an iteration is given up."""

_Found = TypeVar("_Found")
_Solver = Callable[[Array], Array]
_Place = tuple[float, Array, Array]

Correct = Callable[[Array, float, Array, Array], Array]
"""From a residual (n,), and t, q, v that it is the residual of, to the correction (n,)."""


class Newton:
    """The derivative of a problem's accelerations, kept from step to step.

    Attributes
    ----------
    problem : Problem
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self._derivative: Derivative | None = None
        self._solver: ByStep[_Solver] = ByStep()
        self._by = 0.0, 0.0
        self._by_slopes = problem.slopes is not None and problem.slopes.pays
        # stresses of iterates are those of no state where strains are variables
        self._by_iterates = problem.slopes is not None or problem.strains is None
        self._hard = np.inf
        """Least ``by_v`` for which no derivative of the start of a step served."""

    def memory(self) -> dict[str, Any]:
        """Return where the derivative was taken, and for which corrections it was factorised last."""
        found = self._derivative
        taken, ways = (np.zeros(0), ()) if found is None else (found.taken, found.ways)
        return {"taken": taken, "ways": ways, "by": np.array(self._by), "hard": np.array(self._hard)}

    def recall(self, memory: Mapping[str, Any]) -> None:
        """Take the same derivative again and factorise it."""
        self._hard = float(memory["hard"])
        if memory["taken"].size:
            with self.problem.often.supposed(memory["ways"]):
                self._derivative = taken_again(self.problem, memory["taken"], self._by_slopes)
            self._solver_for(*memory["by"].tolist())

    def solution(
        self, at: _Place, by_q: float, by_v: float, iterate: Callable[[Correct], _Found | None]
    ) -> _Found | None:
        """Return what an iteration finds; it has a second chance with a new derivative.

        A third one takes it anew for each correction, unless stresses would be those of iterates.

        Parameters
        ----------
        at : (t, q, v)
            Where a new derivative is taken.
        by_q, by_v : float
            Corrections solve with I - by_q J_q - by_v J_v.
        iterate : callable
            `Correct` -> solution; None if it does not converge.
        """
        if by_v < self._hard:
            found = self._with_one(at, by_q, by_v, iterate)
            if found is not None or not self._by_iterates:
                return found
            self._hard = by_v
        self._derivative = None
        return iterate(lambda r, *place: self._derivative_at(place, True).solver(by_q, by_v)(r))

    def _with_one(
        self, at: _Place, by_q: float, by_v: float, iterate: Callable[[Correct], _Found | None]
    ) -> _Found | None:
        for fresh in (self._derivative is None, True):
            if fresh:
                self._derivative, self._solver = self._derivative_at(at, self._by_slopes), ByStep()
            solve = self._solver_for(by_q, by_v)
            found = iterate(lambda r, *_, solve=solve: solve(r))
            if found is not None:
                return found
            if fresh:
                break
        self._derivative = None
        return None

    def _derivative_at(self, place: _Place, by_slopes: bool) -> Derivative:
        return derivative(self.problem, *place, with_inertia=by_slopes)

    def _solver_for(self, by_q: float, by_v: float) -> _Solver:
        self._by = by_q, by_v
        return self._solver.of(by_v, lambda: self._factorised(by_q, by_v))

    def _factorised(self, by_q: float, by_v: float) -> _Solver:
        assert self._derivative is not None
        self.problem.counts.factorisations += 1
        return self._derivative.solver(by_q, by_v)

    def converges(self, correct: Callable[[], float], goal: float, most: int, patience: int) -> bool:
        """Make corrections until what is left of them is small.

        Parameters
        ----------
        correct : callable
            Makes a correction and returns its size.
        goal : float
            Size of what may be left.
        most : int
            Corrections.
        patience : int
            Corrections after the first that need not shrink.
        """
        last = np.inf
        for k in range(most):
            change = correct()
            self.problem.counts.iterations += 1
            rate = change / last
            if not np.isfinite(change) or (k > patience and rate > SLOW):
                return False
            if change < 1e-2 * goal or (k > 0 and rate < 1.0 and change * rate / (1.0 - rate) < goal):
                return True
            last = change
        return False
