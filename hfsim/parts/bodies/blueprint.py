"""What a beam of a deck is made of: the numbers from which each model makes its body."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.mechanics.body import Place, places
from hfsim.mechanics.connectivity import Connectivity
from hfsim.mechanics.force import ConstantForce
from hfsim.parts.bodies.mesh import BeamMesh
from hfsim.parts.elements import ELEMENTS, Continuum, Measures
from hfsim.parts.elements.forces import ElasticForce, KelvinVoigtForce, MaterialDamping

if TYPE_CHECKING:
    from hfsim.deck.stations import BeamAlong
    from hfsim.parts.bodies.section_mesh import SectionMesh


class Blueprint(NamedTuple):
    """A beam before it has a model.

    Attributes
    ----------
    name : str
        Of the body.
    start : int
        Column of x where its coordinates begin.
    gravity : ndarray, shape (n_dim,)
        [m/s^2].
    points : dict of str to Place
        Named points, root and tip among them.
    whole : bool
        Whether inertia terms are kept through all orders where a model would truncate them.
    form : str
        Way to the elastic force.
    """

    name: str
    start: int
    mesh: BeamMesh
    measures: Measures
    gravity: Array
    points: dict[str, Place]
    whole: bool
    form: str

    @classmethod
    def of(cls, spec: Any, name: str, start: int, deck: Any) -> Blueprint:
        """Return what a beam of a deck, a `BeamSpec`, is made of; its coordinates begin at a column."""
        properties: BeamAlong = deck.properties(name)
        element = ELEMENTS[spec.element].of(
            spec.length / spec.elements, spec.degree, spec.section_degree, deck.dimension
        )
        axial, bending = (spec.quadrature.axial, spec.quadrature.bending) if spec.quadrature else (None, None)
        beside = (0.0,) * (deck.dimension - 1)
        mesh = BeamMesh(element, spec.elements, properties)
        if isinstance(element, Continuum) and any((spec.axis, spec.section_angle, spec.twist)):
            from hfsim.parts.bodies.beam_axis import Axis
            from hfsim.parts.bodies.spatial_axis_mesh import AxisMesh

            mesh = AxisMesh(element, spec.elements, properties, Axis.of(spec))
        return cls(
            name=name,
            start=start,
            mesh=mesh,
            measures=Measures(spec.strain, spec.curvature, axial, bending, deck.dimension),
            gravity=np.array(deck.gravity),
            points={**places(spec.points), "root": (0.0, *beside), "tip": (spec.length, *beside)},
            whole=spec.truncation == "none",
            form=deck.solve.elastic_form,
        )

    @property
    def item(self) -> str:
        """Deck path of the body."""
        return f"bodies.{self.name}"

    @property
    def properties(self) -> BeamAlong:
        """What follows from material and section; without rotary inertia where that does not count."""
        return self.mesh.properties

    @property
    def n_dim(self) -> int:
        """Number of components of a vector."""
        return len(self.gravity)

    @property
    def sections(self) -> SectionMesh:
        """Nodes with section vectors and the mass, inertia and stiffness of its elements in space."""
        from hfsim.deck.materials import BeamProperties, SectionProperties
        from hfsim.parts.bodies.beam_axis import Axis, Line
        from hfsim.parts.bodies.section_mesh import SectionMesh

        own, mesh, seen = self.properties, self.mesh, SectionProperties.of_plane_sections
        sections = seen(own) if isinstance(own, BeamProperties) else own.seen_as(seen)
        axis = mesh.line or Axis(Line(), mesh.length)
        return SectionMesh(axis, mesh.count, mesh.element.degree, sections)

    @property
    def inertia(self) -> tuple[float, Array, Array]:
        """Mass [kg], its centre [m], and Euler's tensor about that, (n_dim, n_dim) [kg m^2], undeformed."""
        mesh = self.mesh
        mass = float(mesh.vector_masses @ mesh.positions)
        centre = mesh.vector_masses @ self.undeformed / mass
        arms = self.undeformed - np.outer(mesh.positions, centre)
        own = (arms[own].T @ block @ arms[own] for own, block in mesh.masses_of_elements())
        return mass, centre, np.sum(list(own), axis=0)

    @property
    def undeformed(self) -> Array:
        """Nodal vectors in the body frame, shape (n_vectors, n_dim)."""
        plane = self.mesh.undeformed
        missing = self.n_dim - plane.shape[1]
        return np.pad(plane, ((0, 0), (0, missing))) if missing else plane

    def columns(self, count: int) -> slice:
        """Return the run of so many coordinates."""
        return slice(self.start, self.start + count)

    @property
    def nodal_columns(self) -> slice:
        """The run of all components of its nodal vectors."""
        return self.columns(self.n_dim * self.mesh.n_vectors)

    @property
    def element_columns(self) -> IntArray:
        """The nodal coordinates of each element, shape (n_elements, k)."""
        element = self.mesh.element
        first = self.start + self.n_dim * element.stride * np.arange(self.mesh.count)
        return np.asarray(first[:, None] + np.arange(self.n_dim * (element.stride + element.per_node)))

    def connectivity(self, n: int, vectors: Array) -> Connectivity:
        """Return how vectors of each element follow from its nodal ones, by a matrix, among n coordinates."""
        local = np.kron(vectors, np.eye(self.n_dim))
        return Connectivity(n, self.element_columns, np.tile(local, (self.mesh.count, 1, 1)), self.n_dim)

    def difference_vectors(self, vectors: Array) -> Array:
        """Return those of nodal vectors (n_batch, n, n_dim), (n_batch, n_elements, n_differences, n_dim)."""
        element = self.mesh.element
        first = element.stride * np.arange(self.mesh.count)[:, None]
        own = vectors[:, first + np.arange(element.stride + element.per_node)]
        return np.asarray(element.differences() @ own)

    def elastic_force(self, n: int) -> ElasticForce:
        """Return the elastic force on its nodal vectors in the form asked for."""
        law, vectors = self.mesh.elastic_law(self.form, self.measures)
        elements = self.connectivity(n, vectors)
        force = ElasticForce(elements, law, item=self.item)
        return force.in_strains() if self.n_dim == 3 and self.mesh.element.per_node > 2 else force

    def damping(self, n: int) -> MaterialDamping:
        """Return the damping force on its nodal vectors."""
        if (points := self.mesh.section_points()) is None:
            return self._kelvin_voigt(n)
        from hfsim.parts.elements.continuum_damping import ContinuumDamping

        elements = self.connectivity(n, self.mesh.element.differences())
        return ContinuumDamping(elements, points.damping(), item=self.item)

    def _kelvin_voigt(self, n: int) -> KelvinVoigtForce:
        """Return that of lines."""
        element = self.mesh.element
        return KelvinVoigtForce.of(
            elements=self.connectivity(n, element.differences()),
            degree=element.degree,
            length=element.length,
            properties=self.properties,
            measures=self.measures,
            item=self.item,
        )

    def weight(self, n: int) -> ConstantForce:
        """Return the weight on its nodal vectors: masses of vectors times gravity (eq. 31)."""
        columns = np.arange(self.nodal_columns.start, self.nodal_columns.stop)
        return ConstantForce(n, columns, np.kron(self.mesh.vector_masses, self.gravity), item=self.item)

    def element_matrices(self, curvature: str) -> tuple[Array, Array]:
        """Return stiffness [J] and damping [J s] of each undeformed element over its difference vectors.

        Shapes (n_elements, n_vectors * n_dim, n_vectors * n_dim).
        """
        straight = self.difference_vectors(self.undeformed[None])
        law = self.mesh.law(self.measures._replace(curvature=curvature))
        K = np.asarray(law.hessian(straight)[0])
        if not self.properties.damped:
            return K, np.zeros_like(K)
        if (points := self.mesh.section_points()) is None:
            return K, self._kelvin_voigt(0).resistance(straight)
        return K, np.asarray(points.damping().hessian(straight)[0])
