"""Fully parameterised beams in space: the element ``continuum`` in absolute nodal coordinates."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import cross, rotation
from hfsim.mechanics.body import Place
from hfsim.mechanics.carried import Carried
from hfsim.mechanics.deformation import Deformation
from hfsim.mechanics.gradient_markers import SECTIONAL, TANGENTIAL, GradientMarker
from hfsim.mechanics.pose import Pose, Twist
from hfsim.parts.bodies.spatial_nodal import SpatialNodalBeam


@frozen
class SpatialContinuumBeam(SpatialNodalBeam):
    """A beam with r, r_x, r_y and r_z at its nodes."""

    @property
    def described(self) -> tuple[str, str]:
        """Its elements."""
        return f"positions and gradients of {self.mesh.count} elements", "flexible"

    def marker(self, place: Place) -> GradientMarker:
        """Return the marker of a point: undeformed, its axes are those of the body frame.

        Of a straight beam r_x is along its first axis, r_y in the plane of the first two.
        """
        return self._marker(place, ((1, 0, 0), (0, 1, 0)), TANGENTIAL)

    def grip(self, place: Place) -> GradientMarker:
        """Return that of the section there: r_z along its third axis, r_y in the plane of the last two.

        What holds a section holds its moments on any mesh; the slope alone, which differs from its normal by
        shear, would hold them less the shorter the element is.
        """
        return self._marker(place, ((0, 0, 1), (0, 1, 0)), SECTIONAL)

    def carried(self) -> Carried | None:
        """Return the vectors of each node with its section vectors, in the frame of the root none."""
        if self.framed:
            return None
        columns = np.arange(self.columns.start, self.columns.stop).reshape(-1, 3)
        return Carried.by_sections(columns, self.mesh.element.stride, 2, self.position_columns)

    def deformed(self, pose: Pose, twist: Twist, seen: Deformation) -> tuple[Array, Array]:
        """Return nodal vectors and rates of the beam whose line moves and whose sections turn as seen.

        Of what has no sections, sections stay normal to the axis.
        """
        if seen.sections is None:
            return super().deformed(pose, twist, seen)
        moved, turns = np.split(seen.sections[0], 2, axis=1)
        axes = self._undeformed_axes(seen.places)
        gradients = axes.swapaxes(1, 2) @ rotation(turns).swapaxes(1, 2)
        strains = np.column_stack([seen.axial[0], seen.slope[0]])
        gradients[:, 0] += (axes @ strains[..., None])[..., 0] - cross(turns, axes[..., 0])
        bent, stride = self.beam.undeformed.copy(), self.mesh.element.stride
        bent[::stride] += self._at_nodes(seen, moved)
        for k in range(3):
            bent[k + 1 :: stride] = self._at_nodes(seen, gradients[:, k])
        self._fit_interior(bent, seen.places, gradients)
        return self.taken_along(pose, twist, bent)

    def _undeformed_axes(self, places: Array) -> Array:
        """Return the axes of undeformed sections in the body frame, as columns, (n_places, 3, 3)."""
        if self.mesh.line is None:
            return np.broadcast_to(np.eye(3), (len(places), 3, 3))
        return self.mesh.line.sections(places)[1]

    def _fit_interior(self, vectors: Array, places: Array, gradients: Array) -> None:
        """Set the interior vectors so that gradients (n_places, 3, 3), as rows, are met best, in place."""
        interior = np.arange(len(vectors)) % self.mesh.element.stride > 3
        if interior.any():
            units = [tuple(map(int, one)) for one in np.eye(3)]
            rows = np.stack([self.mesh.shape(places, 0.0, by) for by in units], axis=1)
            rows = rows.reshape(-1, self.mesh.n_vectors)
            missed = gradients.reshape(-1, 3) - rows[:, ~interior] @ vectors[~interior]
            vectors[interior] = np.linalg.lstsq(rows[:, interior], missed, rcond=None)[0]

    def _marker(self, place: Place, gradients: Iterable[tuple[int, ...]], order: Array) -> GradientMarker:
        x, y, z = self.mesh.beside(place)
        rows = np.stack([self.mesh.shape(x, y, by, z) for by in gradients])
        marker = GradientMarker(self.columns, self.mesh.shape(x, y, (0, 0, 0), z), rows, order)
        return marker if self.mesh.line is None else marker.level_in(self.undeformed)

    def section_axes(self, x: Array, places: Array) -> Array:
        """Return the axes of sections at places, (n_batch, n_places, 3, 3), as columns."""
        markers = (replace(self.marker((float(a), 0.0, 0.0)), own=np.eye(3)) for a in places)
        return np.stack([marker.frame(x) for marker in markers], axis=1)
