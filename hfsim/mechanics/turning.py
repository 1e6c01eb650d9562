"""Steady rotation: all bodies turn as one about an axis, and none of them changes its shape.

Rates are then an affine function of the absolute coordinates, u = W x + w: vectors turn; of coordinates
relative to a body frame only the frame's place and angle change.  Seen from axes that turn as well, the scene
stands still in an equilibrium of its forces with those of inertia, -M u', about which
`hfsim.mechanics.small_motions` are those of equations with constant coefficients.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.matrices import Entries, Matrix, assemble
from hfsim.maths.rotations import spun
from hfsim.mechanics.pose import Twist

if TYPE_CHECKING:
    from hfsim.mechanics.body import Body


@dataclass(frozen=True, eq=False)
class Turning:
    """Rigid motion of everything: u = W x + w + travel.

    Attributes
    ----------
    matrix : Matrix, shape (n_x, n_x)
        W [rad/s].
    shift : ndarray, shape (n_x,)
        w, that of a rotation about an axis that stands still.
    travel : ndarray, shape (n_x,)
        Rates by which the axis itself moves on, evenly.
    spin, centre, velocity : ndarray, shape (n_spin,), (n_dim,), (n_dim,)
        Angular velocity [rad/s], a point of the axis [m], and its velocity [m/s].
    """

    matrix: Matrix
    shift: Array
    travel: Array
    spin: Array
    centre: Array
    velocity: Array

    @classmethod
    def of(
        cls,
        bodies: Iterable[Body],
        spin: Sequence[float] | Array,
        centre: Sequence[float] | Array,
        sparse: bool = False,
        velocity: Sequence[float] | Array | None = None,
    ) -> Turning:
        """Return the rotation of bodies whose coordinates stand one after the other.

        Parameters
        ----------
        bodies : iterable of Body
        spin : array_like, shape (n_spin,)
            Angular velocity in ground axes: one number in the plane [rad/s].
        centre : array_like, shape (n_dim,)
            A point of the axis [m].
        sparse : bool
            Whether W is to be sparse.
        velocity : array_like, shape (n_dim,), optional
            Of that point [m/s].
        """
        spin, centre = np.asarray(spin, dtype=float), np.asarray(centre, dtype=float)
        moving = np.zeros(len(centre)) if velocity is None else np.asarray(velocity, dtype=float)
        about, along = Twist(-spun(spin, centre), spin), Twist(moving, 0.0 * spin)
        parts = [(body.carried_along(about), body.carried_along(along)[1]) for body in bodies]
        shift = np.concatenate([np.zeros(0), *(own for (_, own), _ in parts)])
        travel = np.concatenate([np.zeros(0), *(own for _, own in parts)])
        matrix = assemble([entries for (entries, _), _ in parts], (len(shift), len(shift)), sparse)
        return cls(matrix, shift, travel, spin, centre, moving)

    def turned_only(self, x: Array) -> Array:
        """Return W x + w, shape (n_batch, n_x), at coordinates (n_batch, n_x)."""
        return np.asarray((self.matrix @ x.T).T + self.shift)

    def rates(self, x: Array) -> Array:
        """Return the rates u, shape (n_batch, n_x), of coordinates (n_batch, n_x)."""
        return self.turned_only(x) + self.travel

    def accelerations(self, x: Array) -> Array:
        """Return u', shape (n_batch, n_x); the force of inertia is -M(x) u'.

        What else rates do to bodies whose mass matrix depends on their coordinates is among the forces of
        the system at these rates.
        """
        return np.asarray((self.matrix @ self.turned_only(x).T).T)

    def turned(self, x: Array, angle: float) -> Array:
        """Return coordinates (n_batch, n_x) after a turn by so many times the spin [s], without travel."""
        from scipy.sparse.linalg import expm_multiply

        whole = _bordered(self.matrix, self.shift)
        points = np.concatenate([x.T, np.ones((1, len(x)))])
        return np.asarray(expm_multiply(angle * whole, points)[:-1].T)


def _bordered(matrix: Matrix, shift: Array) -> Matrix:
    """Return [[W, w], [0, 0]]."""
    n = len(shift)
    rows, columns = np.arange(n), np.full(n, n)
    own = matrix.tocoo() if not isinstance(matrix, np.ndarray) else None
    r, c = (own.row, own.col) if own is not None else np.nonzero(matrix)
    values = own.data if own is not None else matrix[r, c]
    return assemble([Entries(r, c, values), Entries(rows, columns, shift)], (n + 1, n + 1), sparse=True)
