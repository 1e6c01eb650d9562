r"""Ways to the stiffness K(p) of eq. (25): direct, separated (39)-(41), and by products of vectors.

Strain enters as :math:`\varepsilon_{ij} = \frac12 (p^T S_{ij} p - \delta_{ij})` with
:math:`S_{ij} = N_{,i}^T N_{,j}` (eq. 18, 26).  In space i and j run over 1, 2, 3; in the plane over
1, 2, and of the three shear terms the one with i = 1, k(i) = 2 is left.  A centre line has i = j = 1 only,
EA in the place of E_11, and a constant bending stiffness.  All forms give the same numbers to round-off; they
differ in cost.

Everywhere p holds the nodal components of elements as columns, shape (n, n_columns) with n = n_dim n_vectors:
all elements in all states side by side, so that operations run along whole rows of memory.  Force means
K p, the derivative of the strain energy (eq. 24), and tangent its derivative by p.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, Self, cast

import numpy as np

from hfsim.deck.materials import BeamProperties
from hfsim.maths.arrays import Array
from hfsim.maths.shapes import gauss_legendre
from hfsim.parts.elements import ElasticLaw, Element, join_laws
from hfsim.parts.elements._base import USUAL, Measures
from hfsim.parts.elements.continuum import Continuum, elasticity, strain_pairs


class StiffnessForm:
    """One way to the stiffness of an element; p has shape (n, n_columns)."""

    @classmethod
    def of(cls, element: Element, properties: BeamProperties, n_dim: int = 2) -> Self:
        """Return the form of an element in plane or space."""
        raise NotImplementedError

    @classmethod
    def law_of(
        cls, element: Element, properties: BeamProperties, count: int, measures: Measures = USUAL
    ) -> NodalLaw:
        """Return the elastic law of ``count`` equal elements over their nodal vectors."""
        form = _made_once(cast(Any, cls), cast(Any, element), properties, measures.n_dim)
        return NodalLaw(form, element.law(properties, count, measures), element.differences())

    @classmethod
    def law_of_each(
        cls, elements: Iterable[Element], properties: BeamProperties, measures: Measures
    ) -> UnlikeLaw:
        """Return that of elements that are not equal."""
        return UnlikeLaw(tuple(cls.law_of(one, properties, 1, measures) for one in elements))

    def stiffness(self, p: Array) -> Array:
        """Return K, shape (n_columns, n, n)."""
        raise NotImplementedError

    def force(self, p: Array) -> Array:
        """Return K p, shape (n, n_columns)."""
        raise NotImplementedError

    def tangent(self, p: Array) -> Array:
        """Return d(K p)/dp, shape (n_columns, n, n)."""
        return self.force_and_tangent(p)[1]

    def force_and_tangent(self, p: Array) -> tuple[Array, Array]:
        """Return force and tangent; what they have in common is computed once."""
        raise NotImplementedError


@dataclass(frozen=True)
class NodalLaw:
    """The elastic law of equal elements, over their nodal vectors, by one of the forms.

    Attributes
    ----------
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

    @property
    def shared(self) -> Hashable:
        """The form, which equal elements have in common."""
        return id(self.form)

    def joined(self, other: NodalLaw) -> NodalLaw:
        """Return the law of this one's elements followed by the other's, which are equal to them."""
        return replace(self, energies=join_laws([self.energies, other.energies]))


@dataclass(frozen=True)
class UnlikeLaw:
    """The laws of elements that are not equal, one by one.

    Attributes
    ----------
    laws : tuple of ElasticLaw
        Of one element each.
    """

    laws: tuple[ElasticLaw, ...]

    @property
    def quartic(self) -> bool:
        """Return what they say."""
        return all(law.quartic for law in self.laws)

    @property
    def shared(self) -> Hashable:
        """Nothing but the kind."""
        return UnlikeLaw

    def joined(self, other: UnlikeLaw) -> UnlikeLaw:
        """Return the law of this one's elements followed by the other's."""
        return UnlikeLaw(self.laws + other.laws)

    def energy(self, V: Array) -> Array:
        """Return the stored energy of each element [J], shape (..., n_elements)."""
        each = [law.energy(V[..., e : e + 1, :, :]) for e, law in enumerate(self.laws)]
        return np.concatenate(each, axis=-1)

    def pull(self, v: Array) -> Array:
        """Return dU/dV [J] in rows."""
        parts = np.split(v, len(self.laws), axis=-1)
        pulled = [law.pull(np.ascontiguousarray(p)) for law, p in zip(self.laws, parts, strict=True)]
        return np.concatenate(pulled, axis=-1)

    def hessian(self, V: Array) -> Array:
        """Return d2U/dV2 [J], shape (..., n_elements, n_vectors * n_dim, n_vectors * n_dim)."""
        each = [law.hessian(V[..., e : e + 1, :, :]) for e, law in enumerate(self.laws)]
        return np.concatenate(each, axis=-3)


@lru_cache(maxsize=16)
def _made_once(kind: Any, element: Any, properties: BeamProperties, n_dim: int) -> StiffnessForm:
    form: StiffnessForm = kind.of(element, properties, n_dim)
    return form


def all_components(K: Array, n_dim: int) -> Array:
    """Return the matrix over all components from that of one component."""
    full = K[..., :, None, :, None] * np.eye(n_dim)[:, None, :]
    n = n_dim * K.shape[-1]
    return np.asarray(full.reshape(*K.shape[:-2], n, n))


def times(K: Array, p: Array) -> Array:
    """Return K p, shape (n_columns, n), for p of that shape."""
    return np.asarray((K @ p[..., None])[..., 0])


@dataclass(frozen=True)
class StrainTable:
    """What the integrals of eq. (25) are made of, at the quadrature points of one element.

    Attributes
    ----------
    weights : ndarray, shape (n_points,)
        Volume of each point [m^3]; length [m] for a centre line.
    rows : ndarray, shape (n_directions, n_points, n_vectors)
        Shape rows of N_,1 (, N_,2 and N_,3).
    elasticity : ndarray, shape (n_strains, n_strains)
        Coefficients E of eq. (22) [Pa]: normal strains, then shear; EA [N] for a centre line.
    bending : ndarray, shape (n_vectors, n_vectors)
        Constant part of the stiffness of one component; zero where the strains do it all.
    n_dim : int
        Of space.
    """

    weights: Array
    rows: Array
    elasticity: Array
    bending: Array
    n_dim: int

    @classmethod
    def of(cls, element: Element, properties: BeamProperties, n_dim: int) -> StrainTable:
        """Return the table of an element with a section or of a centre line."""
        if isinstance(element, Continuum):
            return _continuum_table(element, properties)
        return _cable_table(element, properties, n_dim)

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Directions of each strain, counted from zero."""
        return strain_pairs(len(self.rows)) if len(self.rows) > 1 else ((0, 0),)

    @cached_property
    def unit(self) -> Array:
        """What p^T A_r p is in a rigid motion: one for normal strains, zero for shear, shape (n_strains,)."""
        return np.array([float(i == j) for i, j in self.pairs])

    @cached_property
    def constant(self) -> Array:
        """Constant part of the stiffness, shape (n, n)."""
        return all_components(self.bending, self.n_dim)

    def products(self) -> Array:
        """Return S_ii and 2 S_ik(i) of eq. (26) at each point, shape (n_strains, n_points, n, n)."""
        rows = [(self.rows[i], self.rows[j] if i == j else 2.0 * self.rows[j]) for i, j in self.pairs]
        return all_components(np.stack([a[:, :, None] * b[:, None, :] for a, b in rows]), self.n_dim)

    def strains(self) -> Array:
        """Return A_r, their symmetric parts: S_ii and S_ik(i) + S_k(i)i."""
        products = self.products()
        return np.asarray(0.5 * (products + products.swapaxes(-1, -2)))


def _continuum_table(element: Continuum, properties: BeamProperties) -> StrainTable:
    weights, rows = element.strain_table(properties)
    flat = np.zeros((rows.shape[2], rows.shape[2]))
    return StrainTable(weights, rows, elasticity(properties, element.n_dim), flat, element.n_dim)


def _cable_table(element: Element, properties: BeamProperties, n_dim: int) -> StrainTable:
    x, w = gauss_legendre(2 * element.degree - 1)
    weights = np.asarray(w * element.length)
    rows, bend = (element.shape(x, 0.0, (k, 0)) for k in (1, 2))
    bending = np.asarray(properties.bending_stiffness * (bend.T * weights) @ bend)
    return StrainTable(weights, rows[None], np.array([[properties.axial_stiffness]]), bending, n_dim)
