"""Beam with shear: centre line r and section vectors d at every node, two in space and one in the plane.

Geometrically exact beam of Simo and Reissner in the vectors of Betsch and Steinmann (IJNME 54, 2002), with
torsion in space: its strains (`hfsim.parts.elements.spatial_strains`, `planar_strains`) are functions of
r', d and d' that no rigid motion changes; (N, M) = C (Gamma, kappa) of what they are more than undeformed.
Nodes hold section vectors at unit length and at right angles.

Nodes are the Gauss-Lobatto points of each element, and one Gauss point less than there are nodes integrates
the energy: that neither locks nor leaves a mode without energy, and errors at nodes fall with the power 2
degree of the element length.  The mass is integrated at the nodes, so that its matrix is diagonal there.
"""

from __future__ import annotations

from collections.abc import Hashable
from functools import lru_cache
from typing import ClassVar

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.maths.shapes import gauss_legendre, gauss_lobatto, lagrange
from hfsim.mechanics.connectivity import Connectivity
from hfsim.parts.elements.forces import MaterialDamping
from hfsim.parts.elements.planar_strains import PLANAR
from hfsim.parts.elements.section_strains import PointStrains
from hfsim.parts.elements.spatial_strains import SPATIAL

STRAINS = {2: PLANAR, 3: SPATIAL}
"""By the dimensions of space."""


@lru_cache(maxsize=16)
def point_rows(degree: int) -> tuple[Array, Array]:
    """Return the rows of values and slopes (by xi) at Gauss points, shape (degree, degree + 1) each."""
    places, nodes = gauss_legendre(degree)[0], gauss_lobatto(degree + 1)[0]
    return lagrange(places, nodes), lagrange(places, nodes, 1)


def vector_rows(values: Array, slopes: Array, n_dim: int) -> Array:
    """Return the rows of (r', d.., d'..) over an element's vectors, (..., 2 n_dim - 1, n_dim (degree + 1)).

    Parameters
    ----------
    values, slopes : ndarray, shape (..., degree + 1)
        Shape rows and their derivatives by the length [1/m].
    n_dim : int
        Of space: nodes have as many vectors, their position and the section's.
    """
    sections = range(1, n_dim)
    wanted = [(0, slopes), *((k, values) for k in sections), *((k, slopes) for k in sections)]
    rows = np.zeros((*values.shape[:-1], len(wanted), values.shape[-1], n_dim))
    for k, (vector, row) in enumerate(wanted):
        rows[..., k, :, vector] = row
    return rows.reshape(*rows.shape[:-2], -1)


@frozen
class CosseratLaw:
    """Energy 1/2 (e - e0)^T C (e - e0) at the Gauss points, each of which is an element of its own.

    Attributes
    ----------
    stiffness : ndarray, shape (n_strains, n_points)
        EA, GA_y, GA_z [N m] and GJ, EI_y, EI_z [N m^3], those that the space has, times length by weight;
        where they are coupled, D of C = T^T D T (`PointStrains`).
    undeformed : ndarray, shape (n_strains, n_points)
        e0: strains as they are without stress.
    degree : int
        Of the elements: points of different ones depend on different numbers of coordinates.
    """

    stiffness: Array
    undeformed: Array
    degree: int
    strains: PointStrains
    integrals: ClassVar[str] = "as many Gauss points an element as its degree"
    pieces: ClassVar[str] = "Gauss points"
    quartic: ClassVar[bool] = False
    """It is no polynomial, and nodes have equations that are not linear."""

    @property
    def shared(self) -> Hashable:
        """The degree, and whether strains are coupled; points differ in their numbers only."""
        return self.degree, self.strains.mixing is None

    def joined(self, other: CosseratLaw) -> CosseratLaw:
        """Return the law of this one's points followed by the other's."""
        pairs = (self.stiffness, other.stiffness), (self.undeformed, other.undeformed)
        stiffness, undeformed = (np.concatenate(pair, axis=1) for pair in pairs)
        return CosseratLaw(stiffness, undeformed, self.degree, self.strains.joined(other.strains))

    def strains_of(self, v: Array) -> Array:
        """Return e - e0, (n_strains, n_points, n_batch), of `component_rows`."""
        e = self.strains.space.of(v).reshape(*self.stiffness.shape, -1)
        e = self.strains.mixed(e.swapaxes(1, 2)).swapaxes(1, 2)
        e -= self.undeformed[..., None]
        return np.asarray(e)

    def slopes(self, V: Array) -> Array:
        """Return the derivative of the strains by the vectors, shape (..., n_points, n_strains, m)."""
        return self.strains.slopes(V)

    def energy(self, V: Array) -> Array:
        """Return the stored energy [J], shape (..., n_points)."""
        e = self.strains.of(V) - _spread(self.undeformed, V)
        return np.asarray(0.5 * np.sum(_spread(self.stiffness, V) * e * e, axis=0))

    def pull(self, v: Array) -> Array:
        """Return dU/dV [J] for `component_rows`, same shape."""
        return self.pull_of(v, self.strains_of(v))

    def pull_of(self, v: Array, e: Array) -> Array:
        """Return the forces on the vectors with given strains (n_strains, n_points, n_batch or 1)."""
        shape = *self.stiffness.shape, v.shape[-1] // self.stiffness.shape[1]
        on_strains = np.broadcast_to(e * self.stiffness[..., None], shape)
        S = self.strains.unmixed(on_strains.swapaxes(1, 2)).swapaxes(1, 2)
        return self.strains.space.pulled(v, S.reshape(len(S), -1))

    def hessian(self, V: Array) -> Array:
        """Return d2U/dV2 [J], shape (..., n_points, m, m), of all m numbers of the vectors."""
        return self.hessian_of(V, self.strains.of(V) - _spread(self.undeformed, V))

    def hessian_of(self, V: Array, e: Array) -> Array:
        """Return the same with given strains (n_strains, ..., n_points)."""
        C, B = _spread(self.stiffness, V), self.slopes(V)
        material = (np.moveaxis(C, 0, -1)[..., None] * B).swapaxes(-1, -2) @ B
        return np.asarray(material + self.strains.bent_by(V, C * e))


def _spread(numbers: Array, V: Array) -> Array:
    """Return numbers (n_strains, n_points) of each point for vectors (..., n_points, n_vectors, n_dim)."""
    return numbers.reshape(len(numbers), *(1,) * (V.ndim - 3), -1)


@frozen
class SectionDamping(MaterialDamping):
    """Damping proportional to the rates of all strains, at the Gauss points of beams with section vectors.

    Attributes
    ----------
    elements : Connectivity
        Of the Gauss points.
    resisting : ndarray, shape (n_strains, n_points)
        Stiffness times retardation times, times length by weight.
    """

    elements: Connectivity
    resisting: Array
    strains: PointStrains

    @property
    def counts(self) -> dict[str, int | str]:
        """One kernel serves all points in one call."""
        return {"kernels": 1, "integrals": CosseratLaw.integrals}

    @property
    def dissipates(self) -> bool:
        """Whether there is any damping."""
        return bool(self.resisting.any())

    def _state(self, x: Array, u: Array) -> tuple[Array, Array, Array]:
        """Return vectors, slopes of the strains, and section forces (..., n_points, n_strains)."""
        V = self.elements.vectors(x)
        B = self.strains.slopes(V)
        rates = self.elements.vectors(u).reshape(*V.shape[:-2], -1, 1)
        return V, B, (B @ rates)[..., 0] * self.resisting.T

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add minus B^T C B V'."""
        V, B, S = self._state(x, u)
        out -= self.elements.force((S[..., None, :] @ B).reshape(V.shape))

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the force by x in one state."""
        V, B, S = self._state(x, u)
        rates = self.elements.vectors(u).reshape(*V.shape[:-2], -1, 1)
        bent_by, units = self.strains.bent_by, self.strains.units(V)
        turned = np.stack([(bent_by(V, unit) @ rates)[..., 0] for unit in units], axis=-2)
        resisted = B.swapaxes(-1, -2) @ (self.resisting.T[..., None] * turned)
        return self.elements.entries((bent_by(V, np.moveaxis(S, -1, 0)) + resisted)[0])

    def rate_tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the force by u in one state."""
        _, B, _ = self._state(x, u)
        return self.elements.entries((B.swapaxes(-1, -2) @ (self.resisting.T[..., None] * B))[0])

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return minus the dissipated power."""
        _, B, S = self._state(x, u)
        rates = self.elements.vectors(u).reshape(*S.shape[:-1], -1, 1)
        return np.asarray(-np.sum(S * (B @ rates)[..., 0], axis=(-1, -2)))
