"""Fully parameterised elements in space that are curved or twisted undeformed.

With F0 = (r_x, r_y, r_z) undeformed the deformation gradient is F F0^-1, strain 1/2 (F^T F - F0^T F0) in the
axes of the material, and its volume det F0 dx dy dz.  The material is alike in all directions, so that the
axes of the body frame serve.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hfsim.deck.materials import BeamProperties
from hfsim.maths.arrays import Array
from hfsim.maths.shapes import gauss_legendre, piecewise
from hfsim.parts.elements.continuum import Continuum, section_points

if TYPE_CHECKING:
    from hfsim.deck.stations import BeamAlong


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
    rows : ndarray, shape (3, n_places, n_vectors) or (n, 3, n_places, n_vectors)
        From vectors to r_x, r_y, r_z; the same in all, or of each.
    undeformed : ndarray, shape (n, n_vectors, 3)
        These vectors of n elements or points.

    Returns
    -------
    ndarray, shape (n, n_places)
    ndarray, shape (n, 3, n_places, n_vectors)
    """
    F0 = np.einsum("...iqa,...ak->...qki", rows, undeformed)
    return np.linalg.det(F0), np.einsum("...iqa,...qik->...kqa", rows, np.linalg.inv(F0))


def curved_masses(element: Continuum, properties: BeamAlong, undeformed: Array, start: float = 0.0) -> Array:
    """Return the mass matrices of one vector component of these elements, (n_elements, n, n) [kg].

    Of their parts beyond ``start``, a share of the length.  The mass per length is that of the section:
    between nodes interpolated section vectors enclose less than it does, and det F0 tells no more than how
    mass is spread over it.
    """
    alike, count = isinstance(properties, BeamProperties), len(undeformed)
    points = (3 * element.degree + 2 * element.section_degree) // 2 + (1 if alike else 2)
    x, wx = piecewise(gauss_legendre(points), properties.cuts(count), start)
    own = properties.in_elements(x, count)
    y, z, across = section_points(own, 3, 2)
    one, nothing = np.ones((1 if alike else count, len(x), len(across))), np.zeros(1)

    def rows(along: int, *sides: Array) -> Array:
        """Return sums of shapes of the line, r_y and r_z, or their derivatives by x, (..., n_places, n)."""
        units = ((along, 0, 0), (along, 1, 0), (along, 0, 1))
        kinds = np.array([element.shape(x, 0.0, by) for by in units])
        found = np.einsum("kexq,kxn->exqn", [np.broadcast_to(side, one.shape) for side in sides], kinds)
        return np.asarray(found.reshape(len(found), -1, found.shape[-1]))

    N = rows(0, one, y, z)
    gradients = rows(1, one, y, z), rows(0, nothing, one, nothing), rows(0, nothing, nothing, one)
    ratios, _ = in_material(np.stack(gradients, axis=1), undeformed)
    volumes = ratios.reshape(len(ratios), len(x), -1)
    shares = (1.0 + volumes - (volumes @ across)[..., None]).reshape(ratios.shape)
    density = np.multiply.outer(wx * own.mass_per_length, across).reshape(-1, N.shape[1])
    each = element.length * density * shares
    return np.asarray((N * each[..., None]).swapaxes(1, 2) @ N)
