"""Beams of the model rigid in space: a line without sections, which does not roll."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import ClassVar

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.mechanics.body import Load, Place, VectorBody
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.deformation import Deformation
from hfsim.mechanics.directions import TANGENT, Perpendicular
from hfsim.mechanics.force import ConstantForce, ForcePart
from hfsim.mechanics.spatial_markers import VectorMarker
from hfsim.parts.bodies.blueprint import Blueprint
from hfsim.parts.bodies.rigid_line import strained


@frozen
class UnitAxis(Perpendicular):
    """The axis of a line has unit length: its product with itself is one."""

    unit: ClassVar[str] = "-"
    why_kept: ClassVar[str] = "a rigid line keeps its length"


@frozen
class SpatialRigidBeam(VectorBody):
    """A beam of the model rigid in space: its coordinates are the positions of root and tip.

    Every point of its axis is linear in these, and joints at either end hold positions of the state; one
    equation keeps the distance.
    """

    beam: Blueprint
    n_dim: ClassVar[int] = 3

    @classmethod
    def of(cls, beam: Blueprint, framed: bool) -> SpatialRigidBeam:
        """Return the body of a beam."""
        return cls(beam.name, beam.columns(6), beam.points, beam)

    @property
    def described(self) -> tuple[str, str]:
        """What its coordinates are."""
        return "positions of root and tip", "rigid"

    @property
    def undeformed(self) -> Array:
        """Root and tip."""
        return np.array([[0.0, 0.0, 0.0], [self._length, 0.0, 0.0]])

    @property
    def positions(self) -> Array:
        """One for both."""
        return np.ones(2)

    @property
    def _length(self) -> float:
        return self.beam.mesh.length

    def marker(self, place: Place) -> VectorMarker:
        """Return the marker of a point of the axis."""
        along = place[0] / self._length
        axis = np.array([[-1.0, 1.0]]) / self._length
        return VectorMarker(self.columns, np.array([1.0 - along, along]), axis)

    def outline(self, x: Array) -> Array:
        """Return root and tip."""
        return self.vectors(x)

    extent = outline

    def own_constraints(self) -> Iterator[Constraint]:
        """Yield what keeps the length."""
        root = self.marker(self.origin)
        yield UnitAxis(root, root, TANGENT, TANGENT, offset=1.0, item=self.item)

    @property
    def _mass(self) -> Array:
        """The mesh's own mass matrix in rigid motion, over root and tip, shape (2, 2)."""
        mesh = self.beam.mesh
        tip = mesh.undeformed[:, 0] / mesh.length
        motions = np.stack([mesh.positions - tip, tip])
        return np.asarray(motions @ mesh.mass @ motions.T)

    def mass_entries(self) -> Entries:
        """Return the masses of root and tip."""
        columns = self.position_columns.ravel()
        return Entries.of_block(columns, columns, np.kron(self._mass, np.eye(3)))

    def forces(self, n: int) -> Iterator[ForcePart]:
        """Yield the weight."""
        weights = np.kron(self._mass.sum(axis=1), self.beam.gravity)
        yield ConstantForce(n, self.position_columns.ravel(), weights, item=self.item)

    def statics(self, x: Array, u: Array, ax: Array, loads: Iterable[Load]) -> Deformation:
        """Return stretch and bending by inertia, weight and loads.

        Along the axis, r'' goes linearly from the root's to the tip's.
        """
        root = self.marker(self.origin)
        frame = root.frame(x)
        first, last = np.moveaxis((self.beam.gravity - self.vectors(ax)) @ frame, 1, 0)
        slope = (last - first) / self._length
        return strained(self.beam.mesh, first, slope, self._on_line(frame, loads), root.spin(x, u))

    def _on_line(self, frame: Array, loads: Iterable[Load]) -> Iterator[tuple[float, Array, Array]]:
        """Yield where loads are, their forces, and moments by what they bend, in body axes."""
        for marker, force in loads:
            assert isinstance(marker, VectorMarker)
            at = marker.place_row[1] * self._length
            ends = force.reshape(len(force), 2, 3) @ frame
            whole = ends.sum(axis=1)
            yield at, whole, self._length * ends[:, 1, 1:] - at * whole[:, 1:]
