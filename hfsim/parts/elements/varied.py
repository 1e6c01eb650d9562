"""Energy that is a form in products of a few vectors, with factors of its own at every point."""

from __future__ import annotations

from collections.abc import Hashable
from functools import cached_property

import numpy as np

from hfsim.deck.materials import BeamProperties
from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.frozen import frozen
from hfsim.parts.elements._base import RowLaw, in_turn
from hfsim.parts.elements.continuum import elasticity, strain_pairs


@frozen
class VariedGramLaw(RowLaw):
    """U = 1/2 d^T C d at each point, with d = g - g0, g the products of its vectors, each pair once.

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

    @classmethod
    def green_lagrange(
        cls, rows: Array, volumes: Array, undeformed: Array, properties: BeamProperties
    ) -> VariedGramLaw:
        """Return the energy (21)-(23) summed over places around each point.

        Parameters
        ----------
        rows : ndarray, shape (n_points, n_dim, n_places, n_vectors)
            From the vectors to the deformation gradient at these places, column by column.
        volumes : ndarray, shape (n_points, n_places)
            [m^3].
        undeformed : ndarray, shape (n_points, n_vectors, n_dim)
        properties : BeamProperties
        """
        _, n_dim, places, n = rows.shape
        first, second = np.triu_indices(n)
        off, E = np.where(first == second, 0.0, 1.0), elasticity(properties, n_dim)
        quadratic = np.zeros((len(rows), len(first), len(first)))
        for q in range(places):
            f = rows[:, :, q]
            both = [f[:, i][:, first] * f[:, j][:, second] for i, j in strain_pairs(n_dim)]
            swapped = [f[:, j][:, first] * f[:, i][:, second] for i, j in strain_pairs(n_dim)]
            strains = np.stack([a + off * b for a, b in zip(both, swapped, strict=True)], axis=1)
            strains[:, :n_dim] *= 0.5
            quadratic += strains.swapaxes(1, 2) @ (volumes[:, q, None, None] * (E @ strains))
        reference = np.sum(undeformed[:, first] * undeformed[:, second], axis=-1)
        return cls(quadratic, reference, n)

    @property
    def quartic(self) -> bool:
        """Return True."""
        return True

    @property
    def shared(self) -> Hashable:
        """The number of vectors; points differ in their numbers only."""
        return self.n_vectors

    def in_turn(self, other: VariedGramLaw, points: int) -> VariedGramLaw:
        """Return the law of elements of so many points and of others, point by point."""
        quadratic = in_turn(self.quadratic, other.quadratic, points)
        return VariedGramLaw(quadratic, in_turn(self.reference, other.reference, points), self.n_vectors)

    def joined(self, other: VariedGramLaw) -> VariedGramLaw:
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
        (first, second), (where, squares) = self._pairs, self._entries
        d = np.sum(v[first] * v[second], axis=1).reshape(len(first), len(self.reference), -1)
        d -= self.reference.T[..., None]
        H = np.matmul(self.quadratic, d.swapaxes(0, 1)).swapaxes(0, 1).reshape(len(first), -1)
        H[squares] *= 2.0
        return np.asarray(np.sum(H[where][:, :, None] * v, axis=1))

    def hessian(self, V: Array) -> Array:
        """Return d2U/dV2 [J], shape (..., n_points, n_vectors * n_dim, n_vectors * n_dim)."""
        (first, second), (where, squares) = self._pairs, self._entries
        d, each = self._changes(V), np.arange(len(first))
        slopes = np.zeros((*d.shape, *V.shape[-2:]))
        slopes[..., each, first, :] += V[..., second, :]
        slopes[..., each, second, :] += V[..., first, :]
        slopes = slopes.reshape(*d.shape, -1)
        material = slopes.swapaxes(-1, -2) @ self.quadratic @ slopes
        H = (self.quadratic @ d[..., None])[..., 0]
        H[..., squares] *= 2.0
        return np.asarray(material + np.kron(H[..., where], np.eye(V.shape[-1])))
