"""Eigenvalues of pencils from the slowest on, what is known of their errors, and whether any is missing.

Where nothing depends on velocities the squares l^2 are looked for, else l itself.  Both come from the inverse
at a shift: of small pencils in the motions that the constraints allow.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from hfsim.maths.arrays import Array, BoolArray, ComplexArray, IntArray
from hfsim.maths.eigenvectors import eigenvectors
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Matrix
from hfsim.maths.pencils import EPS, Pencil, Solve
from hfsim.maths.squares import MORE, arnoldi, no_more, noise_of, squares_of

_CERTAIN = 3.0
"""Factor on what rounding does to a square of a frequency that is told."""
_TOGETHER = 1e-5
"""Distance of eigenvalues, over their size, at which they may be one with several shapes that are alike."""
_FAR = 1e-2
"""Change of an eigenvalue, over its size, beyond which it would be another one."""

_BESIDE, _ROUNDS = 1e-7, 6
"""Distance from an eigenvalue, over its size, at which its vectors are improved, and how often."""
_NEAR, _ASIDE, _TRIES = 1e-2, 1.3, 5
"""Distance of an eigenvalue from the shift, over this, at which the others are lost in rounding; factor on
the shift then, and how often."""


@frozen
class Eigenpairs:
    """Eigenvalues with their vectors, from slow to fast.

    Attributes
    ----------
    values : ndarray of complex, shape (k,)
        [1/s]; of conjugate pairs those with positive imaginary parts.
    vectors : ndarray of complex, shape (n, k)
    uncertainty : ndarray, shape (k,)
        What errors of the matrices do to them, or what a search leaves where that is more [1/s]; those no
        larger are zero, and so are real parts.
    doubled : ndarray of bool, shape (k,)
        Whether a motion that nothing brings back goes on by itself, too: the eigenvalue zero counts twice.
    complete : bool or None
        Whether it was checked that none is missing up to the last; None if that could not be told.
    """

    values: ComplexArray
    vectors: ComplexArray
    uncertainty: Array
    doubled: BoolArray
    complete: bool | None

    def part(self, which: IntArray) -> Eigenpairs:
        """Return some of them, by their numbers."""
        parts = self.values[which], self.vectors[:, which], self.uncertainty[which], self.doubled[which]
        return Eigenpairs(*parts, self.complete)


def eigenpairs(pencil: Pencil, count: int) -> Eigenpairs:
    """Return the slowest eigenvalues of a pencil; all of a small one.

    Parameters
    ----------
    count : int
        How many, of a large pencil.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the pencil is singular: something moves freely without mass.
    """
    if not pencil.free:
        nothing = np.zeros(0)
        return Eigenpairs(nothing + 0j, np.zeros((pencil.n, 0), complex), nothing, nothing > 0.0, True)
    found = _of_squares(pencil, count) if pencil.resting else _of_rates(pencil, count)
    return _sorted(_surely(pencil, _sorted(found), count))


def _sorted(found: Eigenpairs) -> Eigenpairs:
    sizes = np.round(np.log(np.abs(found.values) + np.finfo(float).tiny), 9)
    return found.part(np.lexsort((-found.values.real, found.values.imag, sizes)))


# --- squares: nothing depends on velocities ------------------------------------------------------------


def _of_squares(pencil: Pencil, count: int) -> Eigenpairs:
    squares, vectors, complete, shift = squares_of(pencil, count)
    noise = noise_of(pencil, squares, vectors, shift)
    zero = no_more(np.abs(squares), noise)
    roots = np.sqrt(-np.where(zero, 0.0, squares).astype(complex))
    roots = np.where(roots.imag < 0.0, -roots, roots)
    swinging = zero | ((squares.imag == 0.0) & (squares.real > 0.0))
    # of other squares both roots are motions of their own: what grows, and what decays
    others = np.flatnonzero(~swinging)
    upper = np.where(squares.imag[others] == 0.0, -roots[others], -roots[others].conj())
    which = np.concatenate([np.arange(len(squares)), others])
    values = np.concatenate([roots, upper])
    pairs = vectors[:, which]
    flipped = np.arange(len(values)) >= len(squares)
    pairs[:, flipped] = pairs[:, flipped].conj()
    # conjugate squares say the same
    kept = np.flatnonzero((squares[which].imag <= 0.0) | swinging[which])
    uncertainty = _of_roots(_CERTAIN * noise[which], values)
    return Eigenpairs(values, pairs, uncertainty, zero[which], complete).part(kept)


def _of_roots(noise: Array, values: ComplexArray) -> Array:
    """Return the errors of eigenvalues from those of their squares."""
    return np.asarray(noise / np.maximum(2.0 * np.abs(values), np.sqrt(noise) + 1e-300))


# --- rates: dampers, gyroscopic terms ------------------------------------------------------------------


def _of_rates(pencil: Pencil, count: int) -> Eigenpairs:
    standing = replace(pencil, velocity=0.0 * pencil.velocity)
    squares, motions, _, lowest = squares_of(standing, min(count, MORE))
    free = no_more(np.abs(squares), noise_of(standing, squares, motions, lowest))
    sizes = np.sort(np.abs(squares[~free]))
    # without any stiffness gyroscopic terms alone say how fast motions are
    shift = float(np.sqrt(sizes[min(2, len(sizes) - 1)])) if len(sizes) else pencil.whirling
    shift, values, vectors, complete = _beside(pencil, shift, count)
    if complete and pencil.large and len(values) < 2 * pencil.free:
        again, *_ = _roots(pencil, shift, count, seed=2)
        count = min(count, len(values), len(again))
        nearest = [np.sort(np.abs(one - shift))[:count] for one in (values, again)]
        complete = bool(np.allclose(nearest[0], nearest[1], rtol=1e-5))
    noise = pencil.rounding(values, vectors) + EPS * shift**2
    zero = no_more(np.abs(values) ** 2, noise)
    uncertainty = _of_roots(_CERTAIN * noise, values) + 10.0 * EPS * np.abs(values - shift) ** 2 / shift
    still, doubled = _standing(pencil, vectors[:, zero], motions[:, free])
    swinging = np.flatnonzero(~zero & (values.imag >= 0.0))
    return Eigenpairs(
        np.concatenate([np.zeros(still.shape[1]), values[swinging]]),
        np.hstack([still, vectors[:, swinging]]),
        np.concatenate(
            [np.full(still.shape[1], float(np.sqrt(noise[zero].max(initial=0.0)))), uncertainty[swinging]]
        ),
        np.concatenate([doubled, np.zeros(len(swinging), dtype=bool)]),
        complete or None,
    )


def _beside(pencil: Pencil, shift: float, count: int) -> tuple[float, ComplexArray, ComplexArray, bool]:
    """Return a shift that is no eigenvalue, and what is found next to it: something may grow at that rate."""
    for k in range(_TRIES + 1):
        try:
            values, vectors, complete = _roots(pencil, shift, count)
        except np.linalg.LinAlgError:
            if k == _TRIES:
                raise
        else:
            if k == _TRIES or np.abs(values - shift).min(initial=np.inf) >= _NEAR * shift:
                break
        shift *= _ASIDE
    return shift, values, vectors, complete


def _standing(
    pencil: Pencil, vectors: ComplexArray, motions: ComplexArray
) -> tuple[ComplexArray, BoolArray]:
    """Return the motions that nothing brings back, as columns, and which of them go on by themselves.

    They are those of vectors of the eigenvalue zero, which may happen to be nearly alike, or those that the
    stiffness leaves free, where these are more.
    """
    if not vectors.shape[1]:
        return vectors, np.zeros(0, dtype=bool)
    scaled = vectors / np.sqrt(pencil.energies(vectors))
    both = np.hstack([scaled.real, scaled.imag])
    left, sizes, _ = np.linalg.svd(both, full_matrices=False)
    kept = left[:, sizes > 1e-3 * sizes[0]].astype(complex)
    if kept.shape[1] < motions.shape[1] <= vectors.shape[1]:
        kept = motions.astype(complex)
    again = vectors.shape[1] - kept.shape[1]
    M, V, _, _ = pencil.matrices
    # of unit mass; then from what is least braked on
    kept = np.linalg.solve(np.linalg.cholesky(kept.conj().T @ (M @ kept)).conj(), kept.T).T
    ways = np.linalg.svd(kept.conj().T @ (V @ kept))[2][::-1].conj().T
    return kept @ ways, np.arange(kept.shape[1]) < again


def _roots(
    pencil: Pencil, shift: float, count: int, seed: int = 1
) -> tuple[ComplexArray, ComplexArray, bool]:
    """Return the eigenvalues next to a shift and their vectors, by equations of first order in (y, y'/s).

    Last comes whether all that were sought are among them.
    """
    M, V, _, _ = pencil.matrices
    n, solve = pencil.n, pencil.at(shift)
    VM = V + shift * M

    def forces(y: Any, w: Any) -> Any:
        return -(VM @ y + shift * (M @ w))

    if not pencil.large:
        basis, own = pencil.allowed
        onto = solve(np.hstack([-VM @ basis, -shift * M @ basis]))[own]
        below = onto + np.eye(*onto.shape) / shift
        theta, both = eigenvectors(np.vstack([onto, below]))
        if not theta.all():  # at an eigenvalue the inverse is anything
            raise np.linalg.LinAlgError("Singular matrix")
        return shift + 1.0 / theta, basis @ both[: pencil.free], True
    from scipy.sparse.linalg import LinearOperator

    def apply(one: Array) -> Array:
        y, w = one[:n], one[n:]
        p = solve(forces(y, w))
        return np.concatenate([p, p + y / shift])

    rng = np.random.default_rng(seed)
    y, w = (solve(M @ rng.standard_normal(n)) for _ in range(2))
    operator: Any = LinearOperator((2 * n, 2 * n), matvec=apply, dtype=float)
    size = min(2 * (count + MORE), 2 * pencil.free - 2)
    theta, both, complete = arnoldi(operator, size, np.concatenate([y, w]))
    return shift + 1.0 / theta, both[:n], complete


# --- what is rounding ----------------------------------------------------------------------------------


def _surely(pencil: Pencil, found: Eigenpairs, count: int) -> Eigenpairs:
    """Return the same with real parts that are no more than rounding set to zero.

    What errors of the matrices do depends on left vectors too: much where two eigenvalues are nearly one.
    """
    values, uncertainty = found.values.copy(), found.uncertainty.copy()
    growing = (values.real > uncertainty) & (values.real > 0.0)
    asked = np.flatnonzero((growing | (np.arange(len(values)) < count)) & (values != 0.0))
    for k in asked if not pencil.symmetric else ():
        values[k], error = _corrected(pencil, values[k], found.vectors[:, k])
        uncertainty[k] = max(uncertainty[k], error)
    apart = np.abs(values[:, None] - values)
    together = apart <= _TOGETHER * np.abs(values)
    if not pencil.symmetric:
        uncertainty = np.maximum(uncertainty, np.where(together, apart, 0.0).max(axis=1, initial=0.0))
    real = np.where(np.abs(values.real) <= uncertainty, 0.0, values.real)
    imaginary = np.where(np.abs(values.imag) <= uncertainty, 0.0, values.imag)
    values = real + 1j * imaginary
    # a pair that is no pair is two that decay, or grow, alike
    alike = np.flatnonzero((values.imag == 0.0) & (found.values.imag > 0.0) & (values.real != 0.0))
    which = np.concatenate([np.arange(len(values)), alike])
    vectors = found.vectors[:, which]
    vectors[:, len(values) :] = vectors[:, len(values) :].conj()
    return replace(
        found.part(which), values=values[which], vectors=vectors, uncertainty=uncertainty[which]
    )


def _corrected(pencil: Pencil, value: complex, vector: ComplexArray) -> tuple[complex, float]:
    """Return an eigenvalue by both its vectors, and what errors of the matrices do to it [1/s].

    Vectors are improved where they move it by more than that, until it stands.
    """
    M, V, K, _ = pencil.matrices
    turned = replace(pencil, mass=M.T, velocity=V.T, stiffness=K.T)
    left, before = (M @ vector).conj(), np.inf
    for improved in range(_ROUNDS):
        near, slope = value * (1.0 + _BESIDE), 2.0 * value * M + V
        try:
            left = _improved(turned.at(near), slope.T, left)
            change, error = _change(pencil, value, left, vector)
            if abs(change) <= error:
                return value - change, error
            if improved and abs(change) > min(0.5 * before, _FAR * abs(value)):
                break
            if improved:
                value, before = value - change, abs(change)
            vector = _improved(pencil.at(near), slope, vector)
        except np.linalg.LinAlgError:
            return value, abs(value)
    return value, max(error, min(abs(change), before))


def _improved(solve: Solve, slope: Matrix, vector: ComplexArray) -> ComplexArray:
    """Return a vector after a step of inverse iteration, and itself where two eigenvalues are quite one."""
    force = slope @ vector
    found = solve(force) if np.any(force) else vector
    return np.asarray(found / np.abs(found).max(), dtype=complex)


def _change(pencil: Pencil, value: complex, left: ComplexArray, right: ComplexArray) -> tuple[complex, float]:
    """Return what vectors take off an eigenvalue, and what errors of the matrices do to it [1/s]."""
    M, V, K, _ = pencil.matrices
    size, other, rate = np.abs(right), np.abs(left), abs(value)
    errors = other @ (abs(K) @ size + rate * (abs(V) @ size) + rate**2 * (abs(M) @ size))
    slope, bend = left @ (2.0 * value * (M @ right) + V @ right), left @ (M @ right)
    bound = _CERTAIN * pencil.precision * errors
    if not abs(slope) + abs(bend) > 0.0:
        return 0.0, rate
    # of two that are one, errors of the matrices do as much as their root, and so does a gap
    error = 2.0 * bound / (abs(slope) + np.sqrt(abs(slope) ** 2 + 4.0 * abs(bend) * bound))
    gap = left @ (K @ right + value * (V @ right) + value**2 * (M @ right))
    root = np.sqrt(slope**2 - 4.0 * bend * gap + 0j)
    steep = slope + root if abs(slope + root) >= abs(slope - root) else slope - root
    return complex(2.0 * gap / steep) if steep else 0.0, float(error)
