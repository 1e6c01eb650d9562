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

    def memory(self) -> dict[str, Array]:
        """Return where the derivative was taken, and for which corrections it was factorised last."""
        taken = np.zeros(0) if self._derivative is None else self._derivative.taken
        return {"taken": taken, "by": np.array(self._by)}

    def recall(self, memory: Mapping[str, Any]) -> None:
        """Take the same derivative again and factorise it."""
        if memory["taken"].size:
            self._derivative = taken_again(self.problem, memory["taken"])
            self._solver_for(*memory["by"].tolist())

    def solution(
        self,
        at: tuple[float, Array, Array],
        by_q: float,
        by_v: float,
        iterate: Callable[[_Solver], _Found | None],
    ) -> _Found | None:
        """Return what an iteration finds; it has a second chance with a new derivative.

        Parameters
        ----------
        at : (t, q, v)
            Where a new derivative is taken.
        by_q, by_v : float
            Corrections solve with I - by_q J_q - by_v J_v.
        iterate : callable
            Map from residuals to corrections -> solution; None if it does not converge.
        """
        for fresh in (self._derivative is None, True):
            if fresh:
                self._derivative, self._solver = derivative(self.problem, *at), ByStep()
            found = iterate(self._solver_for(by_q, by_v))
            if found is not None:
                return found
            if fresh:
                break
        self._derivative = None
        return None

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
            if change < 1e-2 * goal or (k > 0 and change * rate / (1.0 - rate) < goal):
                return True
            last = change
        return False
