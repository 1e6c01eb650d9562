"""A beam cut into equal elements: nodal vectors, mass matrix, shape rows, difference vectors."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hfsim.deck.materials import BeamProperties
from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.frozen import frozen
from hfsim.maths.shapes import gauss_legendre
from hfsim.mechanics.body import Place
from hfsim.parts.elements import Continuum, ElasticLaw, Element, Measures, elastic_form

if TYPE_CHECKING:
    from hfsim.deck.stations import BeamAlong
    from hfsim.parts.bodies.beam_axis import Axis
    from hfsim.parts.elements.continuum_points import ContinuumPoints


class AxisRows(NamedTuple):
    """Places along an axis with weights for integrals [m], and shape rows there and at the tip.

    Attributes
    ----------
    places, weights : ndarray, shape (n_points,)
    slope, curvature : ndarray, shape (n_points, n_vectors)
        First and second derivatives.
    tip : ndarray, shape (n_vectors,)
    """

    places: Array
    weights: Array
    slope: Array
    curvature: Array
    tip: Array


@frozen
class BeamMesh:
    """Equal elements in a row; the vectors are those of node 0, the interior of element 0, node 1, ...

    Each node has ``element.per_node`` vectors: its position, its slope vector and, for elements with
    a section, the other gradient vectors.  With ``stride`` vectors from one node to the next, every
    stride-th vector is a position.  Nodal vectors mean all of them, interior ones included.

    Attributes
    ----------
    count : int
        Number of elements.
    properties : BeamProperties or Varied of these
        Mass per length and the like.
    line : Axis or None
        Undeformed, where it is curved or has its sections turned.
    """

    element: Element
    count: int
    properties: BeamAlong
    line: Axis | None = None

    @property
    def length(self) -> float:
        """Undeformed length [m]."""
        return self.element.length * self.count

    @property
    def outline_places(self) -> Array:
        """Places along the beam, from 0 to its length, between which a straight line passes for the curve."""
        interior = self.element.stride - self.element.per_node
        per_element = max(1, min(8 * (1 + interior), 200 // self.count))
        return np.linspace(0.0, self.length, min(self.count * per_element, 400) + 1)

    @property
    def n_vectors(self) -> int:
        """Number of nodal vectors."""
        return self.count * self.element.stride + self.element.per_node

    def _span(self, e: int) -> slice:
        """Return which vectors element e has."""
        start = e * self.element.stride
        return slice(start, start + self.element.stride + self.element.per_node)

    @cached_property
    def undeformed(self) -> Array:
        """Nodal vectors of the straight beam along the first axis, shape (n_vectors, 2), or with
        three components where sections have two gradient vectors.
        """
        stride, per_node = self.element.stride, self.element.per_node
        P = np.zeros((self.n_vectors, max(2, per_node - 1)))
        P[::stride, 0] = self.element.length * np.arange(self.count + 1)
        for k in range(1, per_node):
            P[k::stride, k - 1] = 1.0
        return P

    @cached_property
    def positions(self) -> Array:
        """One for nodal vectors that are positions, zero for gradients, shape (n_vectors,)."""
        places = np.zeros(self.n_vectors)
        places[:: self.element.stride] = 1.0
        return places

    @cached_property
    def axis(self) -> AxisRows:
        """Places along the axis, four Gauss points an element, and what is needed there."""
        xi, w = gauss_legendre(4)
        places = (np.arange(self.count)[:, None] + xi).ravel() * self.element.length
        slope, curvature = (self.shape(places, 0.0, (k, 0)) for k in (1, 2))
        weights = np.tile(w, self.count) * self.element.length
        return AxisRows(places, weights, slope, curvature, self.shape(self.length))

    @cached_property
    def element_masses(self) -> Array:
        """Mass matrix of one component of each element, or of all, shape (n_elements or 1, n, n) [kg]."""
        return self.masses_from(0.0)

    def masses_from(self, start: float) -> Array:
        """Return the same of the part of each element beyond a share of its length."""
        M = self.element.mass(self.properties, self.count, start)
        return M.reshape(-1, *M.shape[-2:])

    @cached_property
    def spans(self) -> IntArray:
        """Which vectors each element has, shape (n_elements, n)."""
        own = np.arange(self.element.stride + self.element.per_node)
        return np.asarray(self.element.stride * np.arange(self.count)[:, None] + own)

    @property
    def distances(self) -> Array:
        """Nodal vectors of the distance from the root along the beam, shape (n_vectors,)."""
        stride = self.element.stride
        found = np.zeros(self.n_vectors)
        found[::stride] = self.element.length * np.arange(self.count + 1)
        found[1::stride] = 1.0
        return found

    def at(self, places: Array) -> BeamProperties:
        """Return the properties at distances from the root [m], arrays of their shape where they vary."""
        return self.properties.at(places / self.length)

    def masses_beyond(self, places: Array) -> tuple[Array, Array, Array]:
        """Return int_x^L rho A (s - x)^k ds for k = 0, 1, 2 at equidistant places x from root to tip.

        Of each interval between places by Gauss points, as if no section jumped inside it.
        """
        rest = self.length - places
        if isinstance(density := self.at(places).mass_per_length, float):
            return density * rest, density * (0.5 * rest**2), density * (rest**3 / 3.0)
        xi, w = gauss_legendre(4)
        step = places[1]
        s = (places[:-1, None] + step * xi).ravel()
        m = np.tile(w * step, len(places) - 1) * self.at(s).mass_per_length
        arms = np.maximum(s - places[:, None], 0.0)
        return (arms > 0.0) @ m, arms @ m, arms**2 @ m

    @cached_property
    def mass(self) -> Array:
        """Mass matrix of one vector component, int rho N^T N dV of eq. (12), shape (n_vectors, n_vectors)."""
        M = np.zeros((self.n_vectors, self.n_vectors))
        for own, block in self.masses_of_elements():
            M[own, own] += block
        return M

    def masses_of_elements(self) -> Iterator[tuple[slice, Array]]:
        """Yield which vectors each element has, and its mass matrix of one component."""
        masses = self.element_masses
        for e, block in enumerate(np.broadcast_to(masses, (self.count, *masses.shape[1:]))):
            yield self._span(e), block

    @cached_property
    def vector_masses(self) -> Array:
        """What a uniform acceleration is multiplied by at each nodal vector, shape (n_vectors,) [kg]."""
        element = self.element
        places = np.zeros(element.stride + element.per_node)
        places[:: element.stride] = 1.0
        own = self.element_masses @ places
        spans = self.spans
        weights = np.broadcast_to(own, spans.shape).ravel()
        masses = np.bincount(spans.ravel(), weights=weights, minlength=self.n_vectors)
        return np.asarray(masses, dtype=float)

    @cached_property
    def differences(self) -> Array:
        """Matrix from nodal vectors to the difference vectors of all elements, (count * n, n_vectors)."""
        local = self.element.differences()
        n = len(local)
        D = np.zeros((self.count * n, self.n_vectors))
        for e in range(self.count):
            D[e * n : (e + 1) * n, self._span(e)] = local
        return D

    def law(self, measures: Measures) -> ElasticLaw:
        """Return the elastic law of its elements on their difference vectors."""
        alike = isinstance(self.properties, BeamProperties)
        points = None if alike else self.section_points()
        return points.law() if points else self.element.law(self.properties, self.count, measures)

    def section_points(self) -> ContinuumPoints | None:
        """Return the Gauss points of the axes of its elements; None if these have no section vectors."""
        if not isinstance(self.element, Continuum):
            return None
        from hfsim.parts.elements.continuum_points import ContinuumPoints

        return ContinuumPoints.of(self.element, self.properties, self.count)

    def elastic_law(self, form: str, measures: Measures) -> tuple[ElasticLaw, Array]:
        """Return the law in one of the forms, and the matrix to its vectors from nodal ones."""
        if form == "gram":
            return self.law(measures), self.element.differences()
        law = elastic_form(form).law_of(self.element, self.properties, self.count, measures)
        return law, np.eye(self.element.stride + self.element.per_node)

    def beside(self, place: Place) -> Place:
        """Return a point with its distances from the line along the axes of the section there."""
        return place

    def reference(self, place: Place) -> Place:
        """Return where a point is in the undeformed body frame: places count along the line."""
        return place

    def shape(
        self, x: Array | float, y: float = 0.0, derivative: tuple[int, ...] = (0, 0), z: float = 0.0
    ) -> Array:
        """Return shape rows N(x, y, z), or derivatives of them, over all nodal vectors.

        Shape (*x.shape, n_vectors) for places (n_places,) or a single one.
        """
        place = np.atleast_1d(x) / self.element.length
        e = np.minimum(place.astype(int), self.count - 1)
        rows = np.zeros((len(e), self.n_vectors))
        rows[np.arange(len(e))[:, None], self.spans[e]] = self.element.shape(place - e, y, derivative, z)
        return rows if np.ndim(x) else rows[0]
