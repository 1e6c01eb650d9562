r"""Steps that keep the total energy: Hamiltonian boundary value methods HBVM(k, s).

Within a step the motion is a polynomial path of degree s.  Its accelerations are a Legendre series of s
terms whose coefficients are integrals over the path (Brugnano, Iavernaro and Trigiante, J. Numer. Anal.
Ind. Appl. Math. 5 (2010) 17; s = 1: the average vector field method),

    gamma_j = (2 j + 1) \int_0^1 P_j(c) a(t + c h, q(c), q'(c)) dc ,   j < s .

The power of the forces along the path is then the change of the kinetic energy, whatever the step
length, as long as the mass matrix is constant.  The integrals are evaluated at k Gauss points: without
error if the potential is a polynomial of degree four, as that of Green strain with linear curvature, and
k >= 2 s.  With k = s the method is Gauss collocation.

The path is determined by its accelerations at s Gauss points, for which the equations read as those of
`hfsim.integrators.collocation` with the accelerations replaced by those of the series; so do their
solution by simplified Newton iteration and the guess.  Where that does not converge, all derivatives
along the path are taken into a full Newton iteration, and at last the solution is followed from a step
of no length.  All end at round-off only: what is left of the equations is what is lost of the energy.
"""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np

from hfsim.errors import SolverFailure
from hfsim.integrators._base import Attempt, Integrator, Stability, relative
from hfsim.integrators._derivative import Derivative, form
from hfsim.integrators._iteration import LINEAR, End, Iteration, Place
from hfsim.integrators._problem import Increments, Problem
from hfsim.integrators._tableau import gauss, legendre
from hfsim.integrators.collocation import CollocationMethod, CollocationStepper
from hfsim.maths.arrays import Array
from hfsim.maths.replayed import arrays_in, rebuilt
from hfsim.maths.traced import Traced
from hfsim.mechanics.linearized import by_differences

DEFAULT_STAGES = 4
POINTS_OTHERWISE = 16
"""Least number of points along the path where the potential is no polynomial of degree four."""
MAX_ITERATIONS = 40
MAX_NEWTON = 60
SERVES_ON = 0.1
"""Size of the next full Newton correction over that of one, up to which its derivatives serve it too."""
LEAST_SHARE = 1e-3
"""Share of a full Newton correction below which the iteration is given up."""
FIRST_SHARE, LEAST_MORE = 0.25, 5e-3
"""By which shares of its length a step is made longer when its solution is followed."""
NOTHING = 1e-17
PATIENCE = 3
"""Corrections, none smaller than the smallest before, that end an iteration."""
SHRINKING = 0.3
"""Size of a correction over that of the one before, below which the iteration still gets on: the smallest one
may have been so by chance."""
SERVES_WELL = 12
"""Iterations to round-off in a step up to which its derivative is kept for the next."""
ROUNDING = 1e-10
"""Consequences of corrections, relative to the largest coordinate, that may be rounding when they do not
shrink any more."""
RESOLVED = 1e-12
"""Corrections, relative to the largest coordinate, that are rounding when they do not shrink any more,
whatever their consequence: without modes every velocity error is taken for one of a slow motion."""


class Path(NamedTuple):
    """Quadrature along the path of a step that s stage accelerations determine.

    Attributes
    ----------
    nodes : ndarray, shape (k,)
        Places within the step.
    moved, rate : ndarray, shape (k, s)
        From stage accelerations to the displacement beyond uniform motion (over h^2) and to the change
        of the path's velocity (over h): the velocity that the displacement has, of degree s - 1.
    average : ndarray, shape (s, k)
        From accelerations along the path to stage values of their Legendre series of s terms.
    beyond : ndarray, shape (k,)
        From accelerations along the path to the first coefficient that is left out.
    lag : ndarray, shape (k,)
        The Legendre polynomial of degree s: what the velocity has more than that of the path.
    """

    nodes: Array
    moved: Array
    rate: Array
    average: Array
    beyond: Array
    lag: Array


@lru_cache(maxsize=64)
def path(stages: int, points: int) -> Path:
    """Return the quadrature with a number of points that is larger than that of the stages."""
    table, quadrature = gauss(stages), gauss(points)
    values, once, _ = legendre(quadrature.nodes, stages + 1)
    coefficients = (2.0 * np.arange(stages + 1) + 1.0)[:, None] * values.T * quadrature.b
    series = table.to_legendre @ table.A
    return Path(
        nodes=quadrature.nodes,
        moved=once[:, :stages] @ series,
        rate=values[:, :stages] @ series,
        average=legendre(table.nodes, stages)[0] @ coefficients[:stages],
        beyond=coefficients[stages],
        lag=values[:, stages],
    )


class EnergyMethod(CollocationMethod):
    """HBVM(k, s): ``table`` is that of Gauss collocation with s stages."""

    def start(self, problem: Problem, t: float, q: Array, v: Array) -> EnergyStepper:
        """Return what makes the steps from an initial state.

        Raises
        ------
        SolverFailure
            If the mass matrix is not constant: no energy would be kept.
        """
        if not problem.constant_mass:
            raise SolverFailure(
                "method energy needs a constant mass matrix: absolute coordinates, and not model lowOrder",
                t,
                item="solve.method",
                kind="deck",
                remedy="set solve.coordinates: absolute",
            )
        return EnergyStepper(self, problem, t, q, v)


class EnergyStepper(CollocationStepper):
    """HBVM(k, s) at work, with as many points along the path as the energy asks for."""

    replays = False

    def __init__(self, method: EnergyMethod, problem: Problem, t: float, q: Array, v: Array) -> None:
        super().__init__(method, problem, t, q, v)
        least = 2 * method.stages
        self._path = path(method.stages, least if problem.quartic else max(least, POINTS_OTHERWISE))

    def attempt(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        """Solve one step; inside it, not at its end, the first term left out makes the output better."""
        tried = super().attempt(t, q, v, h)
        # one stage alone would end elsewhere: its double integral is not zero
        if not tried.solved or self.table.stages == 1:
            return tried
        more = (self._path.beyond @ self._along)[None]
        return tried._replace(series=np.concatenate([tried.series, more]))

    def accept(self, t: float, q: Array, v: Array) -> None:
        """Ask for a new derivative if the last one served badly."""
        self._old = self._iterations > SERVES_WELL
        self._cap *= 1.05

    def _error(self, place: Place, end: End) -> float:
        """Return what the first term that the series leaves out would move within the step."""
        error = self._moves(place, self._path.beyond @ self._along)
        return max(error, self._unresisted(place, end)) if self._problem.dissipates else error

    def _moves(self, place: Place, coefficient: Array) -> float:
        """Return what a term of degree s in the accelerations moves, over the tolerance."""
        (_, q, _, h), s = place, self.table.stages
        rate = h * coefficient / (2.0 * (2 * s + 1))
        return relative(max(h / (2.0 * (2 * s + 3)), self.reach) * rate, q, self._tolerance)

    def _unresisted(self, place: Place, end: End) -> float:
        """Return what comes of the term that the velocity has more than the path's, over the tolerance.

        Dampers resist the velocity of the path, so no term of the series tells of the rest.  Resisted, that
        would move something else; but no more than it moves by itself, however stiff a damper is.
        """
        (t, q, v, h), s = place, self.table.stages
        lag = h * end.series[s - 1] / (2.0 * (2 * s - 1))
        times, Q, V = self._states(t, q, v, h, self._solution)
        whole = self._problem.evaluate(times, Q, V + self._path.lag[:, None] * lag)
        resisted = self._moves(place, self._path.beyond @ (whole - self._along))
        by_itself = relative(max(h / (2.0 * (2 * s + 1)), self.reach) * lag, q, self._tolerance)
        return min(by_itself, resisted)

    def _growth(self, error: float, h: float) -> float:
        growth = 0.8 * max(error, 1e-30) ** (-1.0 / (self.table.stages + 2))
        return float(growth if error > 1.0 else min(growth, 1.25, self._cap / h))

    def _solve(self, place: Place) -> Iteration | None:
        """Return a step to which any iteration converges."""
        step = self._begun(place)
        a = step.a
        solved = self._simplified(*place, a)
        if solved is None:
            solved = self._newton(*place, a)
        if solved is None:
            solved = self._followed(*place)
        if solved is None:
            return None
        step.a = self._solution = solved
        return step

    def _followed(self, t: float, q: Array, v: Array, h: float) -> Array | None:
        """Follow the solution from a step of no length, where the accelerations are those at the start."""
        a = np.repeat(self._problem.single(t, q, v)[None], self.table.stages, axis=0)
        share, more = 0.0, FIRST_SHARE
        while share < 1.0:
            if more < LEAST_MORE:
                return None
            ahead = min(1.0, share + more)
            found = self._newton(t, q, v, ahead * h, a)
            if found is None:
                more *= 0.5
            else:
                a, share, more = found, ahead, 1.5 * more
        return a

    def _states(self, t: float, q: Array, v: Array, h: float, a: Array) -> tuple[Array, Array, Array]:
        """Return times, positions and velocities at the points along the path."""
        c = self._path.nodes
        Q = q + (h * c)[:, None] * v + h * h * (self._path.moved @ a)
        return t + h * c, Q, v + h * (self._path.rate @ a)

    def _defect(self, t: float, q: Array, v: Array, h: float, a: Array) -> Array:
        """Return what the averaged accelerations are more than the stages'."""
        self._along = self._problem.evaluate(*self._states(t, q, v, h, a))
        self._problem.counts.iterations += 1
        return np.asarray(self._path.average @ self._along - a)

    def _simplified(self, t: float, q: Array, v: Array, h: float, a: Array) -> Array | None:
        derivative, problem, ending = self._own_derivative(), self._problem, _Stagnation(q)
        known = tuple([one for _, one in arrays_in(derivative)])
        name = f"correction of {self.label} with {form(derivative)}"
        correct = partial(self._corrected, derivative, known)
        for k in range(MAX_ITERATIONS):
            self._iterations = k + 1
            problem.counts.iterations += 1
            if derivative.recordable:
                problem.count(self._path.nodes)
                given = (t, q, v, h, a, *known)
                a, self._along, *sizes = problem.often.call(name, correct, given)
            else:
                self._along = problem.evaluate(*self._states(t, q, v, h, a))
                a, *sizes = self._moved(derivative, Place(t, q, v, h), a, self._along)
            ended = ending.after(*map(float, sizes))
            if ended is not None:
                return a if ended and np.isfinite(a).all() else None
        return None

    def _corrected(
        self, derivative: Derivative, known: tuple[Array, ...],
        t: Any, q: Array, v: Array, h: Any, a: Array, *arrays: Array,
    ) -> tuple[Array, ...]:  # fmt: skip
        """Return corrected accelerations, those along the path before, and the sizes that `_moved` returns.

        Parameters
        ----------
        derivative : Derivative
        known, arrays : tuple of ndarray
            What it consists of, and what takes the place of that.
        """
        if any(one is not other for one, other in zip(known, arrays, strict=True)):
            others = iter(arrays)
            derivative = rebuilt(derivative, lambda _: next(others))
        along = np.asarray(self._problem.acceleration(*self._states(t, q, v, h, a)))
        moved, *sizes = self._moved(derivative, Place(t, q, v, h), a, along)
        return moved, along, *map(np.asarray, sizes)

    def _moved(self, derivative: Derivative, place: Place, a: Array, along: Array) -> tuple[Array, ...]:
        """Return accelerations corrected for those along the path; the correction's consequence, its size."""
        (_, q, v, h), table, natural = place, self.table, derivative.increments
        at = natural.geometry(q + (h * table.nodes)[:, None] * v + h * h * (table.A2 @ a))
        missing = natural.to_natural(at, self._path.average @ along - a)
        y, consequence = derivative.correction(table, h)(derivative.reading(missing))
        return a + (table.A2_inverse / (h * h)) @ _added(natural, at, y), consequence, np.abs(y).max()

    def _newton(self, t: float, q: Array, v: Array, h: float, a: Array) -> Array | None:
        """Iterate with the derivatives at every point of the path, by shortened corrections where needed.

        A correction is shortened until the next one, with the same derivatives, becomes smaller (Deuflhard's
        natural monotonicity test); they serve on where that is far smaller, or rounding.
        """
        A2, ending, inverse = h * h * self.table.A2, _Stagnation(q), None
        r, share = self._defect(t, q, v, h, a), 1.0
        for _ in range(MAX_NEWTON):
            if inverse is None:
                matrix = self._matrix(t, q, v, h, a)
                if matrix is None:
                    return None
                inverse = np.linalg.inv(matrix)
            step = (inverse @ r.ravel()).reshape(a.shape)
            size = float(np.abs(A2 @ step).max())
            ended = ending.after(size)
            if ended is not None:
                return a + step if ended and np.isfinite(step).all() else None
            share = min(1.0, 4.0 * share)
            while share > LEAST_SHARE:
                r = self._defect(t, q, v, h, a + share * step)
                left = np.abs(A2 @ (inverse @ r.ravel()).reshape(a.shape)).max()
                if left <= (1.0 - 0.25 * share) * size or size < ROUNDING:
                    break
                share *= 0.5
            else:
                return None
            a = a + share * step
            if left > SERVES_ON * size and size >= ROUNDING:
                inverse = None
        return None

    def _matrix(self, t: float, q: Array, v: Array, h: float, a: Array) -> Array | None:
        """Return minus the derivative of the defect by the stage accelerations; None in sparse scenes."""
        way, s, n = self._path, self.table.stages, len(q)
        self._problem.counts.factorisations += 1
        slopes = self._slopes(*self._states(t, q, v, h, a))
        if slopes is None:
            return None
        matrix = np.eye(s * n).reshape(s, n, s, n)
        for by, weights in zip(slopes, (h * h * way.moved, h * way.rate), strict=True):
            if by is not None:
                matrix -= np.einsum("ik,kj,kab->iajb", way.average, weights, by, optimize=True)
        return matrix.reshape(s * n, s * n)

    def _slopes(self, *states: Array) -> tuple[Array, Array | None] | None:
        """Return the derivatives of the accelerations by q and v in states; None in sparse scenes.

        They have all inertia forces: those of joints that bend are by differences if need be.
        """
        problem = self._problem
        if problem.slopes is not None:
            return problem.often.call(f"slopes at {len(states[0])} points", problem.slopes, states)[1:]
        if problem.near(*next(zip(*states, strict=True))).sparse:
            return None
        near = problem.near
        if not problem.quartic:
            near = partial(by_differences, problem.evaluate, dissipates=True, units=problem.units())
        by_q, by_v = zip(*(near(*state).slopes() for state in zip(*states, strict=True)), strict=True)
        return np.array(by_q), None if by_v[0] is None else np.array(by_v)


class _Stagnation:
    """Tells when corrections have become rounding."""

    def __init__(self, q: Array) -> None:
        self._scale = 1.0 + float(np.abs(q).max())
        self._least = self._last = self._smallest = np.inf
        self._idle = 0

    def after(self, change: float, size: float = np.inf) -> bool | None:
        """Return whether the iteration has converged after a correction; None: go on.

        Parameters
        ----------
        change : float
            Size of the correction's consequence.
        size : float
            Size of the correction, where its consequence may be told too large.
        """
        relative = change / self._scale
        if not relative < 1e6:
            return False
        if relative < NOTHING:
            return True
        if relative <= 0.9 * self._least:
            self._idle = 0
        elif relative > SHRINKING * self._last:
            self._idle += 1
        self._least, self._last = min(self._least, relative), relative
        self._smallest = min(self._smallest, size / self._scale)
        if self._idle < PATIENCE:
            return None
        return self._least < ROUNDING or self._smallest < RESOLVED


def _added(natural: Increments, at: Any, y: Array) -> Array:
    """Return natural increments as changes of the states, small ones by their linear map."""
    small = np.abs(y).max() < LINEAR
    if isinstance(small, Traced):
        return np.where(small, natural.from_natural(at, y), natural.advance(at, y))
    return (natural.from_natural if small else natural.advance)(at, y)


ENERGY = Integrator(
    lambda solve: EnergyMethod("energy", gauss(solve.stages or DEFAULT_STAGES), solve.tolerance),
    Stability("A-stable, |R(iwh)| = 1; keeps the energy of any motion"),
    ("stages",),
    constant_mass=True,
    rank=5,
)
