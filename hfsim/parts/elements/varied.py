"""Energy that is a form in products of a few vectors, with factors of its own at every point."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace
from functools import cached_property
from typing import ClassVar, Self

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.frozen import frozen
from hfsim.parts.elements._base import in_turn


@frozen
class VariedGramLaw:
    """U = 1/2 d^T C d at each point, with d = g - g0, g the products of its vectors, each pair once.

    With retardation times in C the same form is a damping: of rates d' forces C d', on which they work.

    Attributes
    ----------
    quadratic : ndarray, shape (n_points, n_pairs, n_pairs)
        C [J].
    reference : ndarray, shape (n_points, n_pairs)
        g0, of the undeformed body.
    n_vectors : int
        At a point.
    """

    quadratic: Array
    reference: Array
    n_vectors: int
    quartic: ClassVar[bool] = True

    @property
    def shared(self) -> Hashable:
        """The number of vectors; points differ in their numbers only."""
        return self.n_vectors

    def in_turn(self, other: VariedGramLaw, points: int) -> Self:
        """Return the law of elements of so many points and of others, point by point."""
        pairs = (self.quadratic, other.quadratic), (self.reference, other.reference)
        quadratic, reference = (in_turn(*pair, points) for pair in pairs)
        return replace(self, quadratic=quadratic, reference=reference)

    def joined(self, other: VariedGramLaw) -> Self:
        """Return the law of this one's points followed by the other's."""
        return self.in_turn(other, 1)

    @cached_property
    def _pairs(self) -> tuple[IntArray, IntArray]:
        return np.triu_indices(self.n_vectors)

    @cached_property
    def _entries(self) -> tuple[IntArray, IntArray]:
        """Which pair each entry of G is, shape (n_vectors, n_vectors), and which are squares."""
        first, second = self._pairs
        where = np.zeros((self.n_vectors, self.n_vectors), dtype=np.intp)
        where[first, second] = where[second, first] = np.arange(len(first))
        return where, np.diagonal(where)

    def _changes(self, V: Array) -> Array:
        """Return d, shape (..., n_points, n_pairs)."""
        first, second = self._pairs
        return np.asarray(np.sum(V[..., first, :] * V[..., second, :], axis=-1) - self.reference)

    def energy(self, V: Array) -> Array:
        """Return the stored energy [J], shape (..., n_points)."""
        d = self._changes(V)
        return np.asarray(0.5 * np.sum((d[..., None, :] @ self.quadratic)[..., 0, :] * d, axis=-1))

    def pull(self, v: Array) -> Array:
        """Return dU/dV [J] for `component_rows`, same shape."""
        return self.pushed(v, np.matmul(self.quadratic, self.changes_of(v).swapaxes(0, 1)))

    def changes_of(self, v: Array) -> Array:
        """Return d of `component_rows`, (n_pairs, n_points, n_states)."""
        first, second = self._pairs
        d = np.sum(v[first] * v[second], axis=1).reshape(len(first), len(self.reference), -1)
        d -= self.reference.T[..., None]
        return np.asarray(d)

    def pushed(self, v: Array, h: Array) -> Array:
        """Return what h by d, (n_points, n_pairs, n_states) [J], is by the vectors, same shape as v.

        Overwrites h.
        """
        where, squares = self._entries
        H = h.swapaxes(0, 1).reshape(h.shape[1], -1)
        H[squares] *= 2.0
        return np.asarray(np.sum(H[where][:, :, None] * v, axis=1))

    def rates_of(self, v: Array, w: Array) -> Array:
        """Return by what d changes at rates w of the vectors v, (n_pairs, n_points, n_states)."""
        first, second = self._pairs
        rates = np.sum(v[first] * w[second] + w[first] * v[second], axis=1)
        return np.asarray(rates.reshape(len(first), len(self.reference), -1))

    def hessian(self, V: Array) -> Array:
        """Return d2U/dV2 [J], shape (..., n_points, n_vectors * n_dim, n_vectors * n_dim)."""
        slopes = self.product_slopes(V)
        material = slopes.swapaxes(-1, -2) @ self.quadratic @ slopes
        h = (self.quadratic @ self._changes(V)[..., None])[..., 0]
        return np.asarray(material + self.bent_by(h, V.shape[-1]))

    def product_slopes(self, V: Array) -> Array:
        """Return dd/dV, shape (..., n_points, n_pairs, n_vectors * n_dim)."""
        (first, second), each = self._pairs, np.arange(len(self._pairs[0]))
        slopes = np.zeros((*V.shape[:-2], len(each), *V.shape[-2:]))
        slopes[..., each, first, :] += V[..., second, :]
        slopes[..., each, second, :] += V[..., first, :]
        return slopes.reshape(*slopes.shape[:-2], -1)

    def bent_by(self, h: Array, n_dim: int) -> Array:
        """Return the derivative of `pushed` by the vectors where h (..., n_points, n_pairs) stays."""
        where, squares = self._entries
        H = h.copy()
        H[..., squares] *= 2.0
        return np.kron(H[..., where], np.eye(n_dim))
