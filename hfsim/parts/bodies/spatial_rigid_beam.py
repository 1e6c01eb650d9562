"""Beams of the model rigid in space: a line without sections, which does not roll."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import ClassVar

import numpy as np

from hfsim.maths.arrays import Array, cumulative
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.mechanics.body import Load, Place, VectorBody
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.deformation import Deformation
from hfsim.mechanics.directions import TANGENT, Perpendicular
from hfsim.mechanics.force import ConstantForce, ForcePart
from hfsim.mechanics.pose import Pose
from hfsim.mechanics.spatial_markers import VectorMarker
from hfsim.parts.bodies.blueprint import Blueprint
from hfsim.parts.bodies.folded import FoldedBody
from hfsim.parts.bodies.planar_rigid_beam import POINTS


@frozen
class UnitAxis(Perpendicular):
    """The axis of a line has unit length: its product with itself is one."""

    unit: ClassVar[str] = "-"
    why_kept: ClassVar[str] = "a rigid line keeps its length"

    @classmethod
    def of(cls, marker: VectorMarker, item: str) -> UnitAxis:
        """Return the equation for the body of a marker."""
        return cls(marker, marker, TANGENT, TANGENT, offset=1.0, item=item)


@frozen
class SpatialRigidBeam(VectorBody):
    """A beam of the model rigid in space: its coordinates are the positions of root and tip.

    Every point of its axis is linear in these, and joints at either end hold positions of the state; one
    equation keeps the distance.

    Attributes
    ----------
    beam : Blueprint
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

    def own_constraints(self) -> Iterator[Constraint]:
        """Yield what keeps the length."""
        yield UnitAxis.of(self.marker(self.origin), self.item)

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

    def folded(self, pose: Pose) -> FoldedBody:
        """Return the same body held for ever at a pose."""
        return FoldedBody(self.name, slice(0, 0), self.points, pose, self._mass.sum() * self.beam.gravity)

    def statics(self, x: Array, u: Array, ax: Array, loads: Iterable[Load]) -> Deformation:
        """Return stretch and bending by inertia, weight and loads: N / EA and M / EI.

        N and, across, M are resultants of everything beyond a place:

            M(x) = sum m_p + (x_p - x) F_p + int_x^L f(s) (s - x) ds        f = rho A (g - r'')

        Along the axis, r'' goes linearly from the root's to the tip's.
        """
        length, root = self._length, self.marker(self.origin)
        frame = root.turned(x, np.eye(3))
        ends = self.beam.gravity - self.vectors(ax)
        f0, f1 = np.moveaxis(ends @ frame, 1, 0)
        places = np.linspace(0.0, length, POINTS)
        # integrals over the rest of the beam of rho A (f0 + slope s), and of that times s - x
        slope, (m0, m1, m2) = (f1 - f0) / length, self.beam.mesh.masses_beyond(places)
        N = np.outer(f0[:, 0], m0) + np.outer(slope[:, 0], places * m0 + m1)
        M = m1[:, None] * f0[:, None, 1:] + (places * m1 + m2)[:, None] * slope[:, None, 1:]
        for marker, force in loads:
            assert isinstance(marker, VectorMarker)
            at = marker.place_row[1] * length
            at_ends = force.reshape(len(x), 2, 3) @ frame
            whole = at_ends.sum(axis=1)
            moment = length * at_ends[:, 1, 1:] - at * whole[:, 1:]
            beyond = at > places
            N += whole[:, :1] * beyond
            levers = (at - places)[:, None] * whole[:, None, 1:]
            M += (moment[:, None] + levers) * beyond[:, None]
        weights = np.full(POINTS, length / (POINTS - 1))
        weights[[0, -1]] *= 0.5
        section = self.beam.mesh.at(places)
        curvature = M / np.asarray(section.bending_stiffness)[..., None]
        bent = cumulative(curvature.swapaxes(0, 1), places).swapaxes(0, 1)
        return Deformation(
            places=places,
            weights=weights,
            axial=N / section.axial_stiffness,
            slope=bent,
            curvature=curvature,
            tip=np.einsum("bxd,x->bd", bent, weights),
            spin=root.spin(x, u),
        )
