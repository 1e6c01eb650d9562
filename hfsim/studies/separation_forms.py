r"""Ways to the stiffness K(p) of eq. (25): direct, separated (39)-(41), and by products of vectors.

Strain enters as :math:`\varepsilon_{ij} = \frac12 (p^T S_{ij} p - \delta_{ij})` with
:math:`S_{ij} = N_{,i}^T N_{,j}` (eq. 18, 26).  In the plane i and j run over 1, 2, and of the three
shear terms the one with i = 1, k(i) = 2 is left.  A centre line has i = j = 1 only, EA in the place
of E_11, and a constant bending stiffness.  All forms give the same numbers to round-off; they
differ in cost.

Everywhere p holds the nodal components of elements as columns, shape (n, n_columns) with n = 2 * n_vectors:
all elements in all states side by side, so that operations run along whole rows of memory.  Force means
K p, the derivative of the strain energy (eq. 24), and tangent its derivative by p.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from hfsim.maths.arrays import Array
from hfsim.maths.shapes import gauss_legendre
from hfsim.parts.elements._base import (
    ElasticLaw,
    Element,
    GramLaw,
    QuadraticMap,
    RowLaw,
    Stiffness,
    join_laws,
)

_FEW = 64
"""Columns up to which calls cost more than operations."""


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

    @cached_property
    def unit(self) -> Array:
        """What p^T A_r p is in a rigid motion: one for normal strains, zero for shear, shape (n_strains,)."""
        return np.array([1.0] * len(self.rows) + [0.0] * len(self.pairs))

    @cached_property
    def constant(self) -> Array:
        """Entries of the constant part over all components, shape (n * n,)."""
        return _both_components(self.bending).ravel()

    @cached_property
    def elasticity(self) -> Array:
        """Coefficients E of eq. (22) in the plane, shape (n_strains, n_strains)."""
        E = np.zeros((len(self.unit), len(self.unit)))
        E[: len(self.rows), : len(self.rows)] = self.normal
        for at, (_, _, modulus) in enumerate(self.pairs, start=len(self.rows)):
            E[at, at] = modulus
        return E

    def S(self, i: int, j: int) -> Array:
        """Return S_ij of eq. (26) at each point, shape (n_points, n, n)."""
        return _both_components(self.rows[i][:, :, None] * self.rows[j][:, None, :])


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


class StiffnessForm(Protocol):
    """One way to the stiffness of an element; p has shape (n, n_columns)."""

    @classmethod
    def of(cls, element: Element, stiffness: Stiffness) -> Self:
        """Return the form of an element."""

    def stiffness(self, p: Array) -> Array:
        """Return K, shape (n_columns, n, n)."""

    def force(self, p: Array) -> Array:
        """Return K p, shape (n, n_columns)."""

    def tangent(self, p: Array) -> Array:
        """Return d(K p)/dp, shape (n_columns, n, n)."""

    def force_and_tangent(self, p: Array) -> tuple[Array, Array]:
        """Return both of the above; what they have in common is computed once."""


def _times(K: Array, p: Array) -> Array:
    return np.asarray((K @ p[..., None])[..., 0])


@dataclass(frozen=True)
class DirectStiffness:
    r"""K(p) as eq. (25)/(27) says: every entry by quadrature at every call.

    With :math:`A_r = S_{11}, S_{22}, S_{12} + S_{21}` and the elastic coefficients E_rs of eq. (22)
    in the plane, the integrand is :math:`\frac12 (p^T A_r p - 1_r) E_{rs} A_s`.  Shape rows are looked
    up; the matrices S_ij, the strains and the entries are computed each time, for all elements together.
    """

    table: StrainTable

    @classmethod
    def of(cls, element: Element, stiffness: Stiffness) -> DirectStiffness:
        """Return the direct form of an element."""
        return cls(StrainTable.of(element, stiffness))

    def _matrices(self) -> Array:
        """Return A_r at each point, shape (n_strains * n_points, n, n)."""
        table = self.table
        normal = [table.S(i, i) for i in range(len(table.rows))]
        mixed = [table.S(i, k) for i, k, _ in table.pairs]
        return np.concatenate([*normal, *(S + S.swapaxes(1, 2) for S in mixed)])

    def _weighted(self, squares: Array) -> Array:
        """Return the factor of each A_r in K from p^T A_r p, shape (n_strains * n_points, n_columns)."""
        table = self.table
        strain = 0.5 * (squares - np.repeat(table.unit, len(table.weights))[:, None])
        stress = table.elasticity.dot(strain.reshape(len(table.unit), -1))
        stress = stress.reshape(len(table.unit), len(table.weights), -1)
        stress *= table.weights[:, None]
        return np.asarray(stress.reshape(squares.shape))

    def _evaluate(self, p: Array) -> tuple[Array, Array]:
        """Return K and A_r p, shape (n_columns, n_strains * n_points, n), for p of shape (n_columns, n)."""
        table, A, n = self.table, self._matrices(), p.shape[-1]
        Ap = (p @ A.reshape(-1, n).T).reshape(*p.shape[:-1], len(A), n)
        K = self._weighted(np.asarray((Ap @ p[..., None])[..., 0]).T).T @ A.reshape(len(A), n * n)
        K += table.constant
        return K.reshape(*p.shape, n), Ap

    def stiffness(self, p: Array) -> Array:
        """Return K, shape (n_columns, n, n)."""
        return self._evaluate(np.ascontiguousarray(p.T))[0]

    def force(self, p: Array) -> Array:
        """Return K p, shape (n, n_columns)."""
        A, n = self._matrices(), len(p)
        Ap = A.reshape(-1, n).dot(p).reshape(len(A), *p.shape)
        K = A.reshape(len(A), n * n).T.dot(self._weighted(np.einsum("ran,an->rn", Ap, p)))
        K += self.table.constant[:, None]
        return np.asarray(np.einsum("abn,bn->an", K.reshape(n, *p.shape), p))

    def tangent(self, p: Array) -> Array:
        """Return d(K p)/dp, shape (n_columns, n, n): K plus E_rs (A_r p)(A_s p)^T."""
        return self.force_and_tangent(p)[1]

    def force_and_tangent(self, p: Array) -> tuple[Array, Array]:
        """Return force and tangent."""
        table, p = self.table, np.ascontiguousarray(p.T)
        K, Ap = self._evaluate(p)
        stressed = (table.elasticity @ Ap.reshape(*p.shape[:-1], len(table.unit), -1)).reshape(Ap.shape)
        stressed *= np.tile(table.weights, len(table.unit))[:, None]
        return _times(K, p).T, K + Ap.swapaxes(-1, -2) @ stressed


@dataclass(frozen=True)
class TabulatedStiffness(DirectStiffness):
    """The same quadrature with the matrices S_ij kept at every point: all that can be, without (39)-(41)."""

    @classmethod
    def of(cls, element: Element, stiffness: Stiffness) -> TabulatedStiffness:
        """Return the tabulated form of an element."""
        return cls(StrainTable.of(element, stiffness))

    @cached_property
    def _kept(self) -> Array:
        return super()._matrices()

    def _matrices(self) -> Array:
        return self._kept


def _both_components(K: Array) -> Array:
    """Return the matrix over all components from that of one component."""
    full = K[..., :, None, :, None] * np.eye(2)[:, None, :]
    n = 2 * K.shape[-1]
    return np.asarray(full.reshape(*K.shape[:-2], n, n))


def _alike(rows: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return a row of each kind of equal rows, and the kind of each row; equal to round-off."""
    kinds = np.round(rows / (np.abs(rows).max(axis=0) + np.finfo(float).tiny), 12)
    _, first, kind = np.unique(kinds, axis=0, return_index=True, return_inverse=True)
    return first, kind.ravel()


@dataclass(frozen=True)
class _Distinct:
    """What differs among the entries of K: equal ones need computing once, vanishing ones never.

    Attributes
    ----------
    factors : ndarray of int, shape (2 * n_products + most in a row * n,)
        Rows of p that are multiplied: both factors of the products, and p_b for the entries of K.
    matrix : ndarray, shape (n_distinct, n_products / together)
    constant : ndarray, shape (n_distinct, 1)
    entry : ndarray of int, shape (most in a row * n,)
        Of the k-th entry of each row of K that does not vanish, the number among the distinct ones.
    together : int
        Products that enter K with the same factor, as those of x and of y components do; they stand in so
        many blocks.
    """

    factors: NDArray[np.intp]
    matrix: Array
    constant: Array
    entry: NDArray[np.intp]
    together: int

    @classmethod
    def of(
        cls, first: NDArray[np.intp], second: NDArray[np.intp], matrix: Array, constant: Array
    ) -> _Distinct:
        """Return what differs of the entries matrix^T (products) + constant of a square K."""
        n = round(math.sqrt(len(constant)))
        whole = np.concatenate([matrix, constant[None]])
        where, kind = _alike(whole.T)
        there = np.any(whole != 0.0, axis=0).reshape(n, n)
        column = np.argsort(~there, axis=1, kind="stable")[:, : there.sum(axis=1).max()]
        used, entry = np.unique(np.take_along_axis(kind.reshape(n, n), column, axis=1), return_inverse=True)
        where = where[used]
        group = _alike(matrix)[1]
        together = int(np.gcd.reduce(np.bincount(group)))
        order = np.argsort(group, kind="stable").reshape(-1, together).T.ravel()
        once = order[: len(order) // together]
        return cls(
            factors=np.concatenate([first[order], second[order], column.T.ravel()]),
            matrix=np.ascontiguousarray(matrix[np.ix_(once, where)].T),
            constant=constant[where, None],
            entry=entry.reshape(n, -1).T.ravel(),
            together=together,
        )

    @cached_property
    def _spread(self) -> Array:
        """The matrix over all products: with few columns one call less counts for more."""
        return np.tile(self.matrix, self.together)

    def force(self, p: Array) -> Array:
        """Return K p, shape (n, n_columns)."""
        factors, size = p.take(self.factors, axis=0), self.together * self.matrix.shape[1]
        products = factors[:size]
        products *= factors[size : 2 * size]
        if self.together > 1 and p.shape[1] > _FEW:
            products = np.add.reduce(products.reshape(self.together, -1, p.shape[1]), axis=0)
            K = self.matrix.dot(products)
        else:
            K = self._spread.dot(products)
        K += self.constant
        pull = factors[2 * size :]
        pull *= K.take(self.entry, axis=0)
        return np.asarray(np.add.reduce(pull.reshape(-1, *p.shape), axis=0))


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
    def _entries(self) -> QuadraticMap:
        """From p to the entries of K; p^T C_ab p needs each product p_c p_d once."""
        n = len(self.c)
        return QuadraticMap.of(self.C.reshape(n * n, n, n).transpose(1, 2, 0), self.c.ravel())

    @cached_property
    def _distinct(self) -> _Distinct:
        full = self._entries
        return _Distinct.of(full.first, full.second, full.matrix, full.constant)

    @cached_property
    def _both(self) -> QuadraticMap:
        """From p to the entries of K and of d(K p)/dp, which adds (C_ab + C_ab^T) p p_b in column c."""
        n = len(self.c)
        change = (self.C + self.C.swapaxes(2, 3)).transpose(1, 3, 0, 2)
        entries = self.C.transpose(2, 3, 0, 1)
        full = np.concatenate([m.reshape(n, n, n * n) for m in (entries, entries + change)], axis=-1)
        return QuadraticMap.of(full, np.tile(self.c.ravel(), 2))

    def stiffness(self, p: Array) -> Array:
        """Return K, shape (n_columns, n, n)."""
        return self._entries(p.T).reshape(-1, len(p), len(p))

    def force(self, p: Array) -> Array:
        """Return K p, shape (n, n_columns)."""
        return self._distinct.force(p)

    def tangent(self, p: Array) -> Array:
        """Return d(K p)/dp, shape (n_columns, n, n)."""
        return self.force_and_tangent(p)[1]

    def force_and_tangent(self, p: Array) -> tuple[Array, Array]:
        """Return force and tangent."""
        p = np.ascontiguousarray(p.T)
        both = self._both(p).reshape(len(p), 2, *self.c.shape)
        return _times(both[:, 0], p).T, both[:, 1]


@dataclass(frozen=True)
class GramStiffness:
    """The same from `GramLaw`: K depends on p through the products of difference vectors only.

    Attributes
    ----------
    law : GramLaw
        Of one element.
    differences : ndarray, shape (n_differences, n_vectors)
    """

    law: GramLaw
    differences: Array

    @classmethod
    def of(cls, element: Element, stiffness: Stiffness) -> GramStiffness:
        """Return the form of an element."""
        return cls(element.gram_law(stiffness, 1), np.asarray(element.differences()))

    @cached_property
    def _columns(self) -> Array:
        """To the nodal vectors from all shares of the pull: their sum is part of the product."""
        return np.tile(self.differences.T, len(self.differences))

    @cached_property
    def _tangent(self) -> QuadraticMap:
        """From the components of the difference vectors to the tangent over p."""
        second, D = self.law.second_derivative, np.kron(self.differences, np.eye(2))

        def on_nodes(rows: Array) -> Array:
            return np.asarray(D.T @ rows.reshape(-1, len(D), len(D)) @ D).reshape(len(rows), -1)

        return replace(second, matrix=on_nodes(second.matrix), constant=on_nodes(second.constant))

    def _vectors(self, p: Array) -> Array:
        """Return the difference vectors, shape (n_differences, 2, n_columns)."""
        V = self.differences.dot(p.reshape(len(p) // 2, -1))
        return np.asarray(V).reshape(len(V), 2, -1)

    def _force(self, V: Array) -> Array:
        shares = self.law.shares(V).reshape(self._columns.shape[1], -1)
        return np.asarray(self._columns.dot(shares)).reshape(-1, V.shape[-1])

    def stiffness(self, p: Array) -> Array:
        """Return K, shape (n_columns, n, n)."""
        H, D = self.law.weights(self._vectors(p)), self.differences
        return _both_components(D.T @ H.take(self.law.packed, axis=0).T.reshape(-1, len(D), len(D)) @ D)

    def force(self, p: Array) -> Array:
        """Return K p, shape (n, n_columns)."""
        return self._force(self._vectors(p))

    def tangent(self, p: Array) -> Array:
        """Return d(K p)/dp, shape (n_columns, n, n)."""
        return self.force_and_tangent(p)[1]

    def force_and_tangent(self, p: Array) -> tuple[Array, Array]:
        """Return force and tangent."""
        V = self._vectors(p)
        tangent = self._tangent(np.ascontiguousarray(V.reshape(-1, V.shape[-1]).T))
        return self._force(V), tangent.reshape(-1, len(p), len(p))


@dataclass(frozen=True)
class NodalLaw(RowLaw):
    """The elastic law of equal elements, over their nodal vectors, by one of the forms.

    Attributes
    ----------
    form : StiffnessForm
    energies : GramLaw
        For the energy, which no form of the stiffness gives.
    differences : ndarray, shape (n_differences, n_vectors)
    """

    form: StiffnessForm
    energies: ElasticLaw
    differences: Array

    @property
    def quartic(self) -> bool:
        """Return what the energy says."""
        return self.energies.quartic

    def energy(self, V: Array) -> Array:
        """Return the stored energy of each element [J], shape (..., n_elements)."""
        return self.energies.energy(self.differences @ V)

    def pull(self, v: Array) -> Array:
        """Return the force on the nodal vectors, in rows."""
        return self.form.force(v.reshape(-1, v.shape[-1])).reshape(v.shape)

    def hessian(self, V: Array) -> Array:
        """Return its derivative, shape (..., n_elements, n, n)."""
        flat = V.reshape(*V.shape[:-2], -1)
        columns = np.ascontiguousarray(flat.reshape(-1, flat.shape[-1]).T)
        return self.form.tangent(columns).reshape(*flat.shape, flat.shape[-1])

    def joined(self, other: NodalLaw) -> NodalLaw:
        """Return the law of this one's elements followed by the other's, which are equal to them."""
        return replace(self, energies=join_laws([self.energies, other.energies]))


STIFFNESS_FORMS: dict[str, type[StiffnessForm]] = {
    "direct": DirectStiffness,
    "tabulated": TabulatedStiffness,
    "separated": SeparatedStiffness,
    "gram": GramStiffness,
}
"""The forms by name, as decks, tests and benchmarks know them."""


def nodal_law(form: str, element: Element, stiffness: Stiffness, count: int) -> NodalLaw:
    """Return the law of ``count`` equal elements by one of the forms of `STIFFNESS_FORMS`."""
    energies = element.law(stiffness, count)
    return NodalLaw(STIFFNESS_FORMS[form].of(element, stiffness), energies, element.differences())
