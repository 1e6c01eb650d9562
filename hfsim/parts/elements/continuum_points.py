"""Fully parameterised elements by the Gauss points of their axes, of which each has a section of its own.

What is not alike along a beam is summed here: sections and materials by stations, undeformed axes.  Damping
needs these points on uniform beams, too.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from hfsim.deck.materials import BeamProperties
from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.parts.elements.continuum import Continuum, elasticity, strain_pairs
from hfsim.parts.elements.points import PointLaw
from hfsim.parts.elements.spatial_curved import in_material
from hfsim.parts.elements.varied import VariedGramLaw

if TYPE_CHECKING:
    from hfsim.deck.stations import BeamAlong

_NUMBERS = ("height", "width", "breadth", "lame_lambda", "lame_mu", "axial_damping", "bending_damping")


@frozen
class ContinuumPoints:
    """All points: the first one of all elements, then the second, and so on; of equal elements one of each.

    Attributes
    ----------
    element : Continuum
        With the length and the degrees of all.
    properties : BeamProperties
        At the points, each number of shape (n_points,).
    own : ndarray, shape (n_points, 2 n_dim - 1, n_dim)
        Undeformed vectors there: r', r_y[, r_z] and their derivatives by x / le.
    curved : bool
        Whether these are not those of a straight element along x.
    alike : int
        Elements each of these points stands for: all of them, or one.
    """

    element: Continuum
    properties: BeamProperties
    own: Array
    curved: bool
    alike: int

    @classmethod
    def of(
        cls, element: Continuum, properties: BeamAlong, count: int, undeformed: Array | None = None
    ) -> Self:
        """Return those of equal elements in a row.

        ``undeformed`` are their nodal vectors, (count, n_vectors, n_dim), if they are not straight along x.
        """
        x, _ = element.axial_rule
        alike = count if undeformed is None and isinstance(properties, BeamProperties) else 1
        count //= alike
        there = properties.in_elements(x, count)
        numbers = {name: np.broadcast_to(getattr(there, name), (count, len(x))) for name in _NUMBERS}
        at_points: dict[str, Any] = {name: one.T.ravel() for name, one in numbers.items()}
        own = there._replace(**at_points)
        n, n_dim = 2 * element.n_dim - 1, element.n_dim
        if undeformed is None:
            straight = np.broadcast_to(np.eye(n, n_dim), (count * len(x), n, n_dim))
            return cls(element, own, straight, False, alike)
        vectors = np.einsum("apn,enk->peak", element.to_points(), element.differences() @ undeformed)
        return cls(element, own, vectors.reshape(-1, n, n_dim), True, alike)

    @cached_property
    def _places(self) -> tuple[Array, Array]:
        """Rows from the vectors of a point to the deformation gradient at places of its section, and volumes.

        Shapes (n_points, n_dim, n_places, n_vectors) and (n_points, n_places).
        """
        rows, volumes = self.element.point_rows(self.properties)
        weights = self.element.axial_rule[1]
        volumes = np.repeat(weights, len(volumes) // len(weights))[:, None] * volumes
        if not self.curved:
            return rows, volumes
        ratios, rows = in_material(rows, self.own)
        return rows, ratios * volumes

    def _strains(self) -> Iterator[tuple[Array, Array]]:
        """Yield, place by place, volumes and rows from products of the vectors to strains of eq. (20).

        Shapes (n_points, 1, 1) and (n_points, n_strains, n_pairs).
        """
        (rows, volumes), n_dim = self._places, self.element.n_dim
        first, second = np.triu_indices(rows.shape[-1])
        off, pairs = np.where(first == second, 0.0, 1.0), strain_pairs(n_dim)
        for q in range(rows.shape[2]):
            f = rows[:, :, q]
            both = [f[:, i][:, first] * f[:, j][:, second] for i, j in pairs]
            swapped = [f[:, j][:, first] * f[:, i][:, second] for i, j in pairs]
            strains = np.stack([a + off * b for a, b in zip(both, swapped, strict=True)], axis=1)
            strains[:, :n_dim] *= 0.5
            yield volumes[:, q, None, None], strains

    def _summed(self, less: Array | float = 0.0) -> Array:
        """Return the form of the energy (21)-(23) in strains less some, (n_points, n_pairs, n_pairs) [J]."""
        E = elasticity(self.properties, self.element.n_dim)
        each = ((volume, strains - less) for volume, strains in self._strains())
        return np.asarray(sum(own.swapaxes(1, 2) @ (volume * (E @ own)) for volume, own in each))

    def _law(self, form: Array) -> PointLaw:
        """Return the law of a form (n, n_pairs, n_pairs) at these points or at those of all elements."""
        first, second = np.triu_indices(self.own.shape[1])
        reference = np.sum(self.own[:, first] * self.own[:, second], axis=-1)
        reference = np.repeat(reference, self.alike, axis=0)
        if len(form) < len(reference):
            form = np.repeat(form, self.alike, axis=0)
        return PointLaw(VariedGramLaw(form, reference, self.own.shape[1]), self.element.to_points())

    def law(self) -> PointLaw:
        """Return the elastic law of the elements, on their difference vectors."""
        return self._law(self._summed())

    def damping(self) -> PointLaw:
        """Return the form of damping: of strains the mean over a section and the rest, by a time each.

        Stretch, shear and the change of the section are means; bending and torsion are what is left.
        """
        own, n = self.properties, self.own.shape[1] * (self.own.shape[1] + 1) // 2
        times = np.array([own.axial_damping, own.bending_damping])
        axial, bending = times[..., None, None]
        if not times.any():
            return self._law(np.broadcast_to(0.0, (len(self.own) * self.alike, n, n)))
        volume = self._places[1].sum(axis=1)[:, None, None]
        mean = np.asarray(sum(volume * strains for volume, strains in self._strains())) / volume
        E = elasticity(own, self.element.n_dim)
        whole = mean.swapaxes(1, 2) @ (volume * (E @ mean))
        return self._law(axial * whole + bending * self._summed(mean))
