"""Markers of beams with a section vector in the plane, which is a quarter turn ahead of the line."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Self

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import wrap
from hfsim.mechanics.markers import ROUNDING
from hfsim.mechanics.planar_markers import NodalMarker


@frozen
class PlanarSectionMarker(NodalMarker):
    """A material point of a planar beam whose coordinates are positions and second axes of its sections.

    ``slope_row`` is that of the section's second axis.

    Attributes
    ----------
    ahead : float
        Angle of that axis in the body frame of the undeformed beam [rad]: the marker's own axes are those of
        the body frame, carried along.
    """

    ahead: float

    def level_in(self, vectors: Array) -> Self:
        """Return the marker whose angle is zero where its body has nodal vectors (n, 2)."""
        alone = replace(self, columns=slice(0, vectors.size))
        more = float(alone.angle(vectors.reshape(1, -1))[0])
        return self if abs(more) <= ROUNDING else replace(self, ahead=self.ahead + more)

    def angle(self, x: Array) -> Array:
        """Return the angle of the first axis of the body frame, carried along."""
        return wrap(super().angle(x) - self.ahead)

    @property
    def slope_columns(self) -> IntArray | None:
        """None: no coordinates are a vector along its first axis."""
        return None


@frozen
class StretchingSectionMarker(PlanarSectionMarker):
    """The same of a beam whose section vectors may change their length: a clamp at the ground leaves that."""

    @property
    def lead(self) -> float:  # type: ignore[override]
        """The angle of the section vector."""
        return self.ahead

    @cached_property
    def slope_columns(self) -> IntArray | None:
        """The coordinates that are the section vector; None between nodes."""
        return self._vector_columns(self.slope_row)
