"""Beams of the model rigid with sections, straight or curved: their inertia, and what it leaves out.

What differs in plane and space is in `planar_rigid_section_beam` and `spatial_rigid_section_beam`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field
from functools import cached_property
from typing import Self

import numpy as np

from hfsim.maths.arrays import Array, cumulative
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import lever, spun
from hfsim.mechanics.body import Body, Load, Place
from hfsim.mechanics.deformation import Deformation
from hfsim.mechanics.markers import Marker
from hfsim.parts.bodies.blueprint import Blueprint
from hfsim.parts.bodies.section_blueprint import SectionBlueprint
from hfsim.parts.bodies.section_mesh import SectionMesh

PLACES = 129
"""Equidistant places along the line at which it would be deformed."""


@frozen
class PlaceMarker(Marker):
    """A point of a rigid beam that says how far along its line it is.

    Attributes
    ----------
    along : float
        [m].
    """

    along: float = field(kw_only=True)


@frozen
class RigidSectionBeam(Body):
    """A rigid beam with sections: its frame is at the root, its coordinates are those of its centre of mass.

    Attributes
    ----------
    mass : float
        [kg].
    gravity : ndarray, shape (n_dim,)
        [m/s^2].
    beam : SectionBlueprint or Blueprint
        Of which it has the mass and the inertia.
    centre : ndarray, shape (n_dim,)
        Of mass, in the body frame [m].
    """

    mass: float
    gravity: Array
    beam: SectionBlueprint | Blueprint = field(kw_only=True)
    centre: Array = field(kw_only=True)

    @cached_property
    def mesh(self) -> SectionMesh:
        """Its line and its sections."""
        return self.beam.sections

    @classmethod
    def of(cls, beam: SectionBlueprint | Blueprint, framed: bool) -> Self:
        """Return the rigid body with the mass and the inertia that the nodes have in rigid motion."""
        return cls._with(beam, *beam.inertia)

    @classmethod
    def _with(cls, beam: SectionBlueprint | Blueprint, mass: float, centre: Array, euler: Array) -> Self:
        """Return the body of a mass, its centre, and Euler's tensor about that, (n_dim, n_dim)."""
        raise NotImplementedError

    def _motion(self, x: Array, u: Array, ax: Array) -> tuple[Array, Array]:
        """Return the second derivatives of centre of mass and axes, as rows, in the body's axes."""
        raise NotImplementedError

    def _load(self, x: Array, force: Array) -> tuple[Array, Array]:
        """Return force and moment about the centre of mass, in the body's axes, of a force on coordinates."""
        raise NotImplementedError

    def _frame(self, x: Array) -> Array:
        """Return the body's axes as columns, (n_batch, n_dim, n_dim)."""
        return self.marker(self.origin).frame(x)

    def reference(self, place: Place) -> Place:
        """Return where a point is in the body frame: places count along the line."""
        return self.beam.mesh.reference(place)

    def outline(self, x: Array) -> Array:
        """Return points of the line."""
        points, _ = self.mesh.axis.at(np.linspace(0.0, self.mesh.axis.length, PLACES))
        origin = self.marker(self.origin).position(x)[:, None]
        return np.asarray(origin + points @ self._frame(x).swapaxes(1, 2))

    extent = outline

    def statics(self, x: Array, u: Array, ax: Array, loads: Iterable[Load]) -> Deformation:
        """Return how inertia, weight and loads would deform it: C^-1 N and D^-1 M along the line.

        Force and moment at a place are those of everything beyond it, with f = rho A (g - r'') and
        m = - rho I_z d2 x d2'' - rho I_y d3 x d3'' per length:

            N(s) = sum F_p + int_s^L f        M(s) = sum (M_p + r_p x F_p) + int_s^L (m + r x f) - r(s) x N(s)

        in the body frame; sections turn and move with these strains from the root on.
        """
        mesh, places = self.mesh, np.linspace(0.0, self.mesh.axis.length, PLACES)
        (points, sections), own = mesh.axis.sections(places), mesh.at(places)
        moving, turning = self._motion(x, u, ax)
        local = (self.gravity @ self._frame(x)) - moving
        f = np.asarray(own.mass_per_length)[..., None] * (local[:, None] - (points - self.centre) @ turning)
        m = lever(points, f)
        for d, about in zip(np.moveaxis(sections, 2, 0)[1:], own.rotary_inertia[::-1], strict=False):
            m = m - np.asarray(about)[..., None] * lever(d, d @ turning)
        N, M = _beyond(f, places), _beyond(m, places)
        for marker, on in loads:
            assert isinstance(marker, PlaceMarker)
            force, moment = self._load(x, on)
            # one at the tip acts up to there: trapezoids would lose half of the last
            there = ((marker.along > places) | (marker.along == places[-1]))[:, None]
            N += there * force[:, None]
            M += there * (moment + lever(self.centre, force))[:, None]
        return self._strained(x, u, places, N, M - lever(points, N))

    def _strained(self, x: Array, u: Array, places: Array, N: Array, M: Array) -> Deformation:
        """Return the deformation of forces (n_batch, n_places, n_dim) and moments in the body frame."""
        mesh, n = self.mesh, self.n_dim
        _, sections = mesh.axis.sections(places)
        # in the plane moments and turns are about the axis that all frames share
        about = sections if n == 3 else np.ones((1, 1, 1))
        forces = np.concatenate([_in(sections, N), _in(about, M)], axis=-1)
        strains = np.linalg.solve(mesh.stiffness_at(places), forces[..., None])[..., 0]
        strain, bent = strains[..., :n], strains[..., n:]
        turned = _along(_in(about.swapaxes(1, 2), bent), places)
        slope = spun(turned, sections[..., 0]) + _in(sections.swapaxes(1, 2), strain)
        moved = _along(slope, places)
        curvature = spun(bent, np.eye(n)[0])[..., 1:]
        weights = np.full(len(places), mesh.axis.length / (len(places) - 1))
        weights[[0, -1]] *= 0.5
        slopes, tip = _in(sections, slope)[..., 1:], (moved[:, -1] @ sections[-1])[:, 1:]
        spin = self.marker(self.origin).spin(x, u)
        both = np.concatenate([moved, turned], axis=-1)
        return Deformation(places, weights, strain[..., 0], slopes, curvature, tip, spin, both)


def _in(axes: Array, vectors: Array) -> Array:
    """Return vectors (n_batch, n_places, n) in axes (n_places, n, n), their columns."""
    return np.asarray((vectors[..., None, :] @ axes)[..., 0, :])


def _along(rates: Array, places: Array) -> Array:
    """Return integrals from the root on, of (n_batch, n_places, n)."""
    return cumulative(rates.swapaxes(0, 1), places).swapaxes(0, 1)


def _beyond(rates: Array, places: Array) -> Array:
    """Return integrals from each place to the tip."""
    whole = _along(rates, places)
    return np.asarray(whole[:, -1:] - whole)
