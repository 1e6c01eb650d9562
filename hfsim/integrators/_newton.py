"""Newton iteration for the accelerations at the end of a step; its derivative serves as long as it can."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from hfsim.integrators._base import Stepper
from hfsim.integrators._derivative import ByStep, Derivative
from hfsim.integrators._lengths import REGROWTH, SHRUNK
from hfsim.integrators._problem import PlainIncrements, Problem
from hfsim.integrators.derivative import computed, derivative, taken_again
from hfsim.maths.arrays import Array
from hfsim.maths.traced import Recording

SLOW = 0.9
"""Size of a correction over that of the one before, from which an iteration is given up."""
OF_ITS_OWN = 2
"""Corrections after the first that need not shrink where each has a derivative of its own: the second one
takes back the strains that the first one left, and what comes after that is small at once."""

_Solver = Callable[[Array], Array]
_Place = tuple[float, Array, Array]
_Corrected = tuple[Array, Array]


class Implicit(NamedTuple):
    """The equations a = f(t, q + by_q a, v + by_v a) of accelerations (n,)."""

    t: float
    q: Array
    v: Array
    by_q: float
    by_v: float

    def state(self, a: Array) -> tuple[Array, Array]:
        """Return the state that accelerations lead to."""
        return self.q + self.by_q * a, self.v + self.by_v * a


class Newton:
    """The derivative of a problem's accelerations, kept from step to step.

    Parameters
    ----------
    problem : Problem
    most : int
        Corrections of an iteration.
    patience : int
        Corrections after the first that need not shrink.
    listens : bool
        Whether `ringing` is wanted: it may take as long as the derivative.

    Attributes
    ----------
    ringing : ndarray
        Circular frequencies of what is not damped well in the last derivative of the start of a step [rad/s].
    """

    def __init__(self, problem: Problem, most: int, patience: int, listens: bool = False) -> None:
        self._problem, self._most, self._patience, self._listens = problem, most, patience, listens
        self._derivative: Derivative | None = None
        self._solver: ByStep[_Solver | Array] = ByStep()
        self._by = 0.0, 0.0
        self._by_slopes = problem.slopes is not None and problem.slopes.pays
        self.ringing: Array = np.zeros(0)
        self._cap = np.inf
        """Largest ``by_v`` for now: one that once failed comes back slowly."""
        self._hard = np.inf
        """Least ``by_v`` for which no derivative of the start of a step served."""

    def memory(self) -> dict[str, Any]:
        """Return where the derivative was taken, and for which corrections it was factorised last."""
        found = self._derivative
        taken, ways = (np.zeros(0), ()) if found is None else (found.taken, found.ways)
        kept = {"by": np.array(self._by), "cap": self._cap, "hard": self._hard, "ringing": self.ringing}
        return {"taken": taken, "ways": ways} | kept

    def recall(self, memory: Mapping[str, Any]) -> None:
        """Take the same derivative again and factorise it."""
        self._cap, self._hard, self.ringing = memory["cap"], memory["hard"], memory["ringing"]
        if memory["taken"].size:
            with self._problem.often.supposed(memory["ways"]):
                self._derivative = taken_again(self._problem, memory["taken"], self._by_slopes)
            self._solver_for(*memory["by"].tolist())

    def solution(self, at: _Place, equations: Implicit, a: Array, weights: Array) -> Array | None:
        """Return what an iteration finds, None if it does not converge; it has a second chance.

        That is with a new derivative.  A third one takes it anew for each correction.

        Parameters
        ----------
        at : (t, q, v)
            Where a new derivative is taken.
        equations : Implicit
        a : ndarray, shape (n,)
            First guess.
        weights : ndarray, shape (n,)
            One over the change of an acceleration that need not be corrected.
        """
        found = None
        if equations.by_v < self._hard:
            found = self._with_one(at, equations, a, weights)
        if found is None:
            self._hard, self._derivative = min(self._hard, equations.by_v), None
            found = self._iterated(equations, a, weights)
        self._cap = SHRUNK * equations.by_v if found is None else REGROWTH * self._cap
        return found

    def renew(self) -> None:
        """Take a new derivative next time."""
        self._derivative = None

    def room(self, by_v: float) -> float:
        """Return the factor on steps up to which an iteration may be hoped to converge."""
        return self._cap / by_v

    def _with_one(self, at: _Place, equations: Implicit, a: Array, weights: Array) -> Array | None:
        for fresh in (self._derivative is None, True):
            if fresh:
                self._derivative = derivative(self._problem, *at, with_inertia=self._by_slopes)
                self._solver = ByStep()
                if self._listens:
                    self.ringing = self._derivative.ringing()
            solver = self._solver_for(equations.by_q, equations.by_v)
            found = self._iterated(equations, a, weights, solver)
            if found is not None:
                return found
            if fresh:
                break
        self._derivative = None
        return None

    def _solver_for(self, by_q: float, by_v: float) -> _Solver | Array:
        self._by = by_q, by_v
        return self._solver.of(by_v, lambda: self._factorised(by_q, by_v))

    def _factorised(self, by_q: float, by_v: float) -> _Solver | Array:
        """Return the inverse where it is a matrix, and what solves the equations else."""
        found = self._derivative
        assert found is not None
        self._problem.counts.factorisations += 1
        return found.inverse(by_q, by_v) if found.recordable else found.solver(by_q, by_v)

    def _iterated(
        self, equations: Implicit, a: Array, weights: Array, solver: _Solver | Array | None = None
    ) -> Array | None:
        """Return what corrections with one solver lead to, or, without any, with one of each iterate."""
        counts, often = self._problem.counts, self._problem.often

        def correct() -> float:
            nonlocal a
            self._problem.count(equations.q[None])
            if isinstance(solver, np.ndarray):
                given = (*equations, a, weights, solver)
                a, size = often.call("correction", self._corrected, given)
            elif solver is None:
                counts.factorisations += 1
                a, size = often.call("correction of its own", self._corrected_anew, (*equations, a, weights))
            else:
                a, size = _added(a, weights, solver(self._missing(equations, a)))
            return float(size)

        patience = max(self._patience, OF_ITS_OWN) if solver is None else self._patience
        return a if self.converges(correct, patience) else None

    def _missing(self, equations: Implicit, a: Array) -> Array:
        return self._problem.at(equations.t, *equations.state(a)) - a

    def _corrected(
        self, t: Any, q: Array, v: Array, by_q: Any, by_v: Any, a: Array, weights: Array, inverse: Array
    ) -> _Corrected:
        missing = self._missing(Implicit(t, q, v, by_q, by_v), a)
        return _added(a, weights, inverse @ missing)

    def _corrected_anew(
        self, t: Any, q: Array, v: Array, by_q: Any, by_v: Any, a: Array, weights: Array
    ) -> _Corrected:
        equations = Implicit(t, q, v, by_q, by_v)
        here = computed(self._problem, PlainIncrements(), True, t, *equations.state(a), None, once=True)
        if Recording.tape is None:
            here.check()
        return _added(a, weights, here.solver(by_q, by_v)(self._missing(equations, a)))

    def converges(self, correct: Callable[[], float], patience: int) -> bool:
        """Make corrections until what is left of them is small.

        Parameters
        ----------
        correct : callable
            Makes a correction and returns its size; 1 may be left of it.
        patience : int
            Corrections after the first that need not shrink.
        """
        last = np.inf
        for k in range(self._most):
            change = correct()
            self._problem.counts.iterations += 1
            rate = change / last
            if not np.isfinite(change) or (k > patience and rate > SLOW):
                return False
            if change < 1e-2 or (k > 0 and rate < 1.0 and change * rate < 1.0 - rate):
                return True
            last = change
        return False


class NewtonStepper(Stepper):
    """A method whose steps are solved by such iterations."""

    _newton: Newton

    def memory(self) -> dict[str, Any]:
        """Return what it remembers itself, and where the derivative was taken."""
        return super().memory() | self._newton.memory()

    def recall(self, memory: Mapping[str, Any]) -> None:
        """Go on with that and this derivative."""
        super().recall(memory)
        self._newton.recall(memory)


def _added(a: Array, weights: Array, change: Array) -> _Corrected:
    """Return corrected accelerations, and the size of the correction, shape ()."""
    return a + change, np.asarray(np.abs(weights * change).max())
