"""Fully parameterised beams in space: the element ``continuum`` in absolute nodal coordinates."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.mechanics.body import Place
from hfsim.mechanics.gradient_markers import SECTIONAL, TANGENTIAL, GradientMarker
from hfsim.parts.bodies.spatial_nodal import SpatialNodalBeam


@dataclass(frozen=True, eq=False)
class SpatialContinuumBeam(SpatialNodalBeam):
    """A beam with r, r_x, r_y and r_z at its nodes."""

    @property
    def described(self) -> tuple[str, str]:
        """Its elements."""
        return f"positions and gradients of {self.mesh.count} elements", "flexible"

    def marker(self, place: Place) -> GradientMarker:
        """Return the marker of a point: r_x along its first axis, r_y in the plane of the first two."""
        return self._marker(place, ((1, 0, 0), (0, 1, 0)), TANGENTIAL)

    def grip(self, place: Place) -> GradientMarker:
        """Return that of the section there: r_z along its third axis, r_y in the plane of the last two.

        What holds a section holds its moments on any mesh; the slope alone, which differs from its normal by
        shear, would hold them less the shorter the element is.
        """
        return self._marker(place, ((0, 0, 1), (0, 1, 0)), SECTIONAL)

    def _marker(self, place: Place, gradients: Iterable[tuple[int, ...]], order: Array) -> GradientMarker:
        x, y, z = place
        rows = np.stack([self.mesh.shape(x, y, by, z) for by in gradients])
        return GradientMarker(self.columns, self.mesh.shape(x, y, (0, 0, 0), z), rows, order)

    def _section_axes(self, x: Array, places: Array) -> Array:
        markers = (self.marker((float(a), 0.0, 0.0)) for a in places)
        return np.stack([marker.frame(x) for marker in markers], axis=1)
