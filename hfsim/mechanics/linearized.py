"""Equations of motion linearised at a state, as stiff methods and stability studies need them.

Where the mass matrix is constant they have an analytic derivative (`System.linearized`), dense or sparse;
elsewhere it comes from differences (`by_differences`).  What follows from either stands here and in
`hfsim.mechanics.modes`: the motions that joints allow, the slopes of the accelerations, implicit matrices.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Matrix, dense, factorised, is_sparse, saddle_point

_STEP = 1e-7
"""Step of differences, over what values change by at large: half the digits remain."""
AT_ONCE = 32
"""States that are evaluated together: more of them fall out of the cache."""


@frozen
class Linearized:
    """M y'' + D y' + K y + Phi^T lambda = 0 with Phi y = 0, for small changes y of a state.

    Inertia forces that change with the state (centrifugal and gyroscopic ones) are not in it where it is
    analytic: they never make a problem stiff.

    Attributes
    ----------
    mass, stiffness : Matrix, shape (n, n)
        Dense or sparse alike; the stiffness is symmetric unless following loads make it otherwise.
    damping : Matrix, shape (n, n), or None
        None where nothing dissipates.
    jacobian : Matrix, shape (n_rows, n), or None
        None without constraints.
    inverse_root : ndarray, shape (n, n), or None
        Rows are orthonormal in the metric.  None if matrices are sparse, and where the equations are solved
        for the accelerations already: the mass is one then, and the stiffness any matrix.
    metric : Matrix, shape (n, n)
        The mass or, where that has no inverse, one that is the same on all motions that constraints allow.
    """

    mass: Matrix
    stiffness: Matrix
    damping: Matrix | None
    jacobian: Matrix | None
    inverse_root: Array | None
    metric: Matrix

    @property
    def sparse(self) -> bool:
        """Whether the matrices are sparse."""
        return is_sparse(self.mass)

    @property
    def solved(self) -> bool:
        """Whether the equations are solved for the accelerations, constraints and all."""
        return self.inverse_root is None and not self.sparse

    def dense(self) -> Linearized:
        """Return the same with dense matrices."""
        if not self.sparse:
            return self
        parts = (self.mass, self.stiffness, self.damping, self.jacobian)
        mass, stiffness, damping, jacobian = (None if one is None else dense(one) for one in parts)
        metric = dense(self.metric)
        return Linearized(mass, stiffness, damping, jacobian, rows_of(metric), metric)

    @cached_property
    def _root(self) -> Array:
        """Rows that are orthonormal in the metric."""
        return np.eye(len(self.mass)) if self.inverse_root is None else self.inverse_root

    @cached_property
    def _parted(self) -> tuple[Array, Array]:
        """What joints forbid of these rows, as columns, and an orthonormal basis that begins with that."""
        assert self.jacobian is not None
        forbidden = self._root @ self.jacobian.T
        return forbidden, np.linalg.qr(forbidden, mode="complete")[0]

    @cached_property
    def allowed(self) -> Array:
        """Motions that the constraints allow, as rows, orthonormal in the metric of the mass."""
        if self.jacobian is None:
            return self._root
        forbidden, basis = self._parted
        return np.asarray(basis[:, forbidden.shape[1] :].T @ self._root)

    @cached_property
    def mobility(self) -> Array:
        """The map from forces to accelerations under the constraints, (n, n)."""
        return np.asarray(self.allowed.T @ self.allowed)

    def closing(self) -> Array:
        """Return the smallest accelerations, measured by the mass, that close unit gaps, (n_rows, n)."""
        forbidden, basis = self._parted
        across = basis[:, : forbidden.shape[1]].T
        return np.linalg.solve(across @ forbidden, across @ self._root)

    def slopes(self) -> tuple[Array, Array | None]:
        """Return the derivatives of the accelerations by q and v, (n, n).

        That by v is None where nothing dissipates.
        """
        if self.solved:
            return -self.stiffness, None if self.damping is None else -self.damping
        P = self.mobility
        return -P @ self.stiffness, None if self.damping is None else -P @ self.damping

    def implicit(self, by_q: complex, by_v: complex = 0.0) -> Matrix:
        """Return M + by_q K + by_v D."""
        matrix = self.mass + by_q * self.stiffness
        none = isinstance(by_v, complex | float) and not by_v  # where it is recorded, it may be anything
        return matrix if self.damping is None or none else matrix + by_v * self.damping

    def solver(self, matrix: Matrix) -> Callable[[Array, Array | None], Array]:
        """Return how a matrix, sparse or dense as those here, answers by motions.

        Returns
        -------
        callable
            (forces (..., n), gaps (..., n_rows) or None) -> the motions (..., n) with which the matrix, and
            joints with these gaps, answer.
        """
        if self.jacobian is None:
            plain = factorised(matrix)
            return lambda forces, gaps: plain(forces)
        rows, n = self.jacobian.shape
        solve = factorised(saddle_point(matrix, self.jacobian))

        def motions(forces: Array, gaps: Array | None) -> Array:
            gaps = np.zeros((*forces.shape[:-1], rows)) if gaps is None else gaps
            return solve(np.concatenate([forces, gaps], axis=-1))[..., :n]

        return motions


def rows_of(metric: Array) -> Array:
    """Return motions as rows that are orthonormal in a metric, (n, n)."""
    return np.linalg.inv(np.linalg.cholesky(metric))


def by_differences(
    acceleration: Callable[[Array, Array, Array], Array],
    t: float,
    q: Array,
    v: Array,
    dissipates: bool,
    units: Array | float = 1.0,
) -> Linearized:
    """Linearise accelerations at a state by forward differences, from one call for all columns.

    Parameters
    ----------
    acceleration : callable
        (t, q, v) -> q'' with a leading batch axis on all of them.
    q, v : ndarray, shape (n,)
    dissipates : bool
        Whether to take differences by v too: gyroscopic terms alone never make a problem stiff.
    units : ndarray, shape (n,), or float
        By what coordinates change at large.
    """
    n = len(q)
    moved = np.repeat(np.concatenate([q, v])[None], (2 if dissipates else 1) * n + 1, axis=0)
    least = np.tile(np.broadcast_to(units, n), 2)[: len(moved) - 1]
    steps = _STEP * np.maximum(least, np.abs(moved[-1, : len(moved) - 1]))
    moved[np.arange(len(steps)), np.arange(len(steps))] += steps
    Q, V = np.ascontiguousarray(moved[:, :n]), np.ascontiguousarray(moved[:, n:])
    a = _in_parts(acceleration, t, Q, V)
    slopes = ((a[:-1] - a[-1]) / steps[:, None]).T
    damping = -slopes[:, n:] if dissipates else None
    return Linearized(np.eye(n), -slopes[:, :n], damping, None, None, np.eye(n))


def _in_parts(acceleration: Callable[[Array, Array, Array], Array], t: float, q: Array, v: Array) -> Array:
    """Return accelerations, of as many states at a time each time, the last ones over again."""
    count = -(-len(q) // AT_ONCE)
    size = -(-len(q) // count)
    starts = [min(k * size, len(q) - size) for k in range(count)]
    parts = [acceleration(t + np.zeros(size), q[k : k + size], v[k : k + size]) for k in starts]
    return np.concatenate([*parts[:-1], parts[-1][-(len(q) - (count - 1) * size) :]])
