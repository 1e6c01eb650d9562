"""Whether a scene at rest would stay where it is: the slowest motions, and those that nothing holds."""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.matrices import Matrix, dense, factorised, is_sparse, saddle_point
from hfsim.maths.rank import null_space
from hfsim.mechanics.statics.problem import Problem, State, Tangent

NONE = 1e-12
"""Stiffness along a motion, relative to all that adds up to it, that is rounding."""
ASKEW = 1e-9
"""Part of a matrix that may be skew by rounding."""
ROUNDING = 1e-14
"""Eigenvalue, relative to the stiffest coordinate's, that is rounding."""
NEAREST = 6
"""Eigenvalues of a large scene that are looked at: those nearest to zero."""


def mass_at(problem: Problem, state: State) -> Matrix:
    """Return the mass matrix of the free coordinates, (n, n), with an inverse on all that joints allow."""
    system = problem.system
    if not system.variable_mass:
        return system.reduction.reduced(problem.gauge.metric)
    return system.reduction.reduced(system.equations.mass(problem.expand(state.z))[0])


def neutral(problem: Problem, state: State, load: float, rigid: Array) -> Array:
    """Return the motions of rigid bodies that joints allow and nothing resists.

    Parameters
    ----------
    problem : Problem
    state : State
    load : float
    rigid : ndarray, shape (n_motions, n_x)
        Motions of each body by itself.

    Returns
    -------
    ndarray, shape (k, n)
        Of the free coordinates.
    """
    sizes = np.array([problem.gauge.size(row[None]) for row in rigid])
    there = sizes > NONE * sizes.max(initial=0.0)
    rigid = rigid[there] / sizes[there, None]
    rows = problem.system.unreduced.phi.jacobian_at(problem.expand(state.z))
    if not len(rigid):
        return np.zeros((0, state.z.shape[1]))
    gaps = np.asarray(rows @ rigid.T) if rows.shape[0] else np.zeros((0, len(rigid)))
    most = np.linalg.norm(np.asarray(abs(rows) @ np.abs(rigid.T)), axis=1) if len(gaps) else np.zeros(0)
    felt = np.linalg.norm(gaps, axis=1) > NONE * most
    gaps = gaps[felt] / most[felt, None]
    allowed = null_space(gaps) if len(gaps) else np.eye(len(rigid))
    motions = problem.system.reduction.free_rates(allowed.T @ rigid)
    if not len(motions):
        return motions
    K = problem.tangent(state, load).stiffness
    own, size = motions @ (K @ motions.T), np.abs(motions) @ (abs(K) @ np.abs(motions.T))
    values, mixed = np.linalg.eigh(0.5 * (own + own.T))
    free = np.abs(values) <= NONE * np.diag(mixed.T @ size @ mixed).clip(min=size.diagonal().max())
    return np.asarray(mixed[:, free].T @ motions)


def lowest(problem: Problem, state: State, load: float) -> tuple[Array, Array]:
    """Return the smallest stiffnesses over masses on allowed motions [1/s^2], ascending, and their motions.

    Those are squares of natural frequencies; a negative one is of a motion that grows by itself.

    Returns
    -------
    values : ndarray, shape (k,)
    motions : ndarray, shape (k, n)
    """
    tangent, M = problem.tangent(problem.at(state), load), mass_at(problem, state)
    try:
        values, motions = _sparse(tangent, M) if is_sparse(tangent.stiffness) else _dense(tangent, M)
    except np.linalg.LinAlgError:  # far from straight there are models without a mass matrix
        values, motions = _dense(tangent, problem.system.reduction.reduced(problem.gauge.metric))
    order = np.argsort(values)
    rounding = ROUNDING * float((np.abs(tangent.stiffness.diagonal()) / M.diagonal()).max())
    return np.where(np.abs(values) <= rounding, 0.0, values)[order], motions[order]


def _dense(tangent: Tangent, M: Matrix) -> tuple[Array, Array]:
    K, J = dense(tangent.stiffness), dense(tangent.jacobian)
    Z = np.linalg.qr(J.T, mode="complete")[0][:, len(J) :] if len(J) else np.eye(len(K))
    root = np.linalg.inv(np.linalg.cholesky(Z.T @ dense(M) @ Z))
    A = root @ (Z.T @ K @ Z) @ root.T
    if np.abs(A - A.T).max(initial=0.0) <= ASKEW * np.abs(A).max(initial=0.0):
        values, vectors = np.linalg.eigh(0.5 * (A + A.T))
    else:
        found, vectors = np.linalg.eig(A)
        values, vectors = found.real, vectors.real
    return values, np.asarray((Z @ root.T @ vectors).T)


def _sparse(tangent: Tangent, M: Matrix) -> tuple[Array, Array]:
    from scipy.sparse.linalg import LinearOperator, eigs, eigsh

    K, J = tangent
    n, m = K.shape[0], J.shape[0]
    shift = -ROUNDING * float((np.abs(K.diagonal()) / M.diagonal()).max())
    shifted = (K - shift * M).tocsc()
    size = float(np.abs(K.diagonal()).max())
    solve = factorised(saddle_point(shifted, size * J) if m else shifted)

    def answer(force: Array) -> Array:
        return solve(np.concatenate([force, np.zeros(m)]))[:n]

    inverse = LinearOperator((n, n), matvec=answer, dtype=float)
    begin = answer(np.asarray(M @ np.sin(np.arange(1.0, n + 1.0))))
    askew = float(abs(K - K.T).max()) > ASKEW * size
    count = min(NEAREST, n - m - 1)
    find = eigs if askew else eigsh
    values, motions = find(K, count, M, sigma=shift, OPinv=inverse, v0=begin, tol=1e-10)
    return np.asarray(values.real), np.asarray(motions.real.T)
