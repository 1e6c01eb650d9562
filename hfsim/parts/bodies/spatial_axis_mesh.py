"""Fully parameterised beams in space whose line is curved, or whose sections are turned: their elements."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.shapes import gauss_lobatto
from hfsim.mechanics.body import Place
from hfsim.parts.bodies.beam_axis import Axis
from hfsim.parts.bodies.mesh import BeamMesh
from hfsim.parts.elements import ElasticLaw, Measures, elastic_form
from hfsim.parts.elements.continuum import Continuum
from hfsim.parts.elements.continuum_points import ContinuumPoints
from hfsim.parts.elements.spatial_curved import CurvedContinuum, curved_masses


@frozen
class AxisMesh(BeamMesh):
    """Elements of the type `Continuum` along an axis.

    Nodes are on it, with its tangent and the axes of its sections; between them the undeformed beam is what
    the polynomials of the element make of it.
    """

    element: Continuum
    line: Axis

    @property
    def _turned_only(self) -> bool:
        """Whether all elements are straight, and alike but for their direction."""
        return self.line.straight and not self.line.twist

    @cached_property
    def undeformed(self) -> Array:
        """Nodal vectors in the body frame, shape (n_vectors, 3)."""
        element, n = self.element, self.count
        nodes = element.length * np.arange(n + 1)
        P = np.zeros((self.n_vectors, 3))
        P[:: element.stride] = self.line.at(nodes)[0]
        axes = self.line.sections(nodes)[1]
        for k in range(3):
            P[k + 1 :: element.stride] = axes[:, :, k]
        if element.stride > element.per_node and not self._turned_only:
            self._fit_interior(P)
        return P

    def _fit_interior(self, P: Array) -> None:
        """Set interior vectors to meet the gradients of the axis at Gauss-Lobatto points best, in place."""
        element, units = self.element, ((1, 0, 0), (0, 1, 0), (0, 0, 1))
        places = gauss_lobatto(max(element.degree, element.section_degree + 1))[0]
        rows = np.array([element.shape(float(a), 0.0, by) for a in places for by in units])
        inner = slice(element.per_node, element.stride)
        for e in range(self.count):
            own = P[self._span(e)]
            axes = self.line.sections((e + places) * element.length)[1]
            missed = axes.swapaxes(1, 2).reshape(-1, 3) - rows @ own
            own[inner] = np.linalg.lstsq(rows[:, inner], missed, rcond=None)[0]

    @cached_property
    def _of_elements(self) -> Array:
        """The vectors of each element, shape (n_elements, n, 3)."""
        return np.array([self.undeformed[self._span(e)] for e in range(self.count)])

    def masses_from(self, start: float) -> Array:
        """Return those of the part of each element beyond a share of its length."""
        if self._turned_only:
            return super().masses_from(start)
        return curved_masses(self.element, self.properties, self._of_elements, start)

    def law(self, measures: Measures) -> ElasticLaw:
        """Return the elastic law of its elements on their difference vectors."""
        if self._turned_only:
            return super().law(measures)
        return self.section_points().law()

    def section_points(self) -> ContinuumPoints:
        """Return the Gauss points of the axes of its elements."""
        undeformed = None if self._turned_only else self._of_elements
        return ContinuumPoints.of(self.element, self.properties, self.count, undeformed)

    def elastic_law(self, form: str, measures: Measures) -> tuple[ElasticLaw, Array]:
        """Return the law in one of the forms, and the matrix to its vectors from nodal ones."""
        if form == "gram" or self._turned_only:
            return super().elastic_law(form, measures)
        own, numbers = self.element, self._of_elements.tolist()
        each = (tuple(map(tuple, vectors)) for vectors in numbers)
        elements = [CurvedContinuum(own.length, own.degree, own.section_degree, 3, one) for one in each]
        law: ElasticLaw = elastic_form(form).law_of_each(elements, self.properties, measures)
        return law, np.eye(own.stride + own.per_node)

    def beside(self, place: Place) -> Place:
        """Return a point with its distances from the line along the axes of the section there."""
        at = np.array(place[:1])
        across = self.line.at(at)[1][0][:, 1:] @ np.array(place[1:])
        return place[0], *map(float, across @ self.line.sections(at)[1][0][:, 1:])

    def reference(self, place: Place) -> Place:
        """Return where a point is in the undeformed body frame: places count along the line."""
        x, y, z = self.beside(place)
        return tuple(map(float, self.shape(x, y, (0, 0, 0), z) @ self.undeformed))
