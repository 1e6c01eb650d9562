"""Fully parameterised elements in space that are curved or twisted undeformed.

With F0 = (r_x, r_y, r_z) undeformed the deformation gradient is F F0^-1, strain 1/2 (F^T F - F0^T F0) in the
axes of the material, and the volume det F0 dx dy dz.  The material is alike in all directions, so that the
axes of the body frame serve.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hfsim.deck.materials import BeamProperties
from hfsim.maths.arrays import Array
from hfsim.maths.shapes import gauss_legendre, rest_of
from hfsim.parts.elements.continuum import Continuum, section_points
from hfsim.parts.elements.points import PointLaw
from hfsim.parts.elements.varied import VariedGramLaw


@dataclass(frozen=True)
class CurvedContinuum(Continuum):
    """One element with its undeformed vectors, for laws of its own.

    Attributes
    ----------
    vectors : tuple of tuple of float
        All n_vectors of them [m], [-].
    """

    vectors: tuple[tuple[float, ...], ...] = ()

    @property
    def _straight(self) -> Array:
        return np.asarray(self.differences() @ np.array(self.vectors))

    def strain_table(self, properties: BeamProperties) -> tuple[Array, Array]:
        """Return volumes and rows as of the straight element, by places in the undeformed body."""
        weights, rows = super().strain_table(properties)
        ratios, rows_of_each = in_material(rows, np.array(self.vectors)[None])
        return weights * ratios[0], rows_of_each[0]


def in_material(rows: Array, undeformed: Array) -> tuple[Array, Array]:
    """Return det F0, and rows of the deformation gradient, at places of elements or points.

    Parameters
    ----------
    rows : ndarray, shape (3, n_places, n_vectors)
        From vectors to r_x, r_y, r_z.
    undeformed : ndarray, shape (n, n_vectors, 3)
        These vectors of n elements or points.

    Returns
    -------
    ndarray, shape (n, n_places)
    ndarray, shape (n, 3, n_places, n_vectors)
    """
    F0 = np.einsum("iqa,eak->eqki", rows, undeformed)
    return np.linalg.det(F0), np.einsum("iqa,eqik->ekqa", rows, np.linalg.inv(F0))


def curved_law(element: Continuum, properties: BeamProperties, undeformed: Array) -> PointLaw:
    """Return the elastic law of elements, on their difference vectors.

    Parameters
    ----------
    element : Continuum
        With the length and the degrees of all.
    properties : BeamProperties
    undeformed : ndarray, shape (n_elements, n_vectors, 3)
        Their nodal vectors.
    """
    rows, volumes = element.point_rows(properties)
    to_points, weights = element.to_points(), element.axial_rule[1]
    there = np.einsum("apn,enk->peak", to_points, element.differences() @ undeformed)
    own = there.reshape(-1, *there.shape[2:])
    ratios, material = in_material(rows, own)
    each = np.repeat(weights, len(undeformed))[:, None] * ratios * volumes
    return PointLaw(VariedGramLaw.green_lagrange(material, each, own, properties), to_points)


def curved_masses(
    element: Continuum, properties: BeamProperties, undeformed: Array, start: float = 0.0
) -> Array:
    """Return the mass matrices of one vector component of these elements, (n_elements, n, n) [kg].

    Of their parts beyond ``start``, a share of the length.
    """
    x, wx = rest_of(gauss_legendre((3 * element.degree + 2 * element.section_degree) // 2 + 1), start)
    y, z, across = section_points(properties, 3, 2)
    places = [(float(xi), float(a), float(b)) for xi in x for a, b in zip(y, z, strict=True)]
    units = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
    N, *rows = (np.array([element.shape(xi, a, by, b) for xi, a, b in places]) for by in units)
    ratios, _ = in_material(np.array(rows), undeformed)
    each = properties.mass_per_length * element.length * np.outer(wx, across).ravel() * ratios
    return np.asarray(np.einsum("eq,qn,qm->enm", each, N, N, optimize=True))
