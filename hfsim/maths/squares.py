"""Squares of the eigenvalues of pencils without velocities: the slowest, found next to a shift below them.

Rounding of the inverse at a shift does to squares what their distance to it, squared, over the shift does: it
is to be near to the slowest, yet not so near that nothing is known of the fastest that are looked for.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from hfsim.maths.arrays import Array, BoolArray, ComplexArray
from hfsim.maths.eigenvectors import eigenvectors
from hfsim.maths.inertia import count_below
from hfsim.maths.matrices import dense
from hfsim.maths.pencils import EPS, Pencil, Solve

_FIRST_SHIFT = 1e-8
"""First shift over the square of the fastest frequency."""
_NEAREST_SHIFT = 1e-10
"""The same of one next to the slowest, over the fastest that is found: nearer, that would be rounding."""
_BESIDE = 0.7
"""Size of that shift over the slowest square, which may be negative: at the shift itself nothing is found."""
_LOWEST_SHIFT = 1e-20
_FITTING = (1e-6, 1e2)
"""Sizes of a shift, over the square of the slowest frequency, that are left as they are."""
_DOUBTFUL = 30.0
"""Factor on what rounding does to a square of a frequency below which that counts as zero."""
_FLUTTER = 1e-6
"""Imaginary part of a square, over its size, beyond which it is no rounding."""
MORE = 8
"""Motions that are looked for beyond those asked for."""
_TRIES = 4
_WHOLE = 2000
"""Coordinates up to which all squares are computed where an iteration finds none."""
_TIGHT, _ROUNDS, _MANY_ROUNDS = 1e-12, 30, 300
"""Error of eigenvalues that an iteration may leave; how often it begins anew, and if it has to do."""


class Unfound(np.linalg.LinAlgError):
    """An iteration does not converge, whatever the matrices are."""


def slowest_squares(pencil: Pencil, count: int) -> tuple[ComplexArray, Array, bool | None]:
    """Return minus the squares of the slowest eigenvalues without velocities, and motions (n, k) as columns.

    Last comes whether none slower is missing, None where that is not known.

    Those that are no more than rounding are zero.  Of a small pencil they are all.  Complex ones are of
    motions that swing and grow, or decay, as with loads that turn with their bodies.

    Parameters
    ----------
    count : int
        How many, of a large pencil.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the pencil is singular.
    """
    if not pencil.free:
        return np.zeros(0, dtype=complex), np.zeros((pencil.n, 0)), True
    squares, vectors, complete, shift = squares_of(pencil, count)
    noise = noise_of(pencil, squares, vectors, shift)
    zero = no_more(np.abs(squares), noise)
    swinging = np.abs(squares.imag) > np.maximum(_FLUTTER * np.abs(squares), _DOUBTFUL * noise)
    return np.where(swinging, squares, np.where(zero, 0.0, squares.real)), vectors.real, complete


def noise_of(pencil: Pencil, squares: ComplexArray, vectors: ComplexArray, shift: float) -> Array:
    """Return what rounding does to squares found by the inverse at a shift."""
    own = _own_noise(pencil, squares, vectors)
    return np.asarray(own + EPS * np.abs(squares - shift) ** 2 / abs(shift))


def _own_noise(pencil: Pencil, squares: ComplexArray, vectors: ComplexArray) -> Array:
    """Return what rounding of the matrices themselves does to squares."""
    return pencil.rounding(np.sqrt(-squares.astype(complex)), vectors)


def no_more(sizes: Array, noise: Array) -> BoolArray:
    """Tell which sizes of squares are no more than noise; where some are, their vectors are mixed."""
    clearly = sizes <= _DOUBTFUL * noise
    return np.asarray(sizes <= _DOUBTFUL * np.maximum(noise, noise[clearly].max(initial=0.0)))


def squares_of(pencil: Pencil, count: int) -> tuple[ComplexArray, ComplexArray, bool | None, float]:
    """Return minus the squares of eigenvalues without velocities, with vectors; then the shift (negative)."""
    shift = -_FIRST_SHIFT * pencil.fastest
    squares, vectors = _next_to(pencil, shift, count)
    for _ in range(2 * _TRIES - 1):
        better = _better(pencil, shift, squares, vectors)
        if better is None:
            break
        try:
            squares, vectors = _next_to(pencil, better, count)
        except np.linalg.LinAlgError:  # next to zero what is free is singular
            break
        shift = better
    squares, vectors, complete = _completed(pencil, shift, count, squares, vectors)
    return squares, vectors, complete, shift


def _better(pencil: Pencil, shift: float, squares: ComplexArray, vectors: ComplexArray) -> float | None:
    """Return a shift next to the slowest of the squares found next to another, which may do: None then."""
    noise, sizes = noise_of(pencil, squares, vectors, shift), np.abs(squares)
    slowest = float(sizes[~no_more(sizes, noise)].min(initial=np.inf))
    if slowest == np.inf:
        # what the matrices' own rounding is, no shift tells from zero, next to which nothing is inverted
        hidden = pencil.large and not no_more(sizes, _own_noise(pencil, squares, vectors)).all()
        return 1e-4 * shift if hidden and -shift > _LOWEST_SHIFT * pencil.fastest else None
    low, high = _FITTING
    if low * slowest <= -shift <= high * slowest:
        return None
    nearest = -max(_BESIDE * slowest, _NEAREST_SHIFT * float(sizes.max()))
    return None if np.isclose(nearest, shift, rtol=0.1) else nearest


def _completed(
    pencil: Pencil, shift: float, count: int, squares: ComplexArray, vectors: ComplexArray
) -> tuple[ComplexArray, ComplexArray, bool | None]:
    """Return the slowest squares, and whether none is missing."""
    if not pencil.large or len(squares) >= pencil.free:
        return squares, vectors, True
    if not pencil.symmetric:
        again, _ = _next_to(pencil, shift, count, seed=2)
        size = np.sort(np.abs(again - shift))[:count], np.sort(np.abs(squares - shift))[:count]
        return squares, vectors, bool(np.allclose(*size, rtol=1e-5)) or None
    wanted = count
    for _ in range(_TRIES):
        order = np.argsort(squares.real)
        squares, vectors = squares[order], vectors[:, order]
        # what grows is counted too, and is no reason to leave out what is slow
        growing = np.count_nonzero(squares.real < -noise_of(pencil, squares, vectors, shift) * _DOUBTFUL)
        last = _gap(squares.real, min(wanted + int(growing), len(squares)))
        bound = 0.5 * (squares.real[last - 1] + squares.real[last])
        below = count_below(pencil, float(bound))
        if below is None:
            return squares, vectors, None
        if below == last:
            return squares[:last], vectors[:, :last], True
        count += max(2 * abs(below - last), MORE)
        squares, vectors = _next_to(pencil, shift, count, seed=3)
    return squares, vectors, False


def _gap(values: Array, count: int) -> int:
    """Return a number of the smallest values, about the one asked for, after which there is a gap."""
    sizes = np.diff(values) / (np.abs(values[1:]) + np.abs(values[:-1]) + 1e-300)
    wide = np.flatnonzero(sizes > 1e-6) + 1
    beyond = wide[wide >= min(count, len(values) - 1)]
    return int(beyond[0] if len(beyond) else wide[-1] if len(wide) else len(values) - 1)


def _next_to(pencil: Pencil, shift: float, count: int, seed: int = 1) -> tuple[ComplexArray, ComplexArray]:
    """Return the squares next to a shift and their vectors."""
    M, _, K, _ = pencil.matrices
    solve = pencil.inverse(K - shift * M)
    try:
        found = _large(pencil, solve, count + MORE, seed) if pencil.large else _whole(pencil, solve)
    except np.linalg.LinAlgError:
        # of thin ropes masses are nearly singular, and Lanczos' iteration finds nothing; of what is free many
        # times over it finds one after the other, by rounding
        if not pencil.large or pencil.n > _WHOLE:
            raise
        found = _whole(pencil, solve)
    theta, vectors = found
    kept = np.argsort(-np.abs(theta))[: pencil.free]
    theta, vectors = theta[kept], vectors[:, kept]
    squares = shift + 1.0 / theta
    if pencil.symmetric:
        return squares.real.astype(complex), vectors
    # rounding makes no pair of two that are one
    real = np.abs(squares.imag) <= 1e-9 * np.abs(squares)
    return np.where(real, squares.real, squares), vectors


def _whole(pencil: Pencil, solve: Any) -> tuple[ComplexArray, ComplexArray]:
    """Return all eigenvalues 1 / (square - shift) and their vectors."""
    M = dense(pencil.matrices[0])
    if pencil.symmetric:
        sizes = np.sqrt(np.where(M.diagonal() > 0.0, M.diagonal(), 1.0))
        own, axes = np.linalg.eigh(M / np.outer(sizes, sizes))
        if own.min() > -1e-12:
            root = (sizes[:, None] * axes) * np.sqrt(np.maximum(own, 0.0))
            spread = solve(root)
            inverse = root.T @ spread
            theta, weights = np.linalg.eigh(0.5 * (inverse + inverse.T))
            return theta.astype(complex), (spread @ weights).astype(complex)
    basis, own = pencil.allowed
    theta, weights = eigenvectors(solve(M @ basis)[own])
    return theta, basis @ weights


def _large(pencil: Pencil, solve: Solve, count: int, seed: int) -> tuple[ComplexArray, ComplexArray]:
    """Return the largest of the same by Lanczos' or Arnoldi's iteration.

    Raises
    ------
    Unfound
        If some do not converge though all can be computed.
    """
    from scipy.sparse.linalg import LinearOperator, eigsh

    M, n = pencil.matrices[0], pencil.n
    count = min(count, max(pencil.free - 2, 1), n - 2)
    start = solve(M @ np.random.default_rng(seed).standard_normal(n))
    operator: Any = LinearOperator((n, n), matvec=lambda y: solve(M @ y), dtype=float)
    if not pencil.symmetric:
        return arnoldi(operator, count, start)[:2]
    inverse: Any = LinearOperator((n, n), matvec=solve, dtype=float)
    small = n <= _WHOLE
    options: Any = {"v0": start, "tol": _TIGHT, "maxiter": _ROUNDS if small else _MANY_ROUNDS}
    # the inverse is that at the shift, whatever it is called
    values, vectors, _ = _converged(partial(eigsh, M, count, M=M, sigma=0.0, OPinv=inverse, **options))
    if len(values) < (count if small else 2):
        raise Unfound(f"{len(values)} of {count} slowest motions were found")
    # Rayleigh's quotients: the iteration's own values are as far off as the largest is, of what moves freely
    moved = M @ vectors
    theta = np.sum(moved * solve(moved), axis=0) / pencil.energies(vectors)
    return theta.astype(complex), vectors.astype(complex)


def arnoldi(operator: Any, count: int, start: Array) -> tuple[ComplexArray, ComplexArray, bool]:
    """Return the largest eigenvalues of an operator and their vectors, and whether all of them converged.

    Where damping grows with stiffness, eigenvalues without number crowd at one place: of these some do not,
    nor do others that they crowd out.
    """
    from scipy.sparse.linalg import eigs

    size = min(len(start), max(2 * count + 1, 3 * count))
    return _converged(
        partial(eigs, operator, count, which="LM", v0=start, tol=_TIGHT, ncv=size, maxiter=_ROUNDS)
    )


def _converged(iteration: Callable[[], tuple[Array, Array]]) -> tuple[Any, Any, bool]:
    """Return eigenvalues and vectors as far as an iteration converges, and whether all did."""
    from scipy.sparse.linalg import ArpackError, ArpackNoConvergence

    try:
        return *iteration(), True
    except ArpackNoConvergence as some:
        if not len(some.eigenvalues):
            raise Unfound("none of the slowest motions was found") from None
        return some.eigenvalues, some.eigenvectors, False
    except ArpackError as error:
        raise np.linalg.LinAlgError(str(error)) from None
