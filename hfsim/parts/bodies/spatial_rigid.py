"""Rigid bodies in space: origin and three axes, twelve coordinates in which the mass matrix is constant."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import NOTHING, Entries
from hfsim.mechanics.body import Place, VectorBody
from hfsim.mechanics.carried import Carried
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.force import ConstantForce, ForcePart
from hfsim.mechanics.markers import GroundMarker
from hfsim.mechanics.orthonormal import Orthonormal
from hfsim.mechanics.pose import Pose
from hfsim.mechanics.spatial_markers import VectorMarker
from hfsim.parts.bodies.folded import FoldedBody

_TOUCHING = 1e-9
"""Part of the largest moment by which the smaller two may miss the triangle inequality."""
_SYMMETRIC = 1e-9
"""The same for what products of inertia differ by."""

FLAT = 1e-4
"""Smallest part of Euler's tensor, over the largest, that is worth an inverse."""


def inertia_matrix(inertia: tuple[Any, ...]) -> Array:
    """Return the matrix (3, 3) of principal moments or of rows [kg m^2]."""
    J = np.array(inertia, dtype=float)
    return np.diag(J) if J.ndim == 1 else 0.5 * (J + J.T)


def inertia_complaint(inertia: tuple[Any, ...]) -> tuple[str, str] | None:
    """Return what keeps numbers from being a body's moments of inertia, and what would be right."""
    rows = np.array(inertia, dtype=float)
    if rows.ndim == 2 and np.abs(rows - rows.T).max() > _SYMMETRIC * np.abs(rows).max():
        return "a matrix of inertia is symmetric", "give products of inertia with their signs, twice each"
    moments = np.linalg.eigvalsh(inertia_matrix(inertia))
    told = ", ".join(f"{moment:.4g}" for moment in moments)
    if moments[0] <= 0.0:
        return f"its principal moments are {told} kg m^2", "all must be greater than zero"
    if moments[2] > moments[0] + moments[1] + _TOUCHING * moments[2]:
        return (
            f"no body has the principal moments {told} kg m^2: one is greater than the sum of the others",
            "check the numbers and their units",
        )
    return None


@frozen
class SpatialRigidBody(VectorBody):
    """A rigid body in space with coordinates (r, d1, d2, d3); its origin is its centre of mass.

    Every point is linear in these, and T = 1/2 m |r'|^2 + 1/2 sum E_ij d_i' . d_j' with Euler's tensor
    E = 1/2 tr(J) 1 - J; six equations keep the axes of unit length and at right angles.

    Attributes
    ----------
    mass : float
        [kg].
    inertia : ndarray, shape (3, 3)
        J, about the centre of mass, in body axes [kg m^2].
    gravity : ndarray, shape (3,)
        [m/s^2].
    """

    mass: float
    inertia: Array
    gravity: Array
    n_dim: ClassVar[int] = 3
    SIZE: ClassVar[int] = 12

    @property
    def described(self) -> tuple[str, str]:
        """What its coordinates are."""
        return "place and axes", "rigid"

    @property
    def undeformed(self) -> Array:
        """Origin and axes."""
        return np.eye(4, 3, -1)

    @property
    def positions(self) -> Array:
        """One for the origin."""
        return np.array([1.0, 0.0, 0.0, 0.0])

    def marker(self, place: Place) -> VectorMarker:
        """Return the marker of a point of the body."""
        return VectorMarker(self.columns, np.array([1.0, *place]), np.eye(4)[1:])

    def own_constraints(self) -> Iterator[Constraint]:
        """Yield what keeps the axes."""
        ground = GroundMarker(Pose.level(self.origin))
        yield Orthonormal(ground, self.marker(self.origin), item=self.item)

    @property
    def euler(self) -> Array:
        """Euler's tensor [kg m^2]."""
        return np.asarray(0.5 * np.trace(self.inertia) * np.eye(3) - self.inertia)

    def ballast(self) -> Entries:
        """Return as much on each axis as all have together, where it is flat or slender."""
        sizes = np.linalg.eigvalsh(self.euler)
        if sizes[0] > FLAT * sizes[-1]:
            return NOTHING
        columns = np.arange(self.columns.start + 3, self.columns.stop)
        return Entries(columns, columns, np.full(len(columns), sizes.sum()))

    def mass_entries(self) -> Entries:
        """Return the mass of the origin and Euler's tensor on the axes."""
        tensor = np.zeros((4, 4))
        tensor[0, 0] = self.mass
        tensor[1:, 1:] = self.euler
        columns = np.arange(self.columns.start, self.columns.stop)
        return Entries.of_block(columns, columns, np.kron(tensor, np.eye(3)))

    def forces(self, n: int) -> Iterator[ForcePart]:
        """Yield the weight."""
        yield ConstantForce(n, self.position_columns[0], self.mass * self.gravity, item=self.item)

    def folded(self, pose: Pose) -> FoldedBody:
        """Return the same body held for ever at a pose."""
        return FoldedBody(self.name, slice(0, 0), self.points, pose, self.mass * self.gravity)

    def carried(self) -> Carried:
        """Return its axes; its place is that of the centre of mass in ground axes."""
        axes = np.arange(self.columns.start + 3, self.columns.stop).reshape(3, 3)
        return Carried.by_sections(axes, 3, 1, axes[:0])
