"""Changes of a load at which a stiffness that changes evenly with it is singular: K + nu K'."""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array, ComplexArray
from hfsim.maths.eigenvectors import eigenvectors
from hfsim.maths.matrices import Matrix, complement, dense, is_sparse, skewness
from hfsim.maths.pencils import EPS
from hfsim.mechanics.small_motions import BY_DIFFERENCES
from hfsim.mechanics.statics.newton import Effort, balanced
from hfsim.mechanics.statics.problem import Level, Problem, State, Tangent
from hfsim.mechanics.statics.stability import is_symmetric

REAL = 1e-6
"""Imaginary part of an eigenvalue, relative to its size, up to which it is real."""
NOISE = 1e4
"""Skewness of changes of the stiffness, over that which rounding makes, that is rounding."""
SPANNED = 1e-6
"""Part of motions beyond others, relative to the largest, from which it is a motion of its own."""


def eigenpairs(
    problem: Problem, state: State, load: float, step: float, effort: Effort, count: int
) -> list[tuple[float, Array]]:
    """Return changes of the load at which the stiffness is singular, and the motions.

    The smallest positive ones, as many as counted; or those nearest to zero of either sign if none is.  None
    where nothing is elastic, or joints hold everything.
    """
    ends = [balanced(problem, state, Level(load + way), effort) for way in (-step, step)]
    low, high = (problem.tangent(one, load + way) for one, way in zip(ends, (-step, step), strict=True))
    tangent = problem.tangent(state, load)
    K, change = tangent.stiffness, (high.stiffness - low.stiffness) / (2.0 * step)
    if not abs(K).max():
        return []
    some = _sparse(tangent, change, count) if is_sparse(K) else None
    scale = _scale(K, problem.metric)
    basis = _allowed(dense(tangent.jacobian), scale) if some is None else _spanned(some[1], scale)
    if not basis.shape[1]:
        return []
    rough = bool(problem.system.variable_mass)
    even = skewness(change, K) <= NOISE * (BY_DIFFERENCES if rough else EPS) / step and is_symmetric(K, rough)
    found = _symmetric(basis, K, change, load - problem.least) if even else None
    factors, motions = found or _real(*(some or _projected(basis, K, change)))
    if count:
        factors, motions = factors[factors > 0.0], motions[factors > 0.0]
    order = np.argsort(np.abs(factors))[: count or 6]
    return [(float(factors[k]), motions[k]) for k in order]


def _real(values: Array, motions: Array) -> tuple[Array, Array]:
    """Return the factors nu of real eigenvalues 1 / nu that are not zero, and their motions."""
    kept = (np.abs(values.imag) <= REAL * np.abs(values)) & (np.abs(values) > 0.0)
    return 1.0 / values.real[kept], motions[kept].real


def _scale(K: Matrix, metric: Matrix) -> Array:
    """Return changes of the coordinates that meet the same stiffness each, (n,): no unit counts in these.

    What is stiff and what is not is told by the metric: those of lengths and turns have different units.
    """
    weights = metric.diagonal()
    stiff = np.abs(K.diagonal()) / weights
    return np.asarray(1.0 / np.sqrt(weights * np.where(stiff > EPS * stiff.max(), stiff, stiff.max())))


def _allowed(J: Array, scale: Array) -> Array:
    """Return a basis of the motions that joints allow, (n, k)."""
    return np.asarray(scale[:, None] * complement(J * scale))


def _spanned(motions: Array, scale: Array) -> Array:
    """Return a basis of what complex motions, as rows, span together, (n, k)."""
    motions = motions / scale
    parts = np.concatenate([motions.real, motions.imag])
    left, sizes, _ = np.linalg.svd((parts / np.linalg.norm(motions, axis=1).max()).T, full_matrices=False)
    return np.asarray(scale[:, None] * left[:, sizes > SPANNED])


def _projected(Z: Array, K: Matrix, change: Matrix) -> tuple[ComplexArray, ComplexArray]:
    """Return eigenvalues 1 / nu of -K^-1 K' on motions (n, k), and these motions as rows."""
    values, vectors = eigenvectors(np.linalg.solve(Z.T @ (K @ Z), -(Z.T @ (change @ Z))))
    rounding = 1e-12 * np.abs(values).max(initial=0.0)
    return np.where(np.abs(values) > rounding, values, 0.0), (Z @ vectors).T


def _symmetric(Z: Array, K: Matrix, change: Matrix, load: float) -> tuple[Array, Array] | None:
    """Return the factors nu of matrices without skew parts on motions (n, k), and these motions as rows.

    Of the stiffness without load they are all real: rounding makes pairs of two that are one elsewhere.
    None where that is not positive.
    """
    from scipy.linalg import eigh

    own, others = (Z.T @ (one @ Z) for one in (K - load * change, -change))
    try:
        values, vectors = eigh(0.5 * (others + others.T), 0.5 * (own + own.T))
    except np.linalg.LinAlgError:
        return None
    there = np.abs(values) > 1e-12 * np.abs(values).max(initial=0.0)
    return 1.0 / values[there] - load, (Z @ vectors[:, there]).T


def _sparse(tangent: Tangent, change: Array, count: int) -> tuple[Array, Array]:
    from scipy.sparse.linalg import LinearOperator, eigs

    n, m = tangent.stiffness.shape[0], tangent.jacobian.shape[0]
    gaps = np.zeros((1, m))

    def answer(motion: Array) -> Array:
        force = -np.asarray(change @ motion.ravel())[None]
        return np.asarray(tangent.solved(force, gaps)[0][0])

    begin = answer(np.sin(np.arange(1.0, n + 1.0)))
    operator = LinearOperator((n, n), matvec=answer, dtype=float)
    values, motions = eigs(operator, count or 3, which="LR" if count else "LM", v0=begin, tol=1e-12)
    return values, motions.T
