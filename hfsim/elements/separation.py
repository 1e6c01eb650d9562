r"""Three ways to the stiffness K(p) of eq. (25): direct, separated (39)-(41), and by products of vectors.

Strain enters as :math:`\varepsilon_{ij} = \frac12 (p^T S_{ij} p - \delta_{ij})` with
:math:`S_{ij} = N_{,i}^T N_{,j}` (eq. 18, 26).  In the plane i and j run over 1, 2, and of the three
shear terms the one with i = 1, k(i) = 2 is left.  A centre line has i = j = 1 only, EA in the place
of E_11, and a constant bending stiffness.  All three forms give the same numbers to round-off; they
differ in cost.

Everywhere p holds the nodal components of an element, shape (..., n) with n = 2 * n_vectors; leading
axes are states and elements, the last of them elements.  Force means K p, the derivative of the
strain energy (eq. 24), and tangent its derivative by p.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hfsim.elements._base import Element, GramLaw, Stiffness
from hfsim.shapes import gauss_legendre

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StrainTable:
    """What the integrals of eq. (25) are made of, at the quadrature points of one element.

    Attributes
    ----------
    weights : ndarray, shape (n_points,)
        Volume of each point [m^3]; length [m] for a centre line.
    rows : ndarray, shape (n_directions, n_points, n_vectors)
        Shape rows of N_,1 (and N_,2).
    normal : ndarray, shape (n_directions, n_directions)
        E_ij of eq. (23) [Pa]; EA [N] for a centre line.
    shear : float
        E_44 [Pa]; zero for a centre line.
    bending : ndarray, shape (n_vectors, n_vectors)
        Constant part of the stiffness of one component; zero where the strains do it all.
    """

    weights: Array
    rows: Array
    normal: Array
    shear: float
    bending: Array

    @classmethod
    def of(cls, element: Element, stiffness: Stiffness) -> StrainTable:
        """Return the table of an element with a section (three vectors a node) or of a centre line."""
        if element.per_node == 3:
            return _continuum_table(element, stiffness)
        return _cable_table(element, stiffness)

    @property
    def pairs(self) -> list[tuple[int, int, float]]:
        """Shear terms (i, k(i), E_(3+i)(3+i)), directions counted from zero."""
        return [(0, 1, self.shear)] if len(self.rows) == 2 else []

    def S(self, i: int, j: int) -> Array:
        """Return S_ij of eq. (26) at each point, shape (n_points, n, n)."""
        return np.kron(self.rows[i][:, :, None] * self.rows[j][:, None, :], np.eye(2))


def _continuum_table(element: Element, stiffness: Stiffness) -> StrainTable:
    x, wx = gauss_legendre(5)
    y, wy = gauss_legendre(3)
    places = [(float(xi), float(stiffness.height * (eta - 0.5))) for xi in x for eta in y]
    rows = np.array([[element.shape(*place, by) for place in places] for by in ((1, 0), (0, 1))])
    volume = element.length * stiffness.height * stiffness.width
    normal = np.full((2, 2), stiffness.lame_lambda) + 2.0 * stiffness.lame_mu * np.eye(2)
    flat = np.zeros((rows.shape[2], rows.shape[2]))
    return StrainTable(np.asarray(volume * np.outer(wx, wy).ravel()), rows, normal, stiffness.lame_mu, flat)


def _cable_table(element: Element, stiffness: Stiffness) -> StrainTable:
    x, w = gauss_legendre(2 * element.degree - 1)
    weights = np.asarray(w * element.length)
    rows = np.array([element.shape(float(xi), 0.0, (1, 0)) for xi in x])
    bend = np.array([element.shape(float(xi), 0.0, (2, 0)) for xi in x])
    bending = stiffness.bending * (bend.T * weights) @ bend
    return StrainTable(weights, rows[None], np.array([[stiffness.axial]]), 0.0, np.asarray(bending))


@dataclass(frozen=True)
class DirectStiffness:
    """K(p) by quadrature at every call, eq. (25)/(27).

    The shape rows are looked up; what depends on p, the gradient vectors N_,i p and their products,
    is evaluated at the quadrature points each time.
    """

    table: StrainTable

    @classmethod
    def of(cls, element: Element, stiffness: Stiffness) -> DirectStiffness:
        """Return the direct form of an element."""
        return cls(StrainTable.of(element, stiffness))

    def _gradients(self, p: Array) -> list[Array]:
        """Return N_,i p for each direction, shape (..., n_points, 2) each."""
        nodes = p.reshape(*p.shape[:-1], -1, 2)
        return [rows @ nodes for rows in self.table.rows]

    def stiffness(self, p: Array) -> Array:
        """Return K, shape (..., n, n)."""
        return _both_components(self._one_component(self._gradients(p)))

    def _one_component(self, gradients: list[Array]) -> Array:
        table = self.table
        excess = np.stack([np.sum(g * g, axis=-1) - 1.0 for g in gradients], axis=-1)
        stress = 0.5 * excess @ table.normal * table.weights[:, None]
        K = np.broadcast_to(table.bending, (*excess.shape[:-2], *table.bending.shape)).copy()
        for i, rows in enumerate(table.rows):
            K += (rows.T * stress[..., None, :, i]) @ rows
        for i, k, modulus in table.pairs:
            stress_ik = modulus * table.weights * np.sum(gradients[i] * gradients[k], axis=-1)
            mixed = (table.rows[i].T * stress_ik[..., None, :]) @ table.rows[k]
            K += mixed + mixed.swapaxes(-1, -2)
        return K

    def force(self, p: Array) -> Array:
        """Return K p, shape (..., n)."""
        nodes = p.reshape(*p.shape[:-1], -1, 2)
        return np.asarray((self._one_component(self._gradients(p)) @ nodes).reshape(p.shape))

    def tangent(self, p: Array) -> Array:
        """Return d(K p)/dp, shape (..., n, n): K plus E_ij (S_ii p)(S_jj p)^T and its like for shear."""
        table, gradients = self.table, self._gradients(p)
        T = _both_components(self._one_component(gradients))
        rates = [_dyads(rows, g) for rows, g in zip(table.rows, gradients, strict=True)]
        for i, first in enumerate(rates):
            for j, second in enumerate(rates):
                T += first.swapaxes(-1, -2) @ (second * (table.normal[i, j] * table.weights)[:, None])
        for i, k, modulus in table.pairs:
            rate = _dyads(table.rows[i], gradients[k]) + _dyads(table.rows[k], gradients[i])
            T += rate.swapaxes(-1, -2) @ (rate * (modulus * table.weights)[:, None])
        return T


def _dyads(rows: Array, g: Array) -> Array:
    """Return S_ij p at each point, shape (..., n_points, n), from the rows of N_,i and N_,j p."""
    return np.asarray((rows[..., None] * g[..., None, :]).reshape(*g.shape[:-1], -1))


def _both_components(K: Array) -> Array:
    """Return the matrix over all components from that of one component."""
    full = K[..., :, None, :, None] * np.eye(2)[:, None, :]
    n = 2 * K.shape[-1]
    return np.asarray(full.reshape(*K.shape[:-2], n, n))


@dataclass(frozen=True)
class SeparatedStiffness:
    """K(a, b) = p^T C_ab p + c_ab with matrices computed once, eq. (39)-(41).

    Attributes
    ----------
    C : ndarray, shape (n, n, n, n)
        C[a, b] is the matrix C_ab of eq. (40).
    c : ndarray, shape (n, n)
        c_ab of eq. (41).
    """

    C: Array
    c: Array

    @classmethod
    def of(cls, element: Element, stiffness: Stiffness) -> SeparatedStiffness:
        """Return the separated form of an element."""
        table = StrainTable.of(element, stiffness)
        n = 2 * table.rows.shape[2]
        C, c = np.zeros((n, n, n, n)), np.asarray(np.kron(table.bending, np.eye(2)))
        for i in range(len(table.rows)):
            S_ii = table.S(i, i)
            for j in range(len(table.rows)):
                weight = 0.5 * table.normal[i, j] * table.weights
                C += np.tensordot(weight[:, None, None] * S_ii, table.S(j, j), axes=(0, 0))
                c -= np.tensordot(weight, S_ii, axes=1)
        for i, k, modulus in table.pairs:
            S_ik = table.S(i, k)
            both = (modulus * table.weights)[:, None, None] * (S_ik + S_ik.swapaxes(1, 2))
            C += np.tensordot(both, S_ik, axes=(0, 0))
        return cls(C, c)

    @cached_property
    def _flat(self) -> Array:
        """C as a matrix from the products p_c p_d to the entries (a, b)."""
        n = len(self.c)
        return np.ascontiguousarray(self.C.reshape(n * n, n * n).T)

    @cached_property
    def _change(self) -> Array:
        """Matrix from the products p_b p_d to the entries (a, c) of the change of K times p."""
        n = len(self.c)
        even = self.C + self.C.swapaxes(2, 3)
        return np.ascontiguousarray(even.transpose(0, 2, 1, 3).reshape(n * n, n * n).T)

    def _map(self, p: Array, matrix: Array) -> Array:
        products = (p[..., :, None] * p[..., None, :]).reshape(*p.shape[:-1], -1)
        return np.asarray((products @ matrix).reshape(*p.shape, p.shape[-1]))

    def stiffness(self, p: Array) -> Array:
        """Return K, shape (..., n, n)."""
        return self._map(p, self._flat) + self.c

    def force(self, p: Array) -> Array:
        """Return K p, shape (..., n)."""
        return np.asarray((self.stiffness(p) @ p[..., None])[..., 0])

    def tangent(self, p: Array) -> Array:
        """Return d(K p)/dp, shape (..., n, n)."""
        return self.stiffness(p) + self._map(p, self._change)


@dataclass(frozen=True)
class GramStiffness:
    """The same from `GramLaw`: K depends on p through the products of difference vectors only.

    Attributes
    ----------
    law : GramLaw
        Of one element, or of as many as the last leading axis of p has.
    differences : ndarray, shape (n_differences, n_vectors)
    """

    law: GramLaw
    differences: Array

    @classmethod
    def of(cls, element: Element, stiffness: Stiffness, count: int = 1) -> GramStiffness:
        """Return the form of ``count`` equal elements.

        Raises
        ------
        TypeError
            If the element's energy is not a polynomial.
        """
        law = element.law(stiffness, count)
        if not isinstance(law, GramLaw):
            raise TypeError(f"{type(element).__name__} has no energy in products of vectors")
        return cls(law, np.asarray(element.differences()))

    def _vectors(self, p: Array) -> Array:
        return np.asarray(self.differences @ p.reshape(*p.shape[:-1], -1, 2))

    def stiffness(self, p: Array) -> Array:
        """Return K, shape (..., n, n)."""
        V, law = self._vectors(p), self.law
        G = V @ V.swapaxes(-1, -2)
        flat = G.reshape(*G.shape[:-2], -1) @ law.quadratic + law.linear_at_zero
        H = (2.0 * law.scale[:, None] * flat).reshape(G.shape)
        return _both_components(self.differences.T @ H @ self.differences)

    def force(self, p: Array) -> Array:
        """Return K p, shape (..., n)."""
        return np.asarray((self.differences.T @ self.law.gradient(self._vectors(p))).reshape(p.shape))

    def tangent(self, p: Array) -> Array:
        """Return d(K p)/dp, shape (..., n, n)."""
        D = np.kron(self.differences, np.eye(2))
        return np.asarray(D.T @ self.law.hessian(self._vectors(p)) @ D)


STIFFNESS_FORMS = {"direct": DirectStiffness, "separated": SeparatedStiffness, "products": GramStiffness}
"""The forms by name, as tests and benchmarks loop over them."""
