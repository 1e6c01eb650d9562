"""Derivatives of the accelerations in the forms that Newton corrections need.

With few unknowns and no damping, J is taken apart into modes: a correction is then a division for each
mode and stage, for any step length.  With damping it is kept as dense matrices, and with many unknowns
as the sparse matrices it comes from, factorised for each pole of the method.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from hfsim.integrators._base import Increments, PlainIncrements, Problem
from hfsim.integrators._tableau import Collocation
from hfsim.maths.arrays import Array, ComplexArray
from hfsim.maths.matrices import Matrix, factorised, is_sparse, saddle_point
from hfsim.mechanics.linearized import Linearized

Correction = Callable[[Array], tuple[Array, float]]
"""From residuals at the stages, as displacements (s, n_r), to corrections and the size of their consequence:
the displacement to which the change of the velocity at the end of the step leads, which is what an unfinished
iteration does to the steps that follow."""


class Start(NamedTuple):
    """The start of a step as natural increments have it."""

    at: Any
    """Geometry of the state, as a batch of one."""
    acceleration: Array
    """Of the state's own coordinates, (n,)."""
    first: Array
    """First time derivatives of the natural coordinates, (n,)."""
    second: Array
    convective: Array
    """What velocities alone make of the second ones, (n,)."""


class Derivative(Protocol):
    """Derivatives J_q and J_v of the accelerations at a state, in some coordinates for corrections."""

    increments: Increments
    """The coordinates it is written in."""
    fastest: float
    """Largest circular frequency in it [rad/s]."""

    def free_motion(self, table: Collocation, start: Start, h: float) -> Array:
        """Return displacements at the stages, (s, n), in natural increments."""

    def residual(self, problem: Problem, at: Any, t: Array, q: Array, v: Array, a: Array) -> Array:
        """Return by how much accelerations ``a`` fail the equations, (s, n_r), in columns of its own.

        ``at`` is the geometry of the states ``q``.
        """

    def reading(self, r: Array) -> Array:
        """Return accelerations that are missing, (s, n) in natural increments, in these columns."""

    def correction(self, table: Collocation, h: float) -> Correction:
        """Return the map from residuals at the stages to corrections."""

    def solver(self, by_q: float, by_v: float) -> Callable[[Array], Array]:
        """Return the map r -> (I - by_q J_q - by_v J_v)^-1 r of single residuals (n,)."""


def derivative(
    problem: Problem, t: float, q: Array, v: Array, natural: Increments | None = None
) -> Derivative:
    """Compute the derivative of the accelerations at a state, for corrections in natural coordinates.

    Parameters
    ----------
    problem : Problem
    t : float
    q, v : ndarray, shape (n,)
    natural : Increments, optional
        The state's own coordinates without it.
    """
    problem.counts.factorisations += 1
    natural = natural or PlainIncrements()
    if problem.linearized is None:
        return _by_differences(problem, t, q, v, natural)
    at = problem.linearized(t, q, v)
    if is_sparse(at.mass):
        return SparseDerivative(natural, q, at)
    if at.damping is None:
        return ModalDerivative.of(at, natural, q)
    P = _mobility(at)
    by_q, by_v = _in_natural(natural, q, -P @ at.stiffness), _in_natural(natural, q, -P @ at.damping)
    balance = None if isinstance(natural, PlainIncrements) else _of_imbalance(natural, q, P, at)
    return DenseDerivative(natural, by_q, by_v, balance)


def state_derivatives(problem: Problem, t: float, q: Array, v: Array) -> tuple[Array, Array | None] | None:
    """Return the derivatives J_q and J_v of the accelerations at a state as dense matrices, (n, n).

    J_v is None where nothing dissipates; None alone in scenes whose matrices are sparse.
    """
    if problem.linearized is None:
        return problem.jacobians(t, q, v)
    at = problem.linearized(t, q, v)
    if is_sparse(at.mass):
        return None
    P = _mobility(at)
    return -P @ at.stiffness, None if at.damping is None else -P @ at.damping


def _by_differences(problem: Problem, t: float, q: Array, v: Array, natural: Increments) -> Derivative:
    by_q, by_v = problem.jacobians(t, q, v)
    by_q = _in_natural(natural, q, by_q)
    if by_v is not None:
        return DenseDerivative(natural, by_q, _in_natural(natural, q, by_v))
    w2, R = np.linalg.eig(-by_q)
    L = np.linalg.inv(R)
    if np.abs(L).max() * len(q) < 1e10:
        return ModalDerivative(natural, w2, R, L)
    return DenseDerivative(natural, by_q, np.zeros_like(by_q))


def _in_natural(natural: Increments, q: Array, J: Array) -> Array:
    """Return a derivative by state coordinates as one by natural coordinates."""
    if isinstance(natural, PlainIncrements):
        return J
    at = natural.geometry(q[None])
    unit = natural.from_natural(at, np.eye(len(q))).T
    return natural.to_natural(at, np.ascontiguousarray((J @ unit).T)).T


def _of_imbalance(natural: Increments, q: Array, P: Array, at: Linearized) -> tuple[Array, Array]:
    """Return the maps from forces and gaps of an imbalance, as rows, to natural accelerations."""
    geometry = natural.geometry(q[None])
    mobility = natural.to_natural(geometry, np.ascontiguousarray(natural.to_natural(geometry, P).T))
    if at.jacobian is None:
        return mobility, np.zeros((0, len(q)))
    return mobility, natural.to_natural(geometry, _closing(at, at.jacobian))


def _closing(at: Linearized, jacobian: Array) -> Array:
    """Return the smallest accelerations, measured by the mass matrix, that close unit gaps, (n_rows, n)."""
    W = np.linalg.solve(at.mass, jacobian.T)
    return np.ascontiguousarray(np.linalg.solve((jacobian @ W).T, W.T))


def _missing(problem: Problem, natural: Increments, at: Any, t: Array, q: Array, v: Array, a: Array) -> Array:
    """Return the accelerations that are missing at states, in natural increments."""
    return natural.to_natural(at, problem.evaluate(t, q, v) - a)


def _allowed(at: Linearized) -> Array:
    """Return motions that the constraints allow, as rows, orthonormal in the metric of the mass."""
    assert at.inverse_root is not None
    if at.jacobian is None:
        return at.inverse_root
    forbidden = at.inverse_root @ at.jacobian.T
    Z = np.linalg.qr(forbidden, mode="complete")[0][:, forbidden.shape[1] :]
    return np.asarray(Z.T @ at.inverse_root)


def _mobility(at: Linearized) -> Array:
    """Return the map from forces to accelerations under the constraints."""
    allowed = _allowed(at)
    return np.asarray(allowed.T @ allowed)


@dataclass(frozen=True)
class Joints:
    """What joints forbid, in the coordinates of a derivative.

    Attributes
    ----------
    jacobian : ndarray, shape (n_rows, n)
    closing : ndarray, shape (n_rows, n)
        The smallest motions, measured by the mass matrix, that close unit gaps.
    forces : ndarray, shape (n_rows, n_modes)
        Forces on the modes that these motions cause.
    """

    jacobian: Array
    closing: Array
    forces: Array

    @classmethod
    def of(cls, at: Linearized, jacobian: Array, R: Array) -> Joints:
        """Return them in the state's own coordinates, beside modes R."""
        closing = _closing(at, jacobian)
        return cls(jacobian, closing, closing @ at.stiffness.T @ R)

    def closed(self, gaps: Array) -> Array:
        """Return the motions that close gaps (..., n_rows)."""
        return np.asarray(gaps @ self.closing)


@dataclass
class ModalDerivative:
    """J_q = -R S with S R = diag(w2), where nothing dissipates: every mode is corrected by itself.

    Where the mass matrix is known, a residual has a column for each mode and then one for each joint
    equation, and comes from forces, f - M a.  Accelerations that are missing in *another* state would depend
    on its mass matrix in natural increments, and stiff modes would be corrected by the wrong amount.

    Attributes
    ----------
    increments : Increments
    w2 : ndarray, shape (n_modes,)
        Squares of the circular frequencies.
    R : ndarray, shape (n, n_modes)
        Modes as columns.
    L : ndarray, shape (n_modes, n)
        L R = 1: with as many modes as coordinates the inverse of R.
    joints : Joints, or None
        Motions that joints forbid and which have no modes; None where there are as many modes as coordinates.
    mass : ndarray, shape (n, n), or None
        Of the state's coordinates; R^T then turns forces into accelerations of the modes.
    """

    increments: Increments
    w2: Array | ComplexArray
    R: Array | ComplexArray
    L: Array | ComplexArray
    joints: Joints | None = None
    mass: Array | None = None

    def __post_init__(self) -> None:
        self.fastest = float(np.sqrt(np.abs(self.w2).max(initial=0.0)))
        # a velocity error of a mode swings out to itself over the frequency; slow ones over half a second
        self._per_rate = 1.0 / np.sqrt(np.abs(self.w2) + 4.0)
        self._divisor: tuple[float, ComplexArray, ComplexArray] | None = None
        rows = self.L if self.joints is None else np.concatenate([self.L, self.joints.jacobian])
        self._columns = np.ascontiguousarray(rows.T)

    @classmethod
    def of(cls, at: Linearized, natural: Increments, q: Array) -> ModalDerivative:
        """Return the modes of a dense linearised system without damping.

        Following loads make the stiffness unsymmetric; corrections do with its symmetric part.
        """
        allowed = _allowed(at)
        K = allowed @ at.stiffness @ allowed.T
        w2, U = np.linalg.eigh(0.5 * (K + K.T))
        R = allowed.T @ U
        L = R.T @ at.mass
        joints = None if at.jacobian is None else Joints.of(at, at.jacobian, R)
        if isinstance(natural, PlainIncrements):
            return cls(natural, w2, R, L, joints)
        geometry = natural.geometry(q[None])
        R = np.ascontiguousarray(natural.to_natural(geometry, np.ascontiguousarray(R.T)).T)
        unit = natural.from_natural(geometry, np.eye(len(q))).T
        if joints is not None:
            closing = natural.to_natural(geometry, joints.closing)
            joints = Joints(joints.jacobian @ unit, closing, joints.forces)
        return cls(natural, w2, R, L @ unit, joints, at.mass)

    def residual(self, problem: Problem, at: Any, t: Array, q: Array, v: Array, a: Array) -> Array:
        """Return missing accelerations of the modes and gaps of joints."""
        natural = self.increments
        if self.mass is None or problem.imbalance is None:
            return self.reading(_missing(problem, natural, at, t, q, v, a))
        forces, gaps = problem.unbalanced(t, q, v, a)
        modes = natural.to_natural_forces(at, forces) @ self.R
        return np.asarray(modes if self.joints is None else np.concatenate([modes, gaps], axis=1))

    def reading(self, r: Array) -> Array:
        """Return accelerations in natural increments as accelerations of the modes and gaps of joints."""
        return r if self.mass is None else np.asarray(r @ self._columns)

    def _real(self, z: ComplexArray) -> Array | ComplexArray:
        """Drop the imaginary part where the modes are real, so that what follows is real too."""
        return z.real if np.isrealobj(self.R) else z

    def free_motion(self, table: Collocation, start: Start, h: float) -> Array:
        """Let each mode swing freely from its velocity and acceleration at the start of the step."""
        oscillating = np.isrealobj(self.w2) and bool((self.w2 >= 0.0).all())
        omega = np.sqrt(self.w2 if oscillating else self.w2.astype(complex))
        omega = np.where(np.abs(omega) * h < 1e-4, 1e-4 / h, omega)
        half = (0.5 * h * table.nodes)[:, None] * omega
        sine = np.sin(half) / omega
        p1, p2 = self.L @ start.first, self._modal_acceleration(start)
        swing = p1 * (2.0 * sine * np.cos(half)) + p2 * (2.0 * sine * sine)
        y = (self._real(swing) @ self.R.T).real
        if self.joints is not None:
            tau = (h * table.nodes)[:, None]
            y = y + self.joints.closed(tau * (self.joints.jacobian @ start.first))
            y += self.joints.closed(0.5 * tau**2 * (self.joints.jacobian @ start.second))
        return np.asarray(y)

    def _modal_acceleration(self, start: Start) -> Array | ComplexArray:
        """Return accelerations of the modes, where the mass matrix is known from the forces behind them."""
        if self.mass is None:
            return self.L @ start.second
        forces = self.increments.to_natural_forces(start.at, (self.mass @ start.acceleration)[None])[0]
        return np.asarray(forces @ self.R + self.L @ start.convective)

    def correction(self, table: Collocation, h: float) -> Correction:
        """Divide each mode and pole by 1 + (h pole)^2 w2."""
        if self._divisor is None or self._divisor[0] != h:
            mu2 = (h * table.poles[:, None]) ** 2
            self._divisor = (h, mu2, np.asarray(1.0 / (1.0 + mu2 * self.w2), complex))
        _, mu2, divisor = self._divisor
        left, right = 2.0 * table.left, table.right
        R, end_rate, per_rate = self.R.T, table.end_rate / h, self._per_rate
        joints, m = self.joints, len(self.w2)
        columns = self._columns if self.mass is None else None

        def correct(r: Array) -> tuple[Array, float]:
            r = r if columns is None else r @ columns
            z = right @ r[:, :m]
            if joints is not None:
                z -= mu2 * (right @ (r[:, m:] @ joints.forces))
            z *= divisor
            modes = self._real(left @ z)
            # back in coordinates: amplitudes of nearly parallel modes mean nothing one by one
            y, consequence = modes @ R, ((end_rate @ modes) * per_rate) @ R
            if joints is not None:
                # what is in no mode stays as it is, and counts as if it were slow
                rest = joints.closed(r[:, m:])
                y += rest
                consequence += 0.5 * (end_rate @ rest)
            return y.real, float(np.abs(consequence.real).max())

        return correct

    def solver(self, by_q: float, by_v: float) -> Callable[[Array], Array]:
        """Return a product with the inverse, put together from the modes."""
        divisor = 1.0 / (1.0 + by_q * self.w2)
        inverse = ((self.R * divisor) @ self.L).real
        if self.joints is not None:
            coupled = self.joints.closing.T - (self.R * (by_q * divisor)) @ self.joints.forces.T
            inverse += coupled @ self.joints.jacobian
        return lambda r: np.asarray(inverse @ r)


@dataclass
class DenseDerivative:
    """J_q and J_v as matrices: one complex inverse for each pole of the method and step length.

    Attributes
    ----------
    increments : Increments
    by_q, by_v : ndarray, shape (n, n)
    of_imbalance : tuple of ndarray, shapes (n, n) and (n_rows, n), or None
        Maps from forces on natural increments and gaps, as rows, to accelerations in natural increments; None
        in the state's own coordinates, where missing accelerations serve as well.
    """

    increments: Increments
    by_q: Array
    by_v: Array
    of_imbalance: tuple[Array, Array] | None = None

    def __post_init__(self) -> None:
        self.fastest = float(np.sqrt(np.linalg.norm(self.by_q, 2))) if self.by_q.size else 0.0
        self._inverse: tuple[float, ComplexArray] | None = None

    def residual(self, problem: Problem, at: Any, t: Array, q: Array, v: Array, a: Array) -> Array:
        """Return missing accelerations in natural increments, from forces where these are at hand."""
        natural = self.increments
        if self.of_imbalance is None or problem.imbalance is None:
            return _missing(problem, natural, at, t, q, v, a)
        forces, gaps = problem.unbalanced(t, q, v, a)
        mobility, closing = self.of_imbalance
        return np.asarray(natural.to_natural_forces(at, forces) @ mobility + gaps @ closing)

    def reading(self, r: Array) -> Array:
        """Return ``r``."""
        return r

    def free_motion(self, table: Collocation, start: Start, h: float) -> Array:
        """Keep the accelerations at the start of the step, less what dies out at once."""
        matrix = np.eye(len(self.by_q)) - h * self.by_v - h * h * self.by_q
        damped = np.linalg.solve(matrix, start.second + h * (self.by_q @ start.first))
        tau = (h * table.nodes)[:, None]
        return np.asarray(tau * start.first + 0.5 * tau**2 * damped)

    def correction(self, table: Collocation, h: float) -> Correction:
        """Solve with I - (h pole)^2 J_q - h pole J_v."""
        if self._inverse is None or self._inverse[0] != h:
            mu = h * table.poles[:, None, None]
            matrix = np.eye(len(self.by_q)) - mu**2 * self.by_q - mu * self.by_v
            self._inverse = (h, np.linalg.inv(matrix))
        inverse, left, right, end_rate = self._inverse[1], 2.0 * table.left, table.right, table.end_rate / h

        def correct(r: Array) -> tuple[Array, float]:
            y = (left @ (inverse @ (right @ r)[:, :, None])[:, :, 0]).real
            # without modes every velocity error counts as if it were slow, which is on the safe side
            return y, 0.5 * float(np.abs(end_rate @ y).max())

        return correct

    def solver(self, by_q: float, by_v: float) -> Callable[[Array], Array]:
        """Return a product with the inverse."""
        inverse = np.linalg.inv(np.eye(len(self.by_q)) - by_q * self.by_q - by_v * self.by_v)
        return lambda r: np.asarray(inverse @ r)


@dataclass
class SparseDerivative:
    """A sparse linearised system: one complex factor for each pole of the method and step length.

    Attributes
    ----------
    increments : Increments
    q : ndarray, shape (n,)
        The state it belongs to.
    at : Linearized
    """

    increments: Increments
    q: Array
    at: Linearized

    def __post_init__(self) -> None:
        scale = 1.0 / np.sqrt(self.at.mass.diagonal())
        # Gershgorin's bound with the mass on the diagonal alone
        rows = scale * (abs(self.at.stiffness) @ scale)
        self.fastest = float(np.sqrt(rows.max(initial=0.0)))
        self._geometry: Any = self.increments.geometry(self.q[None])
        self._factors: tuple[float, list[Callable[[Array], Array]]] | None = None

    def residual(self, problem: Problem, at: Any, t: Array, q: Array, v: Array, a: Array) -> Array:
        """Return missing accelerations in natural increments."""
        return _missing(problem, self.increments, at, t, q, v, a)

    def reading(self, r: Array) -> Array:
        """Return ``r``."""
        return r

    def _matrix(self, by_q: complex, by_v: complex) -> Matrix:
        """Return M - by_q M J_q - by_v M J_v, bordered by the constraints."""
        matrix = self.at.mass + by_q * self.at.stiffness
        if self.at.damping is not None:
            matrix = matrix + by_v * self.at.damping
        return matrix if self.at.jacobian is None else saddle_point(matrix, self.at.jacobian)

    def _right_side(self, r: Array) -> Array:
        """Return what belongs to residuals (..., n) in the state's coordinates."""
        weighted = r @ self.at.mass
        if self.at.jacobian is None:
            return np.asarray(weighted)
        return np.concatenate([weighted, r @ self.at.jacobian.T], axis=-1)

    def free_motion(self, table: Collocation, start: Start, h: float) -> Array:
        """Return the stages of the linearised motion."""
        tau = h * table.nodes[:, None]
        uniform = tau * start.first + h * h * table.A2.sum(axis=1)[:, None] * start.second
        return self.correction(table, h)(uniform)[0]

    def correction(self, table: Collocation, h: float) -> Correction:
        """Solve with M + (h pole)^2 K + h pole D."""
        if self._factors is None or self._factors[0] != h:
            poles = [complex(h * pole) for pole in table.poles]
            self._factors = (h, [factorised(self._matrix(mu**2, mu)) for mu in poles])
        factors, left, right, end_rate = self._factors[1], 2.0 * table.left, table.right, table.end_rate / h
        natural, geometry, n = self.increments, self._geometry, len(self.q)

        def correct(r: Array) -> tuple[Array, float]:
            rhs = right @ self._right_side(natural.from_natural(geometry, r))
            solved = np.array([solve(b) for solve, b in zip(factors, rhs, strict=True)])[:, :n]
            y = natural.to_natural(geometry, np.ascontiguousarray((left @ solved).real))
            return y, 0.5 * float(np.abs(end_rate @ y).max())

        return correct

    def solver(self, by_q: float, by_v: float) -> Callable[[Array], Array]:
        """Return the solution with a real factor."""
        solve = factorised(self._matrix(by_q, by_v))
        natural, geometry = self.increments, self._geometry

        def product(r: Array) -> Array:
            rhs = self._right_side(natural.from_natural(geometry, r[None]))
            return np.asarray(natural.to_natural(geometry, solve(rhs)[:, : len(r)])[0])

        return product
