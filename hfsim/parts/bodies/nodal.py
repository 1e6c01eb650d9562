"""Beams in absolute nodal coordinates: models exact and ancf, and what linear shares with them.

What differs in space is in `hfsim.parts.bodies.spatial_nodal`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Self

import numpy as np

from hfsim.maths.arrays import Array, cumulative
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.mechanics.body import Place
from hfsim.mechanics.chart import Chart
from hfsim.mechanics.deformation import Deformation, size
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.planar_markers import NodalMarker
from hfsim.mechanics.pose import Pose, Twist
from hfsim.parts.bodies.blueprint import Blueprint
from hfsim.parts.bodies.mesh import BeamMesh
from hfsim.parts.bodies.planar_frame import FrameChart
from hfsim.parts.bodies.planar_natural import NaturalBeams, PlanarIncrements
from hfsim.parts.bodies.vector_beam import VectorBeam


@frozen
class NodalBeam(VectorBeam):
    """A beam in absolute nodal coordinates.

    Attributes
    ----------
    framed : bool
        Whether it is stepped in a body frame and coordinates relative to that.
    """

    beam: Blueprint
    framed: bool
    coordinates: ClassVar[str] = "nodal vectors"

    @classmethod
    def of(cls, beam: Blueprint, framed: bool) -> Self:
        """Return the body of a beam."""
        return cls(beam.name, beam.nodal_columns, beam.points, beam, framed)

    @property
    def mesh(self) -> BeamMesh:
        """Its elements."""
        return self.beam.mesh

    @property
    def described(self) -> tuple[str, str]:
        """Its elements."""
        return f"positions and slopes of {self.mesh.count} elements", "flexible"

    @property
    def angle_column(self) -> int | None:
        """The one after the origin, if the state has a body frame."""
        return int(self.columns.start) + 2 if self.framed else None

    @property
    def undeformed(self) -> Array:
        """Those of the nodes."""
        return self.beam.undeformed

    def marker(self, place: Place) -> Marker:
        """Return the marker of a material point; its direction is that of the beam's axis there."""
        return NodalMarker(self.columns, *self._rows(place))

    def grip(self, place: Place) -> Marker:
        """Return the marker of the section there, by r_y, where it has one.

        What holds a section holds its moments on any mesh; the slope alone, which differs from its normal by
        shear, would hold them less the shorter the element is.
        """
        if self.mesh.element.per_node == 2:
            return self.marker(place)
        from hfsim.mechanics.planar_section_marker import StretchingSectionMarker

        side = self.mesh.shape(place[0], place[1], (0, 1))
        return StretchingSectionMarker(self.columns, self._rows(place)[0], side, 0.5 * np.pi)

    def _rows(self, place: Place) -> tuple[Array, Array]:
        """Return the shape rows of a point and of the slope of the axis there."""
        return self.mesh.shape(place[0], place[1]), self.mesh.shape(place[0], place[1], (1, 0))

    @property
    def gravity(self) -> Array:
        """Acceleration of gravity that acts on it [m/s^2]."""
        return self.beam.gravity

    def line(self, x: Array, places: Array) -> Array:
        """Return points of its line, (n_batch, n_places, n_dim)."""
        return np.asarray(self.mesh.shape(places) @ self.vectors(x))

    def section_axes(self, x: Array, places: Array) -> Array:
        """Return the axes of sections at places, (n_batch, n_places, 3, 3), as columns."""
        from hfsim.parts.bodies.section_axes import in_the_plane

        return in_the_plane(self._slopes(x, places))

    def _slopes(self, x: Array, places: Array) -> Array:
        """Return r' at places, (n_batch, n_places, n_dim)."""
        return np.asarray(self.mesh.shape(places, 0.0, (1, 0)) @ self.vectors(x))

    def deformation(self, x: Array, u: Array) -> Deformation:
        """Return how its line changes, in the frame at the root and the axes of undeformed sections."""
        axis, line, root = self.mesh.axis, self.mesh.line, self.marker(self.origin)
        p = self.arms(x) @ root.frame(x) - self.undeformed
        slope, bent, tip = (rows @ p for rows in (axis.slope, axis.curvature, axis.tip))
        if line is not None:
            axes = line.sections(np.append(axis.places, self.mesh.length))[1]
            slope, bent = ((one[..., None, :] @ axes[:-1])[..., 0, :] for one in (slope, bent))
            tip = tip @ axes[-1]
        seen = (slope[..., 0], slope[..., 1:], bent[..., 1:], tip[:, 1:])
        return Deformation(axis.places, axis.weights, *seen, spin=root.spin(x, u))

    def deformed(self, pose: Pose, twist: Twist, seen: Deformation) -> tuple[Array, Array]:
        """Return nodal vectors and rates of the bent and stretched beam; sections stay normal to the axis."""
        mesh, stride = self.mesh, self.mesh.element.stride
        gradient = np.column_stack([self._stretch(seen), seen.slope[0]])
        bent, slopes = self.beam.undeformed.copy(), self._at_nodes(seen, gradient)
        bent[::stride] += self._at_nodes(seen, cumulative(gradient, seen.places))
        bent[1::stride] += slopes
        for k in range(2, mesh.element.per_node):
            bent[k::stride, 0] -= slopes[:, k - 1]
        return self.taken_along(pose, twist, bent)

    def _at_nodes(self, seen: Deformation, values: Array) -> Array:
        """Return at the nodes what is known at the places of a deformation, (n_points, k)."""
        nodes = self.mesh.element.length * np.arange(self.mesh.count + 1)
        return np.stack([np.interp(nodes, seen.places, one) for one in values.T], axis=-1)

    def _stretch(self, seen: Deformation) -> Array:
        """Return what the axial coordinates must be for a stretch: bending alone stretches nothing."""
        return np.asarray(seen.axial[0] - 0.5 * seen.steepness[0] ** 2)

    @property
    def gives_way_at(self) -> float | None:
        """That of the Green strain, whose force in a stretch s goes with s^3 - s."""
        return 3.0**-0.5 if self.beam.measures.strain == "green" else None

    def smallest_stretch(self, x: Array) -> Array:
        """Return the smallest length of the slope vector."""
        places = np.linspace(0.0, self.mesh.length, 4 * self.mesh.count + 1)
        return np.asarray(size(self._slopes(x, places)).min(axis=1))

    def mass_entries(self) -> Entries:
        """Return those of its elements."""
        blocks = np.kron(self.mesh.element_masses, np.eye(self.n_dim)[None])
        columns = self.beam.element_columns
        return Entries.of_block(columns, columns, np.broadcast_to(blocks, (len(columns), *blocks.shape[1:])))

    def forces(self, n: int) -> Iterator[ForcePart]:
        """Yield weight, elastic force and damping."""
        yield self.beam.weight(n)
        yield self.beam.elastic_force(n)
        yield self.beam.damping(n)

    def chart(self) -> Chart | None:
        """Return the map to the body frame, if it is stepped in that."""
        return FrameChart(self.columns, 1, self.mesh.element.stride) if self.framed else None

    def increments(self) -> PlanarIncrements | None:
        """Return the natural increments of the Green strain, where there are such."""
        element = self.mesh.element
        row = (self.columns, 1, element.stride, element.length, self.framed)
        if element.stride == element.per_node:
            return NaturalBeams(*row)
        if element.per_node > 2:
            from hfsim.parts.bodies.planar_carried import CarriedBeams

            return None if self.framed else CarriedBeams(*row[:3], element.per_node)
        from hfsim.parts.bodies.planar_interior import InteriorBeams

        return InteriorBeams(*row)
