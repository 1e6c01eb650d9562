"""Beams in absolute nodal coordinates in space: lines without sections."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.mechanics.body import Place
from hfsim.mechanics.carried import Carried
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.spatial_markers import VectorMarker
from hfsim.parts.bodies.nodal import NodalBeam
from hfsim.parts.bodies.spatial_frame import SpatialFrameChart


@frozen
class SpatialNodalBeam(NodalBeam):
    """A cable in absolute nodal coordinates."""

    n_dim: ClassVar[int] = 3
    angle_column: ClassVar[None] = None
    """A direction in space has no angle."""

    def marker(self, place: Place) -> Marker:
        """Return the marker of a material point; its direction is that of the beam's axis there."""
        position, slope = self._rows(place)
        return VectorMarker(self.columns, position, slope[None])

    def grip(self, place: Place) -> Marker:
        """Return the same."""
        return self.marker(place)

    def section_axes(self, x: Array, places: Array) -> Array:
        """Return the axes of sections: those of the root, carried without turning about the line."""
        from hfsim.parts.bodies.section_axes import along_the_line

        grid = np.union1d(self.outline_places, places)
        axes = along_the_line(self.marker(self.origin).frame(x), self._slopes(x, grid))
        return axes[:, np.searchsorted(grid, places)]

    def chart(self) -> SpatialFrameChart | None:
        """Return the map to the body frame, if it is stepped in that."""
        return SpatialFrameChart(self.columns, 1, self.mesh.element.stride) if self.framed else None

    def increments(self) -> None:
        """Return None: it has none of its own."""

    def carried(self) -> Carried | None:
        """Return its vectors as chords and slopes see them, in the frame of the root none."""
        if self.framed:
            return None
        columns = np.arange(self.columns.start, self.columns.stop).reshape(-1, 3)
        return Carried.by_directions(columns, self.mesh.element.stride)
