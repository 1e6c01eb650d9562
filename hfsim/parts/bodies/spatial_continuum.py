"""Fully parameterised beams in space: the element ``continuum`` in absolute nodal coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.mechanics.body import Place
from hfsim.mechanics.gradient_markers import GradientMarker
from hfsim.parts.bodies.spatial_nodal import SpatialNodalBeam


@dataclass(frozen=True, eq=False)
class SpatialContinuumBeam(SpatialNodalBeam):
    """A beam with r, r_x, r_y and r_z at its nodes."""

    @property
    def described(self) -> tuple[str, str]:
        """Its elements."""
        return f"positions and gradients of {self.mesh.count} elements", "flexible"

    def marker(self, place: Place) -> GradientMarker:
        """Return the marker of a material point; its frame is that of r_x and r_y there."""
        x, y, z = place
        position, *gradients = (self.mesh.shape(x, y, by, z) for by in ((0, 0, 0), (1, 0, 0), (0, 1, 0)))
        return GradientMarker(self.columns, position, np.stack(gradients))

    def _section_axes(self, x: Array, places: Array) -> Array:
        markers = (self.marker((float(a), 0.0, 0.0)) for a in places)
        return np.stack([marker.frame(x) for marker in markers], axis=1)
