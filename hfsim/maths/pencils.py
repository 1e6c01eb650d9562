"""Eigenvalues of (l^2 M + l V + K) x + J^T m = 0, J x = 0: small motions under constraints.

Constraints stay equations of their own: in a basis of the motions that they allow, what is stiff would be
mixed with what is not.  What is inverted is K + s V + s^2 M at a shift s: dense, or with sparse factors.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array, ComplexArray, IntArray
from hfsim.maths.eigenvectors import allowed
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Matrix, dense, skewness

EPS = float(np.finfo(float).eps)
SMALL = 200
"""Coordinates up to which all eigenvalues are computed."""
_EQUILIBRATIONS = 4
_SAME = 1e-9
"""Skewness that is rounding."""

Solve = Callable[[Array], Array]


@frozen
class Pencil:
    """The matrices.

    Attributes
    ----------
    mass, velocity, stiffness : Matrix, shape (n, n)
    jacobian : Matrix, shape (m, n)
    precision : float
        Relative error of the matrices.
    floor : float
        Error of squares of eigenvalues beside that [1/s^2].
    blur : Matrix, shape (n, n), or None
        Errors of the stiffness beside that, each by itself.
    """

    mass: Matrix
    velocity: Matrix
    stiffness: Matrix
    jacobian: Matrix
    precision: float = EPS
    floor: float = 0.0
    blur: Matrix | None = None

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return int(self.mass.shape[0])

    @property
    def free(self) -> int:
        """Number of independent motions."""
        return self.n - int(self.jacobian.shape[0])

    @property
    def large(self) -> bool:
        """Whether only some of the eigenvalues are computed."""
        return self.n > SMALL

    @cached_property
    def resting(self) -> bool:
        """Whether nothing depends on velocities."""
        return not abs(self.velocity).max()

    @cached_property
    def symmetric(self) -> bool:
        """Whether nothing depends on velocities and the stiffness is symmetric."""
        K = self.stiffness
        if self.precision > EPS:  # by differences
            return self.resting and bool(abs(K - K.T).max() <= 30.0 * self.precision * abs(K).max())
        return self.resting and skewness(K) <= _SAME

    @cached_property
    def matrices(self) -> tuple[Matrix, Matrix, Matrix, Matrix]:
        """M, V, K and J: dense if small, sparse if large."""
        parts = self.mass, self.velocity, self.stiffness, self.jacobian
        if not self.large:
            M, V, K, J = map(dense, parts)
            return M, V, K, J
        from scipy.sparse import csc_array

        M, V, K, J = map(csc_array, parts)
        return M, V, K, J

    @cached_property
    def fastest(self) -> float:
        """The size of the squares of the fastest frequencies, roughly."""
        stiff, heavy = (np.abs(one.diagonal()) for one in (self.stiffness, self.mass))
        # what is stiff may be a coordinate that has no mass but moves others that have, as the axis of a disc
        J = self.matrices[3]
        moved = (J**2).T @ _inverse(J**2 @ _inverse(heavy))
        return float((stiff * _inverse(np.where(heavy > 0.0, heavy, moved))).max()) or 1.0

    @property
    def whirling(self) -> float:
        """The size of the eigenvalues that velocities alone make, roughly."""
        heavy = float(np.abs(self.mass.diagonal()).max(initial=0.0))
        return float(abs(self.velocity).max()) / heavy if heavy > 0.0 else 1.0

    def rounding(self, values: ComplexArray, vectors: ComplexArray) -> Array:
        """Return what errors of the matrices do to the squares of eigenvalues with vectors (n, k), (k,)."""
        _, V, K, _ = self.matrices
        size = np.abs(vectors)
        errors = self.precision * np.sum(size * (abs(K) @ size + np.abs(values) * (abs(V) @ size)), axis=0)
        if self.blur is not None:  # at random
            errors += np.sqrt(np.sum(size**2 * (self.blur**2 @ size**2), axis=0))
        return np.asarray(self.floor + errors / self.energies(vectors))

    def energies(self, vectors: ComplexArray) -> Array:
        """Return x^H M x of vectors (n, k)."""
        found = np.sum(vectors.conj() * (self.matrices[0] @ vectors), axis=0).real
        return np.asarray(np.maximum(found, np.finfo(float).tiny))

    @cached_property
    def allowed(self) -> tuple[Array, IntArray]:
        """A basis (n, free) of what constraints allow, and the coordinates that are its shares, (free,)."""
        return allowed(dense(self.jacobian))

    # ------------------------------------------------------------------ solution at a shift

    def at(self, shift: complex) -> Solve:
        """Return the map from forces (n, k) to motions (n, k) of K + s V + s^2 M under the constraints."""
        M, V, K, _ = self.matrices
        return self.inverse(K + shift * V + shift * shift * M)

    def inverse(self, matrix: Matrix) -> Solve:
        """Return the map from forces to motions of a matrix (n, n) under the constraints.

        Raises
        ------
        numpy.linalg.LinAlgError
            If it is singular; where matrices are dense, when the map is used.
        """
        n, whole = self.n, self._bordered(matrix)

        def solve(forces: Array) -> Array:
            padded = np.zeros((n + self.jacobian.shape[0], *forces.shape[1:]), dtype=forces.dtype)
            padded[:n] = forces
            return whole(padded)[:n]

        return solve

    def answer(self, matrix: Matrix, force: Array, gap: Array) -> tuple[Array, Array]:
        """Return the motion (n,) and multipliers (m,) that answer a force (n,) and close a gap (m,).

        Raises
        ------
        numpy.linalg.LinAlgError
            If the matrix is singular.
        """
        size = self._weight(matrix)
        found = self._bordered(matrix)(np.concatenate([force, size * gap]))
        return found[: self.n], size * found[self.n :]

    def _weight(self, matrix: Matrix) -> float:
        """Return what makes constraints as large as a matrix."""
        J = self.matrices[3]
        return float(abs(matrix).max()) / (float(abs(J).max()) if J.shape[0] else 1.0) or 1.0

    def _bordered(self, matrix: Matrix) -> Solve:
        """Return the solutions of [[A, s J^T], [s J, 0]]."""
        J, size = self.matrices[3], self._weight(matrix)
        if self.large:
            from scipy.sparse import block_array, csc_array
            from scipy.sparse.linalg import splu

            parts = [[matrix, size * J.T], [size * J, None]] if J.shape[0] else [[matrix]]
            whole = csc_array(block_array(parts))
            try:
                factor = splu(whole)
            except RuntimeError as error:
                raise np.linalg.LinAlgError(str(error)) from None
            return _refined(whole, lambda given: np.asarray(factor.solve(given.astype(whole.dtype))))
        whole = np.block([[matrix, size * J.T], [size * J, np.zeros((len(J), len(J)))]])
        return _refined(whole, _equilibrated(whole))


def _refined(matrix: Matrix, solve: Solve) -> Solve:
    """Return solutions corrected by what they leave: factors are coarse where units make entries unlike."""

    def refined(given: Array) -> Array:
        found = solve(given)
        return found + solve(given - matrix @ found)

    return refined


def _equilibrated(matrix: Array) -> Solve:
    """Return the solutions with a matrix whose entries are made of size one in all rows and columns.

    There are many scales that do so: those that begin with none hang on units, and those that make the
    diagonal one on what cancels there. Those are taken with which it is farther from singular.
    """
    starts = np.ones(len(matrix)), np.abs(matrix.diagonal())
    scales = [_equilibrating(matrix, start) for start in starts]
    both = [_Inverted.of(matrix * np.outer(scale, scale)) for scale in scales]
    k = int(np.argmax([one.distance for one in both]))
    return lambda given: np.asarray((both[k].solve((given.T * scales[k]).T).T * scales[k]).T)


@frozen
class _Inverted:
    """The inverse of a square matrix: for factors of small ones another library would have to be loaded.

    Attributes
    ----------
    distance : float
        Of the matrix from a singular one, over its size: one over its condition; 0 where there is no inverse.
    """

    inverse: Array
    distance: float

    @classmethod
    def of(cls, matrix: Array) -> _Inverted:
        with np.errstate(all="ignore"):
            try:
                inverse = np.linalg.inv(matrix)
            except np.linalg.LinAlgError:
                return cls(matrix, 0.0)
            sizes = [np.abs(one).sum(axis=0).max(initial=0.0) for one in (matrix, inverse)]
            condition = float(sizes[0] * sizes[1])
        return cls(inverse, 1.0 / condition if 0.0 < condition < np.inf else 0.0)

    def solve(self, given: Array) -> Array:
        """Return the solutions for columns, or for one.

        Raises
        ------
        numpy.linalg.LinAlgError
            If the matrix is singular.
        """
        if not self.distance:
            raise np.linalg.LinAlgError("Singular matrix")
        return np.asarray(self.inverse @ given)


def _equilibrating(matrix: Array, diagonal: Array) -> Array:
    """Return such scales, beginning with those that make a diagonal (n,) one."""
    scale = np.sqrt(_inverse(diagonal))
    for _ in range(_EQUILIBRATIONS):
        rows = _inverse(np.abs(matrix * scale).max(axis=1, initial=0.0))
        scale = np.where(scale > 0.0, np.sqrt(scale * rows), rows)
    return np.where(scale > 0.0, scale, 1.0)


def _inverse(values: Array) -> Array:
    """Return 1 / values (n,), and zero where these are."""
    return np.divide(1.0, values, out=np.zeros_like(values), where=values > 0.0)
