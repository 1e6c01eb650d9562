"""Eigenvalues and modes of a system linearised in one state, on the manifold of its joints."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from hfsim.maths.arrays import Array, ComplexArray
from hfsim.maths.differences import slopes
from hfsim.maths.eigenvectors import eigenvectors
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Matrix, complement, dense
from hfsim.mechanics.linearized import Linearized, rows_of
from hfsim.mechanics.small_motions import small_motions
from hfsim.mechanics.system import System

_DIFFERENCE = 1e-3
"""Step of the differences, fourth order: exact for cubic forces."""
_SLOWEST = 6
"""How many of the slowest motions of a large system are looked at."""
_EPS = float(np.finfo(float).eps)


@frozen
class Modes:
    """A system near one state: y'' = A y + B y' in independent coordinates y.

    Attributes
    ----------
    stiffness, damping : ndarray, shape (n_free, n_free)
        A and B.
    basis : ndarray, shape (n, n_free)
        Changes of the state that the joints allow.
    precision : float
        Relative error of A and B.
    """

    stiffness: Array
    damping: Array
    basis: Array
    precision: float = _EPS

    @classmethod
    def of(cls, at: Linearized) -> Modes:
        """Return the modes of linearised equations."""
        at = at.dense()
        Z = at.allowed
        A = -Z @ at.stiffness @ Z.T
        return cls(A, np.zeros_like(A) if at.damping is None else -Z @ at.damping @ Z.T, Z.T)

    def eigenvalues(self) -> ComplexArray:
        """Return all eigenvalues, shape (2 n_free,) [1/s]."""
        if not self.damping.any():
            return _pairs(-np.linalg.eigvals(self.stiffness))
        return np.linalg.eigvals(first_order(self.stiffness, self.damping)).astype(complex)

    def fastest(self) -> tuple[float, Array]:
        """Return the largest frequency without damping [rad/s] and its shape in the state, (n,)."""
        w2, modes = eigenvectors(-self.stiffness)
        k = int(np.argmax(w2.real))
        return _root(w2[k]), _scaled(self.basis @ modes[:, k].real)


@frozen
class LargeModes:
    """A large system near one state, with sparse matrices; damping is left out."""

    equations: Linearized

    precision = _EPS

    def eigenvalues(self) -> ComplexArray:
        """Return the eigenvalues of the slowest few motions and of the fastest [1/s]."""
        fastest = self._fastest()[0]
        if not fastest[0].real > 0.0:
            return np.zeros(1, dtype=complex)
        return _pairs(np.concatenate([self._slowest(float(fastest[0].real)), fastest]))

    def fastest(self) -> tuple[float, Array]:
        """Return the largest frequency [rad/s] and its shape in the state, (n,)."""
        w2, modes = self._fastest()
        return _root(w2[0]), _scaled(modes[:, 0].real)

    def _fastest(self) -> tuple[ComplexArray, ComplexArray]:
        return self._largest(self.equations.mass, self.equations.stiffness, 1)

    def _slowest(self, fastest: float) -> ComplexArray:
        """Return the squares of the slowest frequencies, by inverse iteration from just below zero."""
        M, shift = self.equations.mass, -1e-10 * fastest
        shifted = self.equations.stiffness - shift * M
        return shift + 1.0 / self._largest(shifted, M, min(_SLOWEST, M.shape[0] - 2))[0]

    def _largest(self, A: Matrix, B: Matrix, count: int) -> tuple[ComplexArray, ComplexArray]:
        """Return the largest eigenvalues of A^-1 B under the joints and their vectors."""
        from scipy.sparse.linalg import LinearOperator, eigs

        M = self.equations.mass
        solve, n = self.equations.solver(A), M.shape[0]
        start = self.equations.solver(M)(M @ np.random.default_rng(1).standard_normal(n), None)
        operator: Any = LinearOperator((n, n), matvec=lambda y: solve(B @ y, None), dtype=float)
        values, vectors = eigs(operator, k=count, which="LM", v0=start)
        return values, vectors


AnyModes: TypeAlias = Modes | LargeModes


def first_order(stiffness: Array, damping: Array, rate: float = 1.0) -> Array:
    """Return the matrix of y'' = A y + B y' as equations of first order in (y, y' / rate)."""
    n = len(stiffness)
    return np.block([[np.zeros((n, n)), rate * np.eye(n)], [stiffness / rate, damping]])


def _pairs(w2: ComplexArray | Array) -> ComplexArray:
    """Return the eigenvalues that belong to squares of circular frequencies."""
    roots = np.sqrt(-w2.astype(complex))
    return np.concatenate([roots, -roots])


def _root(w2: complex) -> float:
    return float(np.sqrt(max(w2.real, 0.0)))


def _scaled(shape: Array) -> Array:
    return np.asarray(shape / np.abs(shape).max())


def analytic_modes(system: System, t: float, q: Array, v: Array, most: int) -> AnyModes:
    """Return the modes of a system that linearizes; with sparse matrices above a number of unknowns."""
    found = system.linearized(t, q, v)
    return LargeModes(found) if found.sparse and len(q) > most else Modes.of(found)


def modes_at_rest(system: System, t: float, q: Array) -> Modes:
    """Return the modes about a state without rates, for any chart and any mass matrix."""
    x = system.absolute(q[None])
    near = small_motions(system, t, x[0], 0.0 * x[0])
    M, D, K, J, B = map(dense, (near.mass, near.velocity, near.stiffness, near.jacobian, near.basis))
    Z = complement(J).T
    Z = rows_of(Z @ M @ Z.T) @ Z
    at = np.repeat(x, len(Z), axis=0)
    basis = system.state(at, Z @ B.T, np.repeat(q[None], len(Z), axis=0))[1]
    return Modes(-Z @ K @ Z.T, -Z @ D @ Z.T, basis.T)


def modes_by_differences(system: System, t: float, q: Array, v: Array, units: Array | float = 1.0) -> Modes:
    """Return the modes with the inertia of the motion, by fourth-order differences on the joints.

    Of coordinates that change by units (n,) at large, over these.
    """
    Z = _allowed(system, t, q, v, units)
    n = Z.shape[1]
    steps = _DIFFERENCE * np.concatenate([k * np.eye(n) for k in (-2, -1, 1, 2)])
    nothing = np.zeros_like(steps)
    moved = np.concatenate([np.hstack([steps, nothing]), np.hstack([nothing, steps])])
    y, w = moved[:, :n], moved[:, n:]
    times = np.full(len(moved), t)
    Q, V = system.project(times, q + y @ Z.T * units, v + w @ Z.T * units)
    values = system.acceleration(times, Q, V) / units @ Z
    # where projection has moved the coordinates a little, the chain rule brings them back
    reached = np.hstack([(Q - q) / units @ Z, (V - v) / units @ Z])
    sloped = slopes(values.reshape(2, 4, n, n).swapaxes(0, 1)) / _DIFFERENCE
    turned = slopes(reached.reshape(2, 4, n, 2 * n).swapaxes(0, 1)) / _DIFFERENCE
    J = np.linalg.solve(np.concatenate(turned), np.concatenate(sloped)).T
    return Modes(J[:, :n], J[:, n:], (Z.T * units).T, _EPS / _DIFFERENCE)


def _allowed(system: System, t: float, q: Array, v: Array, units: Array | float) -> Array:
    """Return an orthonormal basis of the changes of q / units that the joints allow, shape (n, n_free)."""
    if not system.constraints:
        return np.eye(system.n)
    # projected velocities are what the joints allow; the rates of drivers drop out in differences
    n = system.n
    at, times = np.repeat(q[None], n + 1, axis=0), np.full(n + 1, t)
    fastest = max(1.0, float(np.abs(v / units).max(initial=0.0)))
    rates = v + np.vstack([np.eye(n), np.zeros((1, n))]) * units * fastest
    moved = system.project(times, at, rates)[1]
    left, _, _ = np.linalg.svd(((moved[:-1] - moved[-1]) / units).T)
    return np.asarray(left[:, : n - system.n_rows])
