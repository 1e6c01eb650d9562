"""The foreshortening of a deflection, 1/2 v^T H(x) v with H(x) = int_0^x N'^T N', element by element.

What elements before a place add to it is the same for all that is beyond.  So sums along the beam take the
place of full matrices: all that is asked for takes time in proportion to the elements.  Equations are solved
so too: the axial coordinate of a node is w = u + 1/2 v^T H v, where u is how far it really goes, and in u and
v the mass matrix of an element is one of its own coordinates.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.chains import solve_chain
from hfsim.maths.frozen import frozen
from hfsim.maths.shapes import gauss_legendre
from hfsim.maths.traced import changeable
from hfsim.parts.bodies.mesh import BeamMesh


@frozen
class Shortening:
    """Sums over the quadrature points of a beam that is fixed at its root.

    Coordinates of a deflection are those of all vectors of the mesh but the first two, those of w of all but
    the first one; k is the number of vectors of an element, P that of its points.

    Attributes
    ----------
    xi, weight : ndarray, shape (P,)
        Places in the unit interval of an element, and weights.
    deflections : int
        One in the plane, two in space.
    """

    mesh: BeamMesh
    xi: Array
    weight: Array
    deflections: int

    @cached_property
    def shape(self) -> Array:
        """Shapes of an element at its points, (P, k)."""
        return self._rows(self.xi, 0)

    def _rows(self, xi: Array, derivative: int) -> Array:
        """Return shapes of the first element, or their derivative by x, (len(xi), k)."""
        return np.asarray(self.mesh.element.shape(xi, 0.0, (derivative, 0)))

    def bending(self, xi: float) -> Array:
        """Return the share of an element in H from its beginning to a place in the unit interval, (k, k)."""
        nodes, weights = gauss_legendre(self.mesh.element.degree)
        slopes = self._rows(nodes * xi, 1)
        return np.asarray((slopes.T * (weights * xi * self.mesh.element.length)) @ slopes)

    @cached_property
    def _bendings(self) -> Array:
        """Those up to the points and the end of an element, side by side: (k, (P + 1) k)."""
        every = np.array([self.bending(float(xi)) for xi in (*self.xi, 1.0)])
        return np.ascontiguousarray(every.transpose(1, 0, 2).reshape(every.shape[1], -1))

    @cached_property
    def mass(self) -> Array:
        """Mass of each point, (n_elements, P) [kg]."""
        le, count = self.mesh.element.length, self.mesh.count
        x = (np.arange(count)[:, None] + self.xi).ravel() * le
        per_length = np.broadcast_to(self.mesh.at(x).mass_per_length, x.shape)
        return np.asarray(per_length.reshape(count, -1) * self.weight * le)

    @cached_property
    def _before(self) -> Array:
        """Which elements (rows) are before which (columns)."""
        return np.triu(np.ones((self.mesh.count,) * 2), 1)

    @cached_property
    def _up_to(self) -> Array:
        """Which elements (rows) end before or with which (columns)."""
        return np.triu(np.ones((self.mesh.count,) * 2))

    # ------------------------------------------------------------------ between beam and elements

    def of_elements(self, v: Array) -> Array:
        """Return the coordinates (..., n) element by element, (..., n_elements, k)."""
        stride, count = self.mesh.element.stride, self.mesh.count
        lacking = np.zeros((*v.shape[:-1], (count + 1) * stride - v.shape[-1]))
        nodes = np.concatenate([lacking, v], axis=-1).reshape(*v.shape[:-1], count + 1, stride)
        return np.concatenate([nodes[..., :-1, -2:], nodes[..., 1:, :]], axis=-1)

    def onto(self, own: Array, n: int) -> Array:
        """Return the sums (..., n) of what elements (..., n_elements, k) have for their coordinates."""
        stride, count = self.mesh.element.stride, self.mesh.count
        nodes = np.zeros((*own.shape[:-2], count + 1, stride))
        nodes[..., 1:, :] = own[..., 2:]
        nodes[..., :-1, -2:] += own[..., :2]
        return nodes.reshape(*own.shape[:-2], -1)[..., -n:]

    def values(self, own: Array) -> Array:
        """Return values at the points (..., n_points) of coordinates of elements."""
        return self._flat(own @ self.shape.T)

    def pulled(self, force: Array, n: int) -> Array:
        """Return forces on n coordinates of forces at the points (..., n_points)."""
        return self.onto(self._by_element(force) @ self.shape, n)

    def _flat(self, a: Array) -> Array:
        return a.reshape(*a.shape[:-2], -1)

    def _by_element(self, a: Array) -> Array:
        return a.reshape(*a.shape[:-1], self.mesh.count, -1)

    # ------------------------------------------------------------------ foreshortening

    def bent(self, own: Array) -> Array:
        """Return shares in H v of the elements, up to their points and ends: (..., n_elements, P + 1, k)."""
        return np.asarray((own @ self._bendings).reshape(*own.shape[:-1], -1, own.shape[-1]))

    def short(self, bent: Array, own: Array) -> Array:
        """Return u^T H v at the points, (n_batch, m, n_points), of H v and coordinates u of elements.

        H v has shape (n_batch, n_elements, P + 1, k), u has (n_batch, m, n_elements, k).
        """
        shares = (bent @ own.transpose(0, 2, 3, 1)).transpose(0, 3, 1, 2)
        before = shares[..., -1] @ self._before
        return self._flat(shares[..., :-1] + before[..., None])

    def weighted(self, force: Array, bent: Array, n: int) -> Array:
        """Return the sums of H v over the points, with weights (n_batch, m, n_points): (n_batch, m, n)."""
        each = self._by_element(force)
        beyond = each.sum(axis=-1) @ self._before.T
        weights = np.concatenate([each, beyond[..., None]], axis=-1)
        return self.onto((weights.swapaxes(1, 2) @ bent).swapaxes(1, 2), n)

    # ------------------------------------------------------------------ solution

    def solver(self, bent: Sequence[Array]) -> Callable[[Array], Array]:
        """Return what solves with the mass matrix of deflections and w that the root holds.

        Parameters
        ----------
        bent : sequence of ndarray, shape (n_batch, n_elements, P + 1, k)
            H v of each deflection.

        Returns
        -------
        callable
            Forces -> accelerations, both (n_batch, n_columns, n_vectors - 2, 1 + n_deflections): w, then the
            deflections.
        """
        blocks, couplings = self._chain(bent)
        ends = [one[:, :, -1, :, None] for one in bent]
        stride, count, C = self.mesh.element.stride, self.mesh.count, 1 + self.deflections

        def solve(force: Array) -> Array:
            b, m = force.shape[:2]
            right = changeable(force.reshape(b, m, count, stride * C).transpose(0, 2, 3, 1))
            each = right.reshape(b, count, stride, C, m)
            pulled = (self._up_to @ each[:, :, -2, 0])[:, :, None]
            for c, end in enumerate(ends):
                each[:, :, :, 1 + c] += pulled * end[:, :, 2:]
                each[:, :-1, -2:, 1 + c] += (pulled * end[:, :, :2])[:, 1:]
            found = solve_chain(blocks, couplings, right)
            each = found.reshape(b, count, stride, C, m)
            moved = np.zeros((b, count, m))
            for c, end in enumerate(ends):
                moved += np.sum(end[:, :, 2:] * each[:, :, :, 1 + c], axis=2)
                moved[:, 1:] += np.sum(end[:, 1:, :2] * each[:, :-1, -2:, 1 + c], axis=2)
            each[:, :, -2, 0] += self._up_to.T @ moved
            return found.transpose(0, 3, 1, 2).reshape(force.shape)

        return solve

    def _chain(self, bent: Sequence[Array]) -> tuple[Array, Array]:
        """Return the mass matrix in u and v: blocks of the nodes beyond the root, and couplings."""
        N, m, b = self.shape, self.mass[:, :, None], len(bent[0])
        along = [np.broadcast_to(N, (b, len(m), *N.shape))]
        along += [N[:, -2, None] * one[:, :, -1:] - one[:, :, :-1] for one in bent]
        rows = np.stack(along, axis=-1).reshape(b, *m.shape[:2], -1)
        matrix = rows.swapaxes(2, 3) @ (rows * m) + self._across
        node = 2 * (1 + self.deflections)
        rest = matrix.shape[-1] - node
        blocks = changeable(matrix[..., node:, node:])
        blocks[:, :-1, -node:, -node:] += matrix[:, 1:, :node, :node]
        couplings = np.zeros((b, len(m) - 1, rest, rest))
        couplings[..., -node:, :] = matrix[:, 1:, :node, node:]
        return blocks, couplings

    @cached_property
    def _across(self) -> Array:
        """What motions across the beam add to the mass matrices of elements, as `_chain` orders them."""
        own = self.shape.T @ (self.shape * self.mass[:, :, None])
        return np.array([np.kron(one, np.diag([0.0, *[1.0] * self.deflections])) for one in own])
