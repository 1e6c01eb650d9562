"""Gauss and Radau IIA collocation with all stages in one call.

The unknowns are the accelerations a at the stages; stage states follow as

    v_i = v + h sum_j A_ij a_j,   q_i = q + c_i h v + h^2 sum_j (A A)_ij a_j .

They are found by simplified Newton iteration with one derivative J of the accelerations for all
stages, in coordinates where it changes little (`Increments`); what is left of the equations is read in
each stage's own geometry.  J is taken apart into modes once and kept for some steps; with A turned into
complex pairs (Butcher's transformation), a correction is then a few products and one division per mode
and stage, for any step length.  The first guess lets every mode swing from the initial state as it would
alone: extrapolated stages would put the fast modes anywhere, and the iteration would not converge at
large steps.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pkgutil import resolve_name
from typing import Any, ClassVar, NamedTuple

import numpy as np

from hfsim.integrators._base import Attempt, Integrator, Options, Stability, Stepper, relative, unsolved
from hfsim.integrators._derivative import Stages, Start, Strained
from hfsim.integrators._problem import Increments, Problem
from hfsim.integrators._tableau import Collocation, gauss, radau
from hfsim.integrators.derivative import derivative, taken_again
from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen

STAGEWISE = "hfsim.integrators._stagewise.StagewiseStepper"
"""What makes the steps where slopes pay: imported, only then, from what it is built on."""
MAX_ITERATIONS = 20
SERVES_WELL = 5
"""Iterations in a step up to which its derivative is kept for one more."""
LINEAR = 1e-3
"""Natural increments below which their linear map to the state is good enough."""
GOAL = 3e-4
"""Part of the tolerance that an unfinished iteration may take."""
SAME = 1e-5
"""Natural increments after which the geometry need not be computed anew."""
ROUNDING = 1e-10
"""Corrections, relative to the largest coordinate, that may be rounding when they do not shrink any more: in
fine meshes the stiffest modes amplify it so far."""
LAST_DIGIT = 4e-16
"""Corrections, relative to the largest coordinate, that are rounding."""
TARGET = 0.4
"""Error at which steps are aimed, over the tolerance."""
TAIL = 0.25
"""Part of the last terms of the Legendre series that is an error of the positions, as measured."""
SERVES = 2
"""Steps for which a derivative is kept at most."""
SHRUNK = 0.7
"""By how much a step is shortened whose equations could not be solved."""
REGROWTH = 1.1
"""By how much a step may be longer than the last one after such a failure."""
GROWTH = ((3, 4.0), (5, 1.4), (8, 1.25), (11, 1.0), (MAX_ITERATIONS, 0.85))
"""Iterations in a step, and how much longer the next one may then be."""
STIFF = 2.0
"""Angle by which the fastest mode turns from stage to stage from which natural coordinates pay."""


class Damping(NamedTuple):
    """The method for steps so long that the fastest modes are not resolved.

    What a step makes of them would stay for ever in a method that keeps the energy.
    """

    name: str
    table: Callable[[], Collocation]


@frozen
class CollocationMethod:
    """A collocation method whose steps follow the decay of the Legendre series of the positions.

    Attributes
    ----------
    name : str
    table : Collocation
    tolerance : float
        Local error per step: metre, radian or slope, relative above 1.
    damping : Damping, optional
        Taken instead in natural coordinates.
    stagewise : callable, optional
        Gives the table taken instead where slopes pay at every stage.
    """

    name: str
    table: Collocation
    tolerance: float
    damping: Damping | None = None
    stagewise: Callable[[], Collocation] | None = None

    @property
    def stages(self) -> int:
        """Number of stages."""
        return self.table.stages

    def start(self, problem: Problem, t: float, q: Array, v: Array) -> CollocationStepper:
        """Return what makes the steps from an initial state."""
        if problem.slopes is not None and problem.slopes.pays:
            stepper: CollocationStepper = resolve_name(STAGEWISE)(self, problem, t, q, v)
            return stepper
        return CollocationStepper(self, problem, t, q, v)


class CollocationStepper(Stepper):
    """Collocation at work.

    Attributes
    ----------
    name : str
        Of the method of the steps, that for damping included.
    table : Collocation
        Of the same.
    growths : tuple of (int, float)
        Iterations in a step, and how much longer the next one may then be.
    first : float
        The time in which the fastest mode turns by one radian a stage.
    """

    @property
    def label(self) -> str:
        """Name and number of stages of its steps now."""
        return f"{self.name}:{self.table.stages}"

    growths: ClassVar[tuple[tuple[int, float], ...]] = GROWTH
    remembers: ClassVar[tuple[str, ...]] = ("_stiff", "_old", "_served", "_cap", "_known_at", "_known")

    def __init__(self, method: CollocationMethod, problem: Problem, t: float, q: Array, v: Array) -> None:
        self._method, self._problem, self._tolerance = method, problem, method.tolerance
        self.name, self.table, self._stiff = method.name, method.table, False
        self._derivative = derivative(problem, t, q, v)
        self._old, self._served, self._iterations = False, 0, 0
        self._cap = np.inf
        self._known_at, self._known = np.nan, q
        self._expected: Array | None = None
        """Strains at the stages to which the first guess leads if these go along with it."""
        self.first = min(self.table.stages / max(self._derivative.fastest, 1e-3), 1e3)

    def attempt(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        """Solve the stage equations for one step and estimate its error."""
        a0 = self._start_acceleration(t, q, v)
        a = self._guess(q, v, a0, h)
        if self._old and self._renew_inside(t, q, v, h, a):
            a = self._guess(q, v, a0, h)
        solved = self._solve(t, q, v, h, a)
        if solved is None:
            self._cap = SHRUNK * h
            self._renew(t, q, v, SHRUNK * h)
            return unsolved(SHRUNK)
        a, table = solved, self.table
        self._last = a[-1]
        error = self._error(a, q, h)
        return Attempt(
            error=error,
            growth=self._growth(error, h),
            q=q + h * v + h * h * (table.b2 @ a),
            v=v + h * (table.b @ a),
            series=table.to_legendre @ a,
        )

    def accept(self, t: float, q: Array, v: Array) -> None:
        """Ask for a new derivative every other step, or at once if it served badly.

        A step length that once failed comes back slowly.
        """
        self._served += 1
        self._old = self._served >= SERVES or self._iterations > SERVES_WELL
        self._cap *= REGROWTH
        if self.table.nodes[-1] == 1.0:
            self._known_at, self._known = t, self._last

    def memory(self) -> dict[str, Any]:
        """Return where the derivative was taken, how it serves, and the accelerations known at the end."""
        return super().memory() | {"taken": self._derivative.taken}

    def recall(self, memory: Mapping[str, Any]) -> None:
        """Take the same derivative again."""
        super().recall(memory)
        self._choose()
        self._derivative = taken_again(self._problem, memory["taken"], self._natural)

    def _start_acceleration(self, t: float, q: Array, v: Array) -> Array:
        """Return the accelerations at the start of a step, known if the last one had a stage at its end."""
        if self._known_at != t:
            self._known_at, self._known = t, self._problem.single(t, q, v)
        return self._known

    def _error(self, a: Array, q: Array, h: float) -> float:
        """Return the size of the last terms in the Legendre series of the positions, over the tolerance.

        Those of the velocities count where they reach farther than the step.
        """
        table = self.table
        error = relative(h * h * self._tail(table.A2, a), q, self._tolerance)
        if not self.reach:
            return error
        return max(error, relative(h * self.reach * self._tail(table.A, a), q, self._tolerance))

    def _tail(self, integrated: Array, a: Array) -> Array:
        """Return the size of the last terms of what stage accelerations become when they are integrated."""
        return np.asarray(TAIL * np.abs(self.table.to_legendre[-2:] @ (integrated @ a)).max(axis=0))

    def _growth(self, error: float, h: float) -> float:
        """Return the factor on the step: long steps with some more iterations cost less."""
        growth = float((TARGET / max(error, 1e-30)) ** (1.0 / (self.table.stages + 1)))
        if error > 1.0:
            return growth
        most = next(factor for iterations, factor in self.growths if self._iterations <= iterations)
        return min(growth, most, self._cap / h)

    def _guess(self, q: Array, v: Array, a0: Array, h: float) -> Array:
        """Return stage accelerations of modes that swing freely from the start of the step."""
        natural, table = self._derivative.increments, self.table
        at = natural.geometry(q[None])
        rates = (rate[0] for rate in natural.rates(at, v[None], a0[None]))
        y = self._derivative.free_motion(table, Start(at, a0, *rates), h)
        moved = natural.advance(at, y)
        if self._problem.strains is not None:
            self._expected = self._problem.strains.seen(q[None]) + self._derivative.strain_changes(y)
        return np.asarray(table.A2_inverse @ (moved - (h * table.nodes)[:, None] * v) / h**2)

    def _renew_inside(self, t: float, q: Array, v: Array, h: float, a: Array) -> bool:
        """Compute the derivative anew at the stage in the middle; return whether the method has changed."""
        table, middle = self.table, self.table.stages // 2
        tau = h * table.nodes[middle]
        q, v = q + tau * v + h * h * (table.A2[middle] @ a), v + h * (table.A[middle] @ a)
        self._renew(t + tau, q, v, h, None if self._expected is None else self._expected[middle])
        return self.table is not table

    def _renew(self, t: float, q: Array, v: Array, h: float, expected: Array | None = None) -> None:
        """Compute the derivative anew, in natural coordinates if the step is long for its fastest mode."""
        self._stiff = bool(h * self._derivative.fastest > STIFF * self.table.stages)
        self._choose()
        self._derivative = derivative(self._problem, t, q, v, self._natural, expected)
        self._old, self._served = False, 0

    def _choose(self) -> None:
        """Take the method for damping in stiff steps and the other one else."""
        if (damping := self._method.damping) is not None:
            self.name = damping.name if self._stiff else self._method.name
            self.table = damping.table() if self._stiff else self._method.table

    @property
    def _natural(self) -> Increments | None:
        return self._problem.increments if self._stiff else None

    def _solve(self, t: float, q: Array, v: Array, h: float, a: Array) -> Array | None:
        """Return the stage accelerations, or None if the iteration does not converge."""
        table, problem, natural = self.table, self._problem, self._derivative.increments
        times, uniform = t + h * table.nodes, q + (h * table.nodes)[:, None] * v
        scaled = np.concatenate([h * h * table.A2, h * table.A])
        back, s = table.A2_inverse / h**2, table.stages
        A2 = scaled[:s]
        correct, residual = self._derivative.correction(table, h), self._derivative.residual
        ending, size = Ending(q, self._tolerance), np.inf
        strains, strained = problem.strains if self._stiff else None, None
        expected = self._expected
        for k in range(MAX_ITERATIONS):
            moved = scaled @ a
            Q = uniform + moved[:s]
            if size > SAME:
                at = natural.geometry(Q)
            if strains is not None and expected is not None:
                strained = Strained(strains.seen(Q), expected)
            # each stage is read in its own geometry before they are summed
            r = residual(problem, Stages(at, times, Q, v + moved[s:], a, strained))
            y, change = correct(A2 @ r)
            if strained is not None:
                expected = strained.seen + self._derivative.strain_changes(y)
            size = float(np.abs(y).max())
            a = a + back @ (natural.from_natural if size < LINEAR else natural.advance)(at, y)
            problem.counts.iterations += 1
            self._iterations = k + 1
            converged = ending.after(k, change, size)
            if converged is not None:
                return a if converged and np.isfinite(a).all() else None
        return None


class Ending:
    """Tells when an iteration need not, or cannot, go on."""

    def __init__(self, q: Array, tolerance: float) -> None:
        self._scale = 1.0 + float(np.abs(q).max())
        self._goal = GOAL * tolerance * self._scale
        self._before = self._last = self._rate = np.inf

    def after(self, k: int, change: float, size: float) -> bool | None:
        """Return whether the iteration has converged after correction k; None: go on.

        Parameters
        ----------
        k : int
        change : float
            Size of the correction's consequence.
        size : float
            Size of the correction.
        """
        ratio, goal = change / self._last, self._goal
        self._rate = rate = ratio if k <= 1 else max(ratio, 0.5 * self._rate)
        settled = k > 0 and rate < 1.0 and change * max(rate, 0.05) < goal * (1.0 - rate)
        rounding = size < ROUNDING * self._scale and k > 2 and ratio > 0.9
        if change < 0.05 * goal or settled or rounding or size < LAST_DIGIT * self._scale:
            return True
        if not change < 1e3 or (k > 3 and change > 0.8 * self._before):
            return False
        self._before, self._last = self._last, change
        return None


GAUSS_STAGES = 20
"""Stages of `gauss` by default: fewer make steps shorter and save no iterations, even at loose tolerances."""
IN_SPACE = (3e-5, 12)
"""In space, where arithmetic costs as much as calls do: tolerance above which `auto` makes do with fewer."""
STAGEWISE_STAGES = 10
"""Stages of `gauss` by default where each has its own derivative: the matrix of a step grows with them."""
LOOSE = 3e-4
"""Tolerance above which radau makes do with fewer stages."""


def unresolving_stages(tolerance: float) -> int:
    """Return the number of stages for steps that do not resolve the fastest modes.

    Examples
    --------
    >>> [unresolving_stages(tolerance) for tolerance in (1e-3, 1e-4, 1e-8)]
    [16, 20, 24]
    """
    return 16 if tolerance > LOOSE else 20 if tolerance > 1e-5 else 24


def _gauss(solve: Options, damping: Damping | None = None, stages: int = GAUSS_STAGES) -> CollocationMethod:
    few = None if solve.stages else partial(gauss, STAGEWISE_STAGES)
    return CollocationMethod("gauss", gauss(solve.stages or stages), solve.tolerance, damping, few)


def _radau(solve: Options) -> CollocationMethod:
    stages = solve.stages or (6 if solve.tolerance > LOOSE else 10)
    return CollocationMethod("radau", radau(stages), solve.tolerance)


def automatic(solve: Options, dissipates: bool, spatial: bool = False) -> CollocationMethod:
    """Return what stands for ``auto``; see `hfsim.integrators.choose`."""
    if dissipates:
        return _radau(solve)
    damping = Damping("radau", partial(radau, solve.stages or unresolving_stages(solve.tolerance)))
    return _gauss(solve, damping, IN_SPACE[1] if spatial and solve.tolerance > IN_SPACE[0] else GAUSS_STAGES)


GAUSS = Integrator(_gauss, Stability("A-stable, |R(iwh)| = 1"), rank=4, rescue=2)
RADAU = Integrator(_radau, Stability("L-stable, |R(iwh)| < 1"), rank=3, rescue=1)
