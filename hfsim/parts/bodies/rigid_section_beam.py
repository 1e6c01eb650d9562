"""Beams of the model rigid with sections in space, straight or curved: their inertia, what it leaves out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from hfsim.maths.arrays import Array, cumulative
from hfsim.maths.rotations import cross
from hfsim.mechanics.body import Load, Place
from hfsim.mechanics.deformation import Deformation
from hfsim.mechanics.pose import Pose
from hfsim.mechanics.spatial_markers import VectorMarker
from hfsim.parts.bodies.folded import FoldedBody
from hfsim.parts.bodies.section_blueprint import SectionBlueprint
from hfsim.parts.bodies.section_mesh import SectionMesh
from hfsim.parts.bodies.spatial_rigid import SpatialRigidBody

PLACES = 129
"""Equidistant places along the line at which it would be deformed."""


@dataclass(frozen=True, eq=False)
class PlaceMarker(VectorMarker):
    """A point of a rigid beam that says how far along its line it is.

    Attributes
    ----------
    along : float
        [m].
    """

    along: float = field(kw_only=True)


@dataclass(frozen=True, eq=False)
class RigidSectionBeam(SpatialRigidBody):
    """A rigid beam with sections: its frame is at the root, its coordinates are those of its centre of mass.

    Attributes
    ----------
    mesh : SectionMesh
        Of which it has the mass and the inertia.
    centre : ndarray, shape (3,)
        Of mass, in the body frame [m].
    """

    mesh: SectionMesh
    centre: Array

    @classmethod
    def of(cls, beam: SectionBlueprint, framed: bool) -> RigidSectionBeam:
        """Return the rigid body with the mass and the inertia that the nodes have in rigid motion."""
        mesh = beam.mesh
        own = mesh.masses * mesh.positions
        mass, centre = float(own.sum()), own @ mesh.undeformed / own.sum()
        arms = mesh.undeformed - np.outer(mesh.positions, centre)
        euler = (arms.T * mesh.masses) @ arms
        inertia = np.trace(euler) * np.eye(3) - euler
        columns = beam.columns(cls.SIZE)
        return cls(beam.name, columns, beam.points, mass, inertia, beam.gravity, mesh, centre)

    @property
    def undeformed(self) -> Array:
        """Centre of mass and axes."""
        return np.concatenate([self.centre[None], np.eye(3)])

    def reference(self, place: Place) -> Place:
        """Return where a point is in the body frame: places count along the line."""
        row, _, _ = self.mesh.point(place)
        return tuple(map(float, row @ self.mesh.undeformed))

    def marker(self, place: Place) -> PlaceMarker:
        """Return the marker of a material point; its axes are those of the body frame."""
        row = np.array([1.0, *(np.array(self.reference(place)) - self.centre)])
        return PlaceMarker(self.columns, row, np.eye(4)[1:], along=place[0])

    def outline(self, x: Array) -> Array:
        """Return points of the line."""
        points, _ = self.mesh.axis.at(np.linspace(0.0, self.mesh.axis.length, PLACES))
        rows = np.column_stack([np.ones(PLACES), points - self.centre])
        return np.asarray(rows @ self.vectors(x))

    def folded(self, pose: Pose) -> FoldedBody:
        """Return the same body held for ever at a pose."""
        points = {name: self.reference(place) for name, place in self.points.items()}
        return FoldedBody(self.name, slice(0, 0), points, pose, self.mass * self.gravity)

    def statics(self, x: Array, u: Array, ax: Array, loads: Iterable[Load]) -> Deformation:
        """Return how inertia, weight and loads would deform it: C^-1 N and D^-1 M along the line.

        Force and moment at a place are those of everything beyond it, with f = rho A (g - r'') and
        m = - rho I_z d2 x d2'' - rho I_y d3 x d3'' per length:

            N(s) = sum F_p + int_s^L f        M(s) = sum (M_p + r_p x F_p) + int_s^L (m + r x f) - r(s) x N(s)

        in the body frame; sections turn and move with these strains from the root on.
        """
        mesh, places = self.mesh, np.linspace(0.0, self.mesh.axis.length, PLACES)
        axes = self.vectors(x)[:, 1:].swapaxes(1, 2)
        (points, sections), changing = mesh.axis.sections(places), self.vectors(ax) @ axes
        turning = changing[:, 1:]
        properties, (about_y, about_z) = mesh.properties, mesh.properties.rotary_inertia
        local = np.einsum("i,bij->bj", self.gravity, axes) - changing[:, 0]
        f = properties.mass_per_length * (local[:, None] - (points - self.centre) @ turning)
        y, z = sections[..., 1], sections[..., 2]
        m = -about_z * cross(y, y @ turning) - about_y * cross(z, z @ turning) + cross(points, f)
        N, M = _beyond(f, places), _beyond(m, places)
        for marker, force in loads:
            assert isinstance(marker, PlaceMarker)
            on = force.reshape(len(x), 4, 3) @ axes
            moment = cross(np.eye(3), on[:, 1:]).sum(axis=1) + cross(self.centre, on[:, 0])
            there = (marker.along > places)[:, None]
            N += there * on[:, None, 0]
            M += there * moment[:, None]
        return self._strained(x, u, places, N, M - cross(points, N))

    def _strained(self, x: Array, u: Array, places: Array, N: Array, M: Array) -> Deformation:
        """Return the deformation of forces and moments (n_batch, n_places, 3) in the body frame."""
        mesh = self.mesh
        _, sections = mesh.axis.sections(places)
        stiffness = np.array(mesh.properties.stiffness)
        own = [(a[..., None, :] @ sections)[..., 0, :] for a in (N, M)]
        strain, bent = own[0] / stiffness[:3], own[1] / stiffness[3:]
        turned = _along((bent[..., None, :] @ sections.swapaxes(1, 2))[..., 0, :], places)
        across = (strain[..., None, :] @ sections.swapaxes(1, 2))[..., 0, :]
        slope = cross(turned, sections[..., 0]) + across
        moved = _along(slope, places)
        slopes = (slope[..., None, :] @ sections)[..., 0, 1:]
        curvature = np.stack([bent[..., 2], -bent[..., 1]], axis=-1)
        weights = np.full(len(places), mesh.axis.length / (len(places) - 1))
        weights[[0, -1]] *= 0.5
        tip = (moved[:, -1] @ sections[-1])[:, 1:]
        spin = self.marker(self.origin).spin(x, u)
        both = np.stack([moved, turned], axis=1)
        return Deformation(places, weights, strain[..., 0], slopes, curvature, tip, spin, both)


def _along(rates: Array, places: Array) -> Array:
    """Return integrals from the root on, of (n_batch, n_places, 3)."""
    return cumulative(rates.swapaxes(0, 1), places).swapaxes(0, 1)


def _beyond(rates: Array, places: Array) -> Array:
    """Return integrals from each place to the tip."""
    whole = _along(rates, places)
    return np.asarray(whole[:, -1:] - whole)
