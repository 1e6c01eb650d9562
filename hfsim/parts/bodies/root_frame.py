"""The body frame of a line in space that does not roll, and the line's coordinates relative to it.

Vectors of a line are relative to a frame at its root, whose first axis is along the first slope
X_1 = lambda t.  How the frame is turned about t does not matter in one state; rates are those in a frame that
does not roll.  So the frame turns by beta, two numbers: its first axis changes by t' = A (0, beta), and any
vector a in it by (- beta . a_23, beta a_1).  The rates of a line are those of the root's place, of
(lambda, beta) and of all other vectors p in the frame; they stand in the places of the line's vectors.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.parts.bodies.spatial_frame import turned_to

ACROSS = slice(1, 3)
"""Components at right angles to the first axis."""


def spun_by(beta: Array, a: Array) -> Array:
    """Return (- beta . a_23, beta a_1), the rates of vectors (n_batch, ..., 3) in a frame that turns."""
    beta = beta.reshape(*beta.shape[:-1], *(1,) * (a.ndim - beta.ndim), 2)
    along = -np.sum(beta * a[..., ACROSS], axis=-1, keepdims=True)
    return np.concatenate([along, beta * a[..., :1]], axis=-1)


class RootRates(NamedTuple):
    """How a line moves, in its frame.

    Attributes
    ----------
    beta : ndarray, shape (n_batch, 2)
        [rad/s].
    p : ndarray, shape (n_batch, n_vectors, 3)
        Rates of the vectors in the frame.
    bias : ndarray, shape (n_batch, n_vectors, 3)
        Second derivatives of the line's coordinates where those of its absolute vectors are zero.
    """

    beta: Array
    p: Array
    bias: Array


class RootFrame(NamedTuple):
    """Frames of a line in a batch of states.

    Attributes
    ----------
    A : ndarray, shape (n_batch, 3, 3)
        Axes as columns.
    length : ndarray, shape (n_batch, 1)
        lambda, of the first slope.
    p : ndarray, shape (n_batch, n_vectors, 3)
        All vectors in the frame, positions from the root on.
    positions : ndarray, shape (n_vectors,)
        One for positions, zero for slopes.
    """

    A: Array
    length: Array
    p: Array
    positions: Array

    @classmethod
    def of(cls, X: Array, positions: Array) -> RootFrame:
        """Return the frames of absolute vectors, shape (n_batch, n_vectors, 3)."""
        length = np.sqrt(np.sum(X[:, 1] ** 2, axis=-1, keepdims=True))
        along = np.where(X[:, 1, :1] < 0.0, -length, length)
        A = turned_to(X[:, 1] / along, along)
        return cls(A, length, (X - positions[:, None] * X[:, :1]) @ A, positions)

    @property
    def t(self) -> Array:
        """First axis, shape (n_batch, 3)."""
        return self.A[:, :, 0]

    @property
    def v(self) -> Array:
        """Deflections, components before vectors: shape (n_batch, 2, n_vectors - 2)."""
        return self.p[:, 2:, ACROSS].swapaxes(1, 2)

    def relative(self, U: Array) -> tuple[Array, Array]:
        """Return beta (n_batch, m, 2) and rates in the frame from those of absolute vectors.

        The latter, and those in the frame, have shape (n_batch, m, n_vectors, 3).
        """
        p1 = (U - self.positions[:, None] * U[..., :1, :]) @ self.A[:, None]
        beta = p1[..., 1, ACROSS] / self.length[:, None]
        return beta, p1 - spun_by(beta, self.p[:, None])

    def rates(self, U: Array) -> RootRates:
        """Return the rates in the frame from those of the absolute vectors."""
        beta, p1 = (one[:, 0] for one in self.relative(U[:, None]))
        bias = -spun_by(beta, spun_by(beta, self.p)) - 2.0 * spun_by(beta, p1)
        # (lambda'', beta') stand for the second derivative of the first slope
        turning = bias[:, 1, ACROSS] / self.length
        bias -= spun_by(turning, self.p)
        bias[:, 1, ACROSS] = turning
        bias[:, 0] = 0.0
        return RootRates(beta, p1, bias)

    def onto_vectors(self, force: Array) -> Array:
        """Return forces on absolute vectors from those on the line's coordinates, (n_batch, m, n_vectors, 3).

        They do the same work: rates are `rates`, with (lambda, beta) in the place of the first slope.
        """
        p, f = self.p[:, None], force.copy()
        rest, arms = force[:, :, 2:], p[:, :, 2:]
        moment = np.sum(rest[..., ACROSS] * arms[..., :1] - rest[..., :1] * arms[..., ACROSS], axis=2)
        f[:, :, 1, ACROSS] = (force[:, :, 1, ACROSS] - moment) / self.length[:, None]
        f[:, :, 0] -= np.einsum("bmki,k->bmi", f[:, :, 1:], self.positions[1:])
        return np.asarray(f @ self.A[:, None].swapaxes(2, 3))
