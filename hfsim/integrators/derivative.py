"""Derivatives of the accelerations in the forms that Newton corrections need.

With few unknowns, a constant mass matrix and no damping, J is taken apart into modes: a correction is then a
division for each mode and stage, for any step length.  Else it is kept as dense matrices of the motions that
joints allow; with many unknowns, or for one correction alone, as the matrices it comes from, factorised for
each pole of the method.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from hfsim.integrators._derivative import ByStep, Correction, Derivative, Stages, Start, in_natural
from hfsim.integrators._modal import ModalDerivative
from hfsim.integrators._motions import MotionsDerivative, motions_of
from hfsim.integrators._problem import Increments, PlainIncrements, Problem
from hfsim.integrators._tableau import Collocation
from hfsim.maths.arrays import Array, ComplexArray
from hfsim.maths.frozen import mutable
from hfsim.maths.matrices import Matrix
from hfsim.mechanics.linearized import Linearized

DAMPED = 1.2
"""Damping, over the mass and the circular frequency, from which a mode is so damped that no order of `gear`
lets it grow: twice the cosine of 52 degrees (Hairer and Wanner V.2)."""
_Solver = Callable[[Array, Array], Array]


def derivative(
    problem: Problem,
    t: float,
    q: Array,
    v: Array,
    natural: Increments | None = None,
    expected: Array | None = None,
    with_inertia: bool = False,
) -> Derivative:
    """Compute the derivative of the accelerations at a state, for corrections in natural coordinates.

    Parameters
    ----------
    q, v : ndarray, shape (n,)
    natural : Increments, optional
        The state's own coordinates without it.
    expected : ndarray, shape (n_strains,), optional
        Strains that are expected there; those of the state without it.
    with_inertia : bool
        Whether inertia forces that change with the state count where they are at hand.
    """
    if problem.strains is not None and expected is None:
        expected = problem.strains.seen(q[None])[0]
    found = computed(problem, natural or PlainIncrements(), with_inertia, t, q, v, expected)
    return taken_at(found, problem, t, q, v, expected)


def computed(
    problem: Problem,
    natural: Increments,
    with_inertia: bool,
    t: float,
    q: Array,
    v: Array,
    expected: Array | None,
    once: bool = False,
) -> Derivative:
    """Compute what `derivative` returns, but for where it was taken; or what serves one correction best."""
    strains, natural = problem.strains, natural.from_state(q)
    if strains is None or expected is None:
        slopes = problem.slopes if with_inertia else None
        near = problem.near if slopes is None else slopes.linearized
        return _in_its_form(_turning(near(t, q, v), natural, q, v), q, natural, once)
    found = _in_its_form(_turning(problem.near(t, q, v, expected), natural, q, v), q, natural)
    found.know_strains(strains.stiffness, strains.slopes(q), q)
    return found


def taken_at(
    found: Derivative, problem: Problem, t: float, q: Array, v: Array, expected: Array | None
) -> Derivative:
    """Return a derivative that knows where it was taken, and count it."""
    problem.counts.factorisations += 1
    found.check()
    place = [np.array([t]), q, v] if expected is None else [np.array([t]), q, v, expected]
    found.ways = problem.often.chosen
    found.taken = np.concatenate([*place, problem.turns.angles(t, q)])
    return found


def taken_again(
    problem: Problem, taken: Array, with_inertia: bool = False
) -> Derivative:
    """Compute a derivative where one was taken."""
    place, angles = place_of(problem, taken)
    with problem.turns.supposed(place[0], angles):
        return derivative(problem, *place[:3], None, place[3], with_inertia)


def place_of(problem: Problem, taken: Array) -> tuple[tuple[float, Array, Array, Array | None], Array]:
    """Return where a derivative was taken, (t, q, v, expected strains), and the angles that were counted."""
    place, angles = np.split(taken, [len(taken) - len(problem.turns)])
    count = 0 if problem.strains is None else problem.strains.count
    n = (len(place) - 1 - count) // 2
    t, q, v, expected = float(place[0]), place[1 : n + 1], place[n + 1 : 2 * n + 1], place[2 * n + 1 :]
    return (t, q, v, expected if count else None), angles


def _turning(at: Linearized, natural: Increments, q: Array, v: Array) -> Linearized:
    """Return a linearised system with what turning bodies add to it: increments stand still, states do not.

    Without damping, for the sake of modes, that is the symmetric part alone: the centrifugal forces, but for
    which a free turn would have a frequency of its own.
    """
    turning = None if at.solved else natural.turning(natural.geometry(q[None]), v)
    if turning is None:
        return at
    drag = at.mass @ turning
    back = drag @ turning
    if at.damping is None:
        return replace(at, stiffness=at.stiffness + 0.5 * (back + back.T))
    return replace(at, stiffness=at.stiffness + back, damping=at.damping + 2.0 * drag)


def _in_its_form(at: Linearized, q: Array, natural: Increments, once: bool = False) -> Derivative:
    if at.sparse or (once and not at.solved):
        return PlainDerivative(natural, q, at)
    if not at.solved:
        if at.damping is None:
            return ModalDerivative.of(at, natural, q)
        rows = at.allowed
        pull, drag = rows @ at.stiffness, rows @ at.damping
        return DenseDerivative(
            natural, *motions_of(at, natural, q, rows, pull, drag), pull @ rows.T, drag @ rows.T
        )
    slopes = [J for J in at.slopes() if J is not None]
    if not isinstance(natural, PlainIncrements):
        slopes = in_natural(natural, natural.geometry(q[None]), *slopes)
    unit = np.eye(len(q))
    damping = -slopes[1] if len(slopes) > 1 else None
    return DenseDerivative(natural, unit, unit, None, None, -slopes[0], damping)


@mutable
class DenseDerivative(MotionsDerivative):
    """J_q = -R K L and J_v = -R D L with matrices: one complex factor for each pole and step length.

    Attributes
    ----------
    stiffness, damping : ndarray, shape (n_motions, n_motions)
        K and D; None instead of D where nothing dissipates.
    """

    stiffness: Array
    damping: Array | None

    def __post_init__(self) -> None:
        super().__post_init__()
        self._inverse: ByStep[ComplexArray] = ByStep()

    def frequency(self) -> Array:
        """Return a bound of the circular frequencies, all but the largest one: the norm of K^4 [rad/s]."""
        size = np.abs(self.stiffness).max(initial=1e-300)
        once = self.stiffness / size
        twice = once @ once
        return np.asarray(np.sqrt(size) * np.sum((twice @ twice) ** 2) ** (1.0 / 16.0))

    def ringing(self) -> Array:
        """Return the circular frequencies of modes of the stiffness that damping lets swing [rad/s]."""
        w2, U = np.linalg.eigh(0.5 * (self.stiffness + self.stiffness.T))
        omega = np.sqrt(np.abs(w2))
        if self.damping is None:
            return np.asarray(omega)
        return np.asarray(omega[np.einsum("ij,ij->j", U, self.damping @ U) < DAMPED * omega])

    def check(self) -> None:
        """Refuse what is not finite: LAPACK would print a complaint of its own."""
        damping = 0.0 if self.damping is None else self.damping
        if not (np.isfinite(self.stiffness).all() and np.isfinite(damping).all()):
            raise np.linalg.LinAlgError("the derivative is not finite")

    def free_motion(self, table: Collocation, start: Start, h: float) -> Array:
        """Keep the accelerations at the start of the step, less what dies out at once.

        Where nothing dies out, it is the linearised motion.
        """
        if self.damping is None:
            return self._linear_motion(table, start, h)
        tau, m = (h * table.nodes)[:, None], len(self.stiffness)
        rate = start.first @ self._columns
        pulled = self.stiffness @ rate[:m]
        if self.joints is not None:
            pulled = pulled + rate[m:] @ self.joints.forces
        damped = self._solved((start.second - h * (self.R @ pulled))[None], h * h, h)[0]
        return np.asarray(tau * start.first + 0.5 * tau**2 * damped)

    def correction(self, table: Collocation, h: float) -> Correction:
        """Solve with 1 + (h pole)^2 K + h pole D."""
        mu, joints, m = h * table.poles[:, None], self.joints, len(self.stiffness)
        inverse = self._inverse.of(h, lambda: self._inverted(mu[:, :, None] ** 2, mu[:, :, None]))
        right, joining, end_rate = mu**2 * table.right, table.joining, table.end_rate / h
        slow = table.slow(h)
        R, moved = np.ascontiguousarray(self.R.T), h * h * table.A2

        def correct(r: Array) -> tuple[Array, Array]:
            r = self._read(r)
            z = self._forced(right @ r, mu**2, mu)
            found = (inverse @ z[:, :, None])[:, :, 0]
            y = joining @ np.concatenate([found.real, found.imag]) @ R
            if joints is not None:
                y += joints.closed(moved @ r[:, m:])
            # without modes every velocity error counts as if it were slow, which is on the safe side
            return y, slow * np.abs(end_rate @ y).max()

        return correct

    def solver(self, by_q: float, by_v: float) -> Callable[[Array], Array]:
        """Return what solves for one residual, without the inverse in all coordinates."""
        return lambda r: self._solved(r[None], by_q, by_v)[0]

    def inverse(self, by_q: float, by_v: float) -> Array:
        """Return what unit residuals lead to."""
        return self._solved(np.eye(self.n), by_q, by_v).T

    def _solved(self, r: Array, by_q: float, by_v: float) -> Array:
        """Return solutions for residuals (k, n)."""
        joints, r = self.joints, r @ self._columns
        y = (self._inverted(by_q, by_v) @ self._forced(r, by_q, by_v).T).T @ self.R.T
        return np.asarray(y if joints is None else y + joints.closed(r[:, len(self.stiffness) :]))

    def _forced(self, r: Any, by_k: Any, by_d: Any) -> Any:
        """Return what motions are to answer to: with what motions that close gaps leave to them."""
        if self.joints is None:
            return r
        own, gaps = r[:, : len(self.stiffness)], r[:, len(self.stiffness) :]
        return own - by_k * (gaps @ self.joints.forces) - by_d * (gaps @ self.joints.drags)

    def _inverted(self, by_k: Any, by_d: Any) -> Any:
        """Return the inverse of 1 + by_k K + by_d D."""
        matrix = np.eye(len(self.stiffness)) + by_k * self.stiffness
        return np.linalg.inv(matrix if self.damping is None else matrix + by_d * self.damping)


@mutable
class PlainDerivative(Derivative):
    """A linearised system as it is: one complex factor for each pole of the method and step length.

    Attributes
    ----------
    q : ndarray, shape (n,)
        The state it belongs to.
    """

    recordable: ClassVar[bool] = False
    increments: Increments
    q: Array
    at: Linearized

    def __post_init__(self) -> None:
        self._geometry: Any = self.increments.geometry(self.q[None])
        self._factors: ByStep[list[_Solver]] = ByStep()

    def frequency(self) -> Array:
        """Return a bound of the circular frequencies: Gershgorin's, with the mass on the diagonal alone."""
        scale = 1.0 / np.sqrt(self.at.metric.diagonal())
        return np.asarray(np.sqrt((scale * (abs(self.at.stiffness) @ scale)).max(initial=0.0)))

    def ringing(self) -> Array:
        """Return frequencies all the way up to that bound, as meshes have them, if nothing is damped."""
        return self.fastest * (np.geomspace(1e-6, 1.0, 64) if self.at.damping is None else np.ones(1))

    def _solver(self, by_q: complex, by_v: complex) -> _Solver:
        """Return the solution of M - by_q M J_q - by_v M J_v, on the joints."""
        return self.at.solver(self.at.implicit(by_q, by_v))

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.q)

    def know_strains(self, stiffness: Array, slopes: Matrix, q: Array) -> None:
        """Take note of the strains, their derivative sparse and by the state."""
        self._stiffness, self._slopes = stiffness, slopes

    def strain_changes(self, y: Array) -> Array:
        """Return the changes of strains (s, n_strains) with small natural increments (s, n)."""
        return np.asarray(self.increments.from_natural(self._geometry, y) @ self._slopes.T)

    def residual(self, problem: Problem, stages: Stages) -> Array:
        """Return missing accelerations in natural increments, then stresses of strains not expected."""
        r = super().residual(problem, stages)
        if (strained := stages.strained) is None:
            return r
        return np.concatenate([r, (strained.seen - strained.expected) * self._stiffness], axis=1)

    def _right_sides(self, r: Array) -> tuple[Array, Array]:
        """Return forces and gaps that belong to residuals."""
        r, stresses = np.split(r, [len(self.q)], axis=1)
        r = self.increments.from_natural(self._geometry, r)
        gaps = np.zeros((len(r), 0)) if self.at.jacobian is None else r @ self.at.jacobian.T
        forces = np.asarray(r @ self.at.mass)
        return forces - stresses @ self._slopes if stresses.size else forces, gaps

    def free_motion(self, table: Collocation, start: Start, h: float) -> Array:
        """Return the stages of the linearised motion; a damper acts on changes of the rates alone."""
        if self.at.damping is None:
            return self._linear_motion(table, start, h)
        tau, natural = h * table.nodes[:, None], self.increments
        forces, gaps = self._right_sides(np.repeat(start.second[None], len(tau), axis=0))
        pulled = natural.from_natural(self._geometry, start.first[None]) @ self.at.stiffness
        return np.asarray(tau * start.first + self._stages(table, h)(forces - tau * pulled, gaps))

    def correction(self, table: Collocation, h: float) -> Correction:
        """Solve with M + (h pole)^2 K + h pole D."""
        stages, end_rate, slow = self._stages(table, h), table.end_rate / h, table.slow(h)

        def correct(r: Array) -> tuple[Array, Array]:
            y = stages(*self._right_sides(r))
            return y, slow * np.abs(end_rate @ y).max()

        return correct

    def _stages(self, table: Collocation, h: float) -> Callable[[Array, Array], Array]:
        """Return the map from forces and gaps at the stages to displacements, in natural increments."""
        poles = [complex(h * pole) for pole in table.poles]
        factors = self._factors.of(h, lambda: [self._solver(mu**2, mu) for mu in poles])
        right = (h * table.poles[:, None]) ** 2 * table.right
        natural, geometry, left = self.increments, self._geometry, 2.0 * table.left

        def moved(*sides: Array) -> Array:
            pairs = zip(factors, *(right @ side for side in sides), strict=True)
            solved = np.array([solve(f, gaps) for solve, f, gaps in pairs])
            return natural.to_natural(geometry, np.ascontiguousarray((left @ solved).real))

        return moved

    def solver(self, by_q: float, by_v: float) -> Callable[[Array], Array]:
        """Return the solution with a real factor."""
        solve = self._solver(by_q, by_v)

        def product(r: Array) -> Array:
            motions = solve(*self._right_sides(r[None]))
            return np.asarray(self.increments.to_natural(self._geometry, motions)[0])

        return product
