"""A beam cut into equal elements of nodes with section vectors: shape rows and undeformed state."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.frozen import frozen
from hfsim.maths.shapes import gauss_legendre, gauss_lobatto, lagrange, piecewise, weights_beyond
from hfsim.mechanics.body import Place
from hfsim.parts.bodies.beam_axis import Axis
from hfsim.parts.elements.cosserat import STRAINS, CosseratLaw, point_rows, vector_rows
from hfsim.parts.elements.section_strains import PointStrains

if TYPE_CHECKING:
    from hfsim.deck.materials import SectionProperties
    from hfsim.deck.stations import SectionsAlong

OUTLINE = 200
"""Points of a picture's line, near enough."""
ALIKE = 1e-12
"""Relative difference of moments that is none."""


@frozen
class SectionMesh:
    """Equal elements in a row; each node has position, second and in space third section axis, in this order.

    Attributes
    ----------
    count, degree : int
        Number of elements, and of intervals between nodes in each.
    """

    axis: Axis
    count: int
    degree: int
    properties: SectionsAlong

    @property
    def n_dim(self) -> int:
        """Of space; so many vectors has a node."""
        return self.axis.n_dim

    @cached_property
    def strains(self) -> PointStrains:
        """Those at the Gauss points."""
        return PointStrains(STRAINS[self.n_dim], self._principal[1])

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return self.count * self.degree + 1

    @property
    def _element_length(self) -> float:
        return self.axis.length / self.count

    def _along(self, places: Array) -> Array:
        """Return places of the unit interval in every element in turn, (count * n,) [m]."""
        return (np.arange(self.count)[:, None] + places).ravel() * self._element_length

    @cached_property
    def undeformed(self) -> Array:
        """Nodal vectors in the body frame, shape (n_dim n_nodes, n_dim)."""
        points, sections = self.axis.sections(self.node_places)
        vectors = np.concatenate([points[:, None], sections.swapaxes(1, 2)[:, 1:]], axis=1)
        return vectors.reshape(-1, self.n_dim)

    @property
    def node_places(self) -> Array:
        """Distances of the nodes from the root along the line, (n_nodes,) [m]."""
        inner = self._along(gauss_lobatto(self.degree + 1)[0][:-1])
        return np.append(inner, self.axis.length)

    @cached_property
    def positions(self) -> Array:
        """One for nodal vectors that are positions, zero for section vectors, shape (n_dim n_nodes,)."""
        return np.tile(np.eye(self.n_dim)[0], self.n_nodes)

    @cached_property
    def masses(self) -> Array:
        """What each nodal vector's acceleration is multiplied by, (n_dim n_nodes,) [kg], [kg m^2].

        By Gauss-Lobatto quadrature in each element, whose nodes are its points.
        """
        own = self._masses(gauss_lobatto(self.degree + 1)[1])
        at_nodes = np.bincount(self.spans.ravel(), own.ravel(), self.n_dim * self.n_nodes)
        return np.asarray(at_nodes, dtype=float)

    @property
    def inertia(self) -> tuple[float, Array, Array]:
        """Mass [kg], its centre [m], and Euler's tensor about that, (n_dim, n_dim) [kg m^2], undeformed.

        Those of the nodes, but for stations inside elements.
        """
        x, w = piecewise(gauss_lobatto(self.degree + 1), self.properties.cuts(self.count))
        own = self.properties.in_elements(x, self.count)
        points, sections = self.axis.sections(self._along(x))
        lengths = np.tile(w * self._element_length, self.count)
        mass, *rotary = (
            np.broadcast_to(one, (self.count, len(x))).ravel() * lengths
            for one in (own.mass_per_length, *own.rotary_inertia[::-1])
        )
        centre = mass @ points / mass.sum()
        each = [points - centre, *np.moveaxis(sections, 2, 0)[1:]]
        tensors = [(one.T * by) @ one for one, by in zip(each, [mass, *rotary], strict=False)]
        return float(mass.sum()), centre, np.sum(tensors, axis=0)

    def masses_from(self, start: float) -> Array:
        """Return the mass matrix of one component of the part of each element beyond a share of its length.

        Shape (count, n, n) [kg], [kg m^2]: integrals of the polynomials through the nodes.
        """
        own = self._masses(weights_beyond(gauss_lobatto(self.degree + 1)[0], np.array([start]))[0])
        return np.asarray(own[..., None] * np.eye(own.shape[1]))

    def _masses(self, weights: Array) -> Array:
        """Return what the vectors of each element have by weights at its nodes, (count, n)."""
        own = self.properties.in_elements(gauss_lobatto(self.degree + 1)[0], self.count)
        about_y, about_z = own.rotary_inertia
        each = [own.mass_per_length, about_z, about_y][: self.n_dim]
        lengths, shape = weights * self._element_length, self._nodes.shape
        found = np.stack([np.broadcast_to(one * lengths, shape) for one in each], axis=-1, dtype=float)
        return found.reshape(self.count, -1)

    @property
    def round(self) -> bool:
        """Whether it is a straight line with sections in space that are the same all around it."""
        if self.n_dim != 3 or not self.axis.straight:
            return False
        own = self.properties.in_elements(gauss_lobatto(self.degree + 1)[0], self.count)
        return not np.any(own.couplings) and all(
            np.allclose(*pair, rtol=ALIKE, atol=0.0)
            for pair in (own.rotary_inertia, own.shear_stiffness, own.bending_stiffness)
        )

    @property
    def spans(self) -> IntArray:
        """Which vectors each element has, shape (count, n)."""
        own = np.arange(self.n_dim * (self.degree + 1))
        return np.asarray(self.n_dim * self.degree * np.arange(self.count)[:, None] + own)

    @property
    def distances(self) -> Array:
        """Nodal vectors of the distance from the root along the beam, (n_dim n_nodes,)."""
        return np.kron(self.node_places, np.eye(self.n_dim)[0])

    @property
    def length(self) -> float:
        """Undeformed length [m]."""
        return self.axis.length

    @property
    def outline_places(self) -> Array:
        """Places along the beam between which a straight line passes for the curve."""
        return np.linspace(0.0, self.length, max(1, OUTLINE // self.count) * self.count + 1)

    @property
    def _nodes(self) -> IntArray:
        """The nodes of each element, (count, degree + 1)."""
        return np.asarray(self.degree * np.arange(self.count)[:, None] + np.arange(self.degree + 1))

    @cached_property
    def points(self) -> tuple[Array, Array]:
        """Places of the Gauss points of all elements, and weights of integrals over the length [m]."""
        places, weights = gauss_legendre(self.degree)
        return self._along(places), np.tile(weights * self._element_length, self.count)

    @cached_property
    def point_vectors(self) -> tuple[IntArray, Array]:
        """The nodal vectors of each Gauss point and the rows of (r', d.., d'..) over them.

        Shapes (n_points, n_dim (degree + 1)) and (n_points, 2 n_dim - 1, n_dim (degree + 1)).
        """
        values, slopes = point_rows(self.degree)
        rows = vector_rows(values, slopes / self._element_length, self.n_dim)
        width = self.n_dim * (self.degree + 1)
        first = self.n_dim * self.degree * np.arange(self.count)
        vectors = np.repeat(first, self.degree)[:, None] + np.arange(width)
        return vectors, np.tile(rows, (self.count, 1, 1))

    def law(self) -> CosseratLaw:
        """Return the elastic law of all Gauss points; undeformed, the beam is without stress."""
        vectors, rows = self.point_vectors
        undeformed = self.strains.of(rows @ self.undeformed[vectors])
        stiffness = self.resisting[0] * self.points[1]
        return CosseratLaw(stiffness, undeformed, self.degree, self.strains)

    @cached_property
    def resisting(self) -> Array:
        """Stiffness and damping at Gauss points, of the strains there are, (2, n_strains, n_points)."""
        times = np.array(self.at(self.points[0]).retardation)[list(STRAINS[self.n_dim].which)]
        stiffness = self._principal[0]
        return np.stack([stiffness, times.reshape(len(times), -1) * stiffness])

    @cached_property
    def _principal(self) -> tuple[Array, Array | None]:
        """D and T of the stiffness T^T D T at Gauss points, see `PointStrains`; no T if it is diagonal."""
        C = self.stiffness_at(self.points[0])
        D = np.einsum("pii->ip", C)
        if not (C - D.T[:, None] * np.eye(len(D))).any():
            return D, None
        root = np.linalg.cholesky(C)
        diagonal = np.einsum("pii->pi", root)
        return diagonal.T**2, np.moveaxis(root / diagonal[:, None], (2, 1), (0, 1))

    def stiffness_at(self, places: Array) -> Array:
        """Return the stiffness at distances from the root [m], (n_places, n_strains, n_strains)."""
        own, which = self.at(places), STRAINS[self.n_dim].which
        C, (i, j), k = np.zeros((len(places), 6, 6)), np.triu_indices(6, 1), np.arange(6)
        C[:, i, j] = C[:, j, i] = np.array(own.couplings).T
        C[:, k, k] = np.array(own.stiffness).T
        return C[:, which][:, :, which]

    def at(self, places: Array) -> SectionProperties:
        """Return the properties at distances from the root [m], arrays of their shape where they vary."""
        return self.properties.at(places / self.axis.length)

    def shape(self, place: Array | float) -> tuple[Array, Array]:
        """Return the rows of position, and of the section vectors, over all nodal vectors.

        Shapes (*place.shape, n_dim n_nodes) and (*place.shape, n_dim - 1, n_dim n_nodes), for places
        (n_places,) or a single one.
        """
        places = np.atleast_1d(place) / self._element_length
        e = np.minimum(places.astype(int), self.count - 1)
        nodes, _ = gauss_lobatto(self.degree + 1)
        values = lagrange(places - e, nodes)
        rows = np.zeros((len(e), self.n_dim, self.n_nodes, self.n_dim))
        for k in range(self.n_dim):
            rows[np.arange(len(e))[:, None], k, self._nodes[e], k] = values
        flat = rows.reshape(len(e), self.n_dim, -1)
        return (flat[:, 0], flat[:, 1:]) if np.ndim(place) else (flat[0, 0], flat[0, 1:])

    def reference(self, place: Place) -> Place:
        """Return where a point is in the undeformed body frame: places count along the line."""
        row, _, _ = self.point(place)
        return tuple(map(float, row @ self.undeformed))

    def point(self, place: Place) -> tuple[Array, Array, Array]:
        """Return the rows of a point off the line and of its section vectors, and the section's axes there.

        The axes are columns in the body frame, shape (n_dim, n_dim).
        """
        position, section = self.shape(place[0])
        _, line = self.axis.at(np.array(place[:1]))
        _, axes = self.axis.sections(np.array(place[:1]))
        beside = line[0][:, 1:] @ np.array(place[1:])
        return position + (axes[0].T @ beside)[1:] @ section, section, axes[0]
