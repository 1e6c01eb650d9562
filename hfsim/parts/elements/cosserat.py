"""Beam in space with shear and torsion: centre line r and two section vectors d2, d3 at every node.

Geometrically exact beam of Simo and Reissner in the vectors of Betsch and Steinmann (IJNME 54, 2002): with
d1 = d2 x d3 the strains are Gamma_i = d_i . r' and kappa_1 = (d3 . d2' - d2 . d3') / 2, kappa_2 = d1 . d3',
kappa_3 = - d1 . d2', less those of the undeformed beam; N = C Gamma, M = D kappa.  They are polynomials of
the vectors, and no rigid motion changes them.  Nodes hold d2 and d3 at unit length and at right angles.

Nodes are the Gauss-Lobatto points of each element, and one Gauss point less than there are nodes integrates
the energy: that neither locks nor leaves a mode without energy, and errors at nodes fall with the power 2
degree of the element length.  The mass is integrated at the nodes, so that its matrix is diagonal there.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.matrices import Entries
from hfsim.maths.rotations import skew
from hfsim.maths.shapes import gauss_legendre, gauss_lobatto, lagrange
from hfsim.mechanics.connectivity import Connectivity
from hfsim.mechanics.force import ForcePart
from hfsim.parts.elements._base import RowLaw

VECTORS = 3
"""Vectors of a node: position, second and third axis of the section."""
STRAINS = 6
"""Stretch, two shears, twist and two curvatures."""


@lru_cache(maxsize=16)
def point_rows(degree: int) -> tuple[Array, Array]:
    """Return the rows of values and slopes (by xi) at Gauss points, shape (degree, degree + 1) each."""
    places, nodes = gauss_legendre(degree)[0], gauss_lobatto(degree + 1)[0]
    return lagrange(places, nodes), lagrange(places, nodes, 1)


def vector_rows(values: Array, slopes: Array) -> Array:
    """Return the rows of (r', d2, d3, d2', d3') over an element's vectors, (..., 5, 3 (degree + 1)).

    Parameters
    ----------
    values, slopes : ndarray, shape (..., degree + 1)
        Shape rows and their derivatives by the length [1/m].
    """
    wanted = ((0, slopes), (1, values), (2, values), (1, slopes), (2, slopes))
    rows = np.zeros((*values.shape[:-1], len(wanted), values.shape[-1], VECTORS))
    for k, (vector, row) in enumerate(wanted):
        rows[..., k, :, vector] = row
    return rows.reshape(*rows.shape[:-2], -1)


def _product(a: Array, b: Array) -> Array:
    """Return a . b of vectors whose components are the first axis."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _cross(a: Array, b: Array) -> Array:
    """Return a x b of the same."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def strains(v: Array) -> Array:
    """Return Gamma and kappa, shape (6, ...), of vectors (r', d2, d3, d2', d3'), shape (5, 3, ...)."""
    slope, y, z, bent_y, bent_z = v
    x = _cross(y, z)
    twist = 0.5 * (_product(z, bent_y) - _product(y, bent_z))
    shears = _product(y, slope), _product(z, slope)
    return np.stack([_product(x, slope), *shears, twist, _product(x, bent_z), -_product(x, bent_y)])


def pulled(v: Array, S: Array) -> Array:
    """Return the forces on the vectors, shape (5, 3, ...), that do the work of section forces (6, ...)."""
    slope, y, z, bent_y, bent_z = v
    x, half = _cross(y, z), 0.5 * S[3]
    on_x = S[0] * slope + S[4] * bent_z - S[5] * bent_y
    return np.stack(
        [
            S[0] * x + S[1] * y + S[2] * z,
            S[1] * slope - half * bent_z + _cross(z, on_x),
            S[2] * slope + half * bent_y + _cross(on_x, y),
            half * z - S[5] * x,
            S[4] * x - half * y,
        ]
    )


@dataclass(frozen=True, eq=False)
class CosseratLaw(RowLaw):
    """Energy 1/2 (e - e0)^T C (e - e0) at the Gauss points, each of which is an element of its own.

    Attributes
    ----------
    stiffness : ndarray, shape (6, n_points)
        EA, GA_y, GA_z [N m] and GJ, EI_y, EI_z [N m^3], times length by weight.
    undeformed : ndarray, shape (6, n_points)
        e0: strains as they are without stress.
    degree : int
        Of the elements: points of different ones depend on different numbers of coordinates.
    """

    stiffness: Array
    undeformed: Array
    degree: int
    integrals: ClassVar[str] = "as many Gauss points an element as its degree"
    pieces: ClassVar[str] = "Gauss points"

    @property
    def quartic(self) -> bool:
        """Return False: the energy is of degree six."""
        return False

    @property
    def shared(self) -> Hashable:
        """The degree; points differ in their numbers only."""
        return self.degree

    def joined(self, other: CosseratLaw) -> CosseratLaw:
        """Return the law of this one's points followed by the other's."""
        pairs = (self.stiffness, other.stiffness), (self.undeformed, other.undeformed)
        stiffness, undeformed = (np.concatenate(pair, axis=1) for pair in pairs)
        return CosseratLaw(stiffness, undeformed, self.degree)

    def section_forces(self, v: Array) -> Array:
        """Return C (e - e0), (6, n_points, n_batch), of component rows (5, 3, n_points * n_batch)."""
        e = strains(v).reshape(STRAINS, self.stiffness.shape[1], -1)
        e -= self.undeformed[..., None]
        e *= self.stiffness[..., None]
        return np.asarray(e)

    def energy(self, V: Array) -> Array:
        """Return the stored energy [J], shape (..., n_points)."""
        e = strains(np.moveaxis(V, (-2, -1), (0, 1))) - _spread(self.undeformed, V)
        return np.asarray(0.5 * np.sum(_spread(self.stiffness, V) * e * e, axis=0))

    def pull(self, v: Array) -> Array:
        """Return dU/dV [J] for `component_rows`, same shape."""
        return pulled(v, self.section_forces(v).reshape(STRAINS, -1))

    def hessian(self, V: Array) -> Array:
        """Return d2U/dV2 [J], shape (..., n_points, 15, 15)."""
        v = np.moveaxis(V, (-2, -1), (0, 1))
        C = _spread(self.stiffness, V)
        B = strain_slopes(V)
        material = np.einsum("...ia,i...,...ib->...ab", B, C, B, optimize=True)
        return np.asarray(material + bent_by(V, C * (strains(v) - _spread(self.undeformed, V))))


def _spread(numbers: Array, V: Array) -> Array:
    """Return numbers (6, n_points) of each point for a batch of vectors (..., n_points, 5, 3)."""
    return numbers.reshape(STRAINS, *(1,) * (V.ndim - 3), -1)


def strain_slopes(V: Array) -> Array:
    """Return the derivative of the strains by the vectors, shape (..., 6, 15)."""
    v = np.moveaxis(V, (-2, -1), (0, 1))
    units = np.eye(STRAINS).reshape(STRAINS, STRAINS, *(1,) * (V.ndim - 2))
    rows = [np.moveaxis(pulled(v, unit), (0, 1), (-2, -1)).reshape(*V.shape[:-2], -1) for unit in units]
    return np.stack(rows, axis=-2)


def bent_by(V: Array, S: Array) -> Array:
    """Return the derivative of `pulled` by the vectors at constant S (6, ...), shape (..., 15, 15)."""
    slope, y, z, bent_y, bent_z = np.moveaxis(V, -2, 0)
    S = S[..., None]
    on_x = S[0] * slope + S[4] * bent_z - S[5] * bent_y
    S, one = S[..., None], np.eye(3)
    K = np.zeros((*V.shape[:-2], 5, 3, 5, 3))
    blocks = {
        (0, 1): S[1] * one - S[0] * skew(z),
        (0, 2): S[2] * one + S[0] * skew(y),
        (1, 2): -skew(on_x),
        (1, 3): -S[5] * skew(z),
        (1, 4): S[4] * skew(z) - 0.5 * S[3] * one,
        (2, 3): S[5] * skew(y) + 0.5 * S[3] * one,
        (2, 4): -S[4] * skew(y),
    }
    for (i, j), block in blocks.items():
        K[..., i, :, j, :] = block
        K[..., j, :, i, :] = block.swapaxes(-1, -2)
    return K.reshape(*V.shape[:-2], 15, 15)


@dataclass(frozen=True, eq=False)
class SectionDamping(ForcePart):
    """Damping proportional to the rates of all strains, at the Gauss points of beams with section vectors.

    Attributes
    ----------
    elements : Connectivity
        Of the Gauss points.
    resisting : ndarray, shape (6, n_points)
        Stiffness times retardation times, times length by weight.
    """

    elements: Connectivity
    resisting: Array
    rule: ClassVar[str] = "damping"
    why: ClassVar[str] = "damped material"

    @property
    def counts(self) -> dict[str, int | str]:
        """One kernel serves all points in one call."""
        return {"kernels": 1, "integrals": CosseratLaw.integrals}

    @property
    def idle(self) -> bool:
        """Whether there is no damping."""
        return not self.dissipates

    @property
    def uses_rates(self) -> bool:
        """Return True."""
        return True

    @property
    def dissipates(self) -> bool:
        """Whether there is any damping."""
        return bool(self.resisting.any())

    def _state(self, x: Array, u: Array) -> tuple[Array, Array, Array]:
        """Return vectors (..., n_points, 5, 3), slopes of the strains, and section forces (..., 6)."""
        V = self.elements.vectors(x)
        B = strain_slopes(V)
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
        units = np.eye(STRAINS).reshape(STRAINS, STRAINS, *(1,) * (V.ndim - 2))
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
