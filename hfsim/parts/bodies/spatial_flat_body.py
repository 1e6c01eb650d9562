"""Flat rigid bodies in space, such as thin discs: origin and the two axes of their plane."""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import NOTHING, Entries
from hfsim.maths.rotations import cross
from hfsim.mechanics.body import Place
from hfsim.mechanics.carried import Carried
from hfsim.mechanics.section_markers import SectionMarker
from hfsim.parts.bodies.spatial_rigid import FLAT, SpatialRigidBody

_THIN = 1e-12
"""Part of Euler's tensor across the plane, or of the distance of points from it, that is rounding."""


@frozen
class FlatRigidBody(SpatialRigidBody):
    """A rigid body with all its mass and points in a plane: coordinates (r, d2, d3), with d1 = d2 x d3.

    The third axis of `SpatialRigidBody` would have no mass, and its mass matrix no inverse.

    Attributes
    ----------
    plane : ndarray, shape (3, 3)
        The normal of the plane and both axes in it, as rows in body axes; Euler's tensor is diagonal there.
    """

    plane: Array
    SIZE: ClassVar[int] = 9

    @classmethod
    def of(cls, body: SpatialRigidBody) -> Self | None:
        """Return the same body if it is flat and not slender too; else None."""
        sizes, axes = np.linalg.eigh(body.euler)
        points = np.array([body.origin, *body.points.values()])
        beside, reach = (np.abs(one).max() for one in (points @ axes[:, 0], points))
        if sizes[0] > _THIN * sizes[2] or sizes[1] <= FLAT * sizes[2] or beside > _THIN * reach:
            return None
        plane = np.stack([cross(axes[:, 1], axes[:, 2]), axes[:, 1], axes[:, 2]])
        columns = slice(body.columns.start, body.columns.start + cls.SIZE)
        return cls(body.name, columns, body.points, body.mass, body.inertia, body.gravity, plane)

    @property
    def described(self) -> tuple[str, str]:
        """What its coordinates are."""
        return "place and the two axes of its plane", "rigid"

    @property
    def undeformed(self) -> Array:
        """Origin and axes."""
        return np.concatenate([np.zeros((1, 3)), self.plane[1:]])

    @property
    def positions(self) -> Array:
        """One for the origin."""
        return np.array([1.0, 0.0, 0.0])

    def ballast(self) -> Entries:
        """Return nothing: both axes have mass."""
        return NOTHING

    def marker(self, place: Place) -> SectionMarker:
        """Return the marker of a point of the plane."""
        beside = self.plane[1:] @ np.array(place)
        return SectionMarker(self.columns, np.array([1.0, *beside]), np.eye(3)[1:], self.plane.T)

    def mass_entries(self) -> Entries:
        """Return the mass of the origin and Euler's tensor on the axes."""
        tensor = np.diag([self.mass, *np.diagonal(self.plane @ self.euler @ self.plane.T)[1:]])
        columns = np.arange(self.columns.start, self.columns.stop)
        return Entries.of_block(columns, columns, np.kron(tensor, np.eye(3)))

    def carried(self) -> Carried:
        """Return its axes; its place is that of the centre of mass in ground axes."""
        axes = np.arange(self.columns.start + 3, self.columns.stop).reshape(2, 3)
        return Carried.by_sections(axes, 2, 0, axes[:0])
