"""Beams of the model lowOrder in space, and their points."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import ClassVar, Self

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import NOTHING, Entries
from hfsim.maths.rotations import FIRST, lever, skew, smallest_rotation
from hfsim.mechanics.body import Place
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.spatial_markers import SquareMarker, along_line
from hfsim.parts.bodies.blueprint import Blueprint
from hfsim.parts.bodies.foreshortened import ForeshortenedBody, ForeshortenedMarker
from hfsim.parts.bodies.root_frame import ACROSS, RootFrame, spun_by
from hfsim.parts.bodies.spatial_linear import SpatialLinearBeam, SpatialLinearElasticForce
from hfsim.parts.bodies.spatial_low_order import SpatialLowOrderBeam
from hfsim.parts.bodies.spatial_nodal import SpatialNodalBeam


@frozen
class Foreshortened:
    """A vector of a foreshortened line: N X - 1/2 (v2^T Q v2 + v3^T Q v3) t.

    Attributes
    ----------
    row : ndarray, shape (n_vectors,)
        N.
    short : ndarray, shape (n_vectors - 2, n_vectors - 2)
        Q.
    """

    row: Array
    short: Array

    def value(self, frame: RootFrame, X: Array) -> Array:
        """Return the vector in ground axes, shape (n_batch, 3)."""
        v = frame.v
        return np.asarray(self.row @ X - 0.5 * np.sum((v @ self.short) * v, axis=(1, 2))[:, None] * frame.t)

    def _local(self, frame: RootFrame) -> tuple[Array, Array]:
        """Return it in the frame, from the root on, and its derivatives by deflections, negative."""
        v, bent = frame.v, frame.v @ self.short
        a = self.row @ frame.p
        a[:, 0] -= 0.5 * np.sum(bent * v, axis=(1, 2))
        return a, bent

    def jacobian(self, frame: RootFrame) -> Array:
        """Return its derivative by the absolute vectors, shape (n_batch, 3, n)."""
        a, bent = self._local(frame)
        J = np.zeros((len(a), 3, len(self.row), 3))
        for i in range(3):
            J[:, i, 0, i] = self.row @ frame.positions
            J[:, i, 1:, i] = self.row[1:]
        # in the place of the first slope's direction stands how the frame turns
        J[:, 1, 1, 1] = J[:, 2, 1, 2] = a[:, 0]
        J[:, 0, 1, ACROSS] = -a[:, ACROSS]
        J[:, 0, 2:, ACROSS] = -bent.swapaxes(1, 2)
        return np.asarray(frame.A @ frame.onto_vectors(J).reshape(len(a), 3, -1))

    def bias(self, frame: RootFrame, U: Array) -> Array:
        """Return its second time derivative at zero accelerations, shape (n_batch, 3)."""
        a, bent = self._local(frame)
        rates = frame.rates(U)
        a1, a2 = self._rate(rates.p, bent), self._rate(rates.bias, bent)
        v1 = rates.p[:, 2:, ACROSS].swapaxes(1, 2)
        a2[:, 0] -= np.sum((v1 @ self.short) * v1, axis=(1, 2))
        a2 += spun_by(rates.bias[:, 1, ACROSS], a) + 2.0 * spun_by(rates.beta, a1)
        a2 += spun_by(rates.beta, spun_by(rates.beta, a))
        return np.asarray((frame.A @ a2[:, :, None])[:, :, 0])

    def _rate(self, p1: Array, bent: Array) -> Array:
        """Return the change of the vector in the frame with those of w and v."""
        own = p1.copy()
        own[:, :2, ACROSS] = 0.0
        a1 = self.row @ own
        a1[:, 0] -= np.einsum("bck,bkc->b", bent, own[:, 2:, ACROSS])
        return np.asarray(a1)


@frozen
class SpatialLowOrderMarker(ForeshortenedMarker):
    """A point of the centre line; its one axis is the slope ds'/dx = (1 + w' - 1/2 v'.v', v')."""

    beam: SpatialLowOrderBeam
    n_dim: ClassVar[int] = 3
    n_spin: ClassVar[int] = 3
    n_axes: ClassVar[int] = 1
    keeps_turns: ClassVar[bool] = False

    @cached_property
    def _vectors(self) -> tuple[Foreshortened, Foreshortened]:
        """Position and slope."""
        mesh, place = self.beam.mesh, self.place
        row, slope = mesh.shape(place), mesh.shape(place, 0.0, (1, 0))
        own = slope[2:]
        return Foreshortened(row, self.beam.foreshortening(place)), Foreshortened(slope, np.outer(own, own))

    def position(self, x: Array) -> Array:
        """Return r0 + A s'."""
        return self._vectors[0].value(self.beam.frame(x), self.beam.vectors(x))

    def position_jacobian(self, x: Array) -> Array:
        """Return its derivative by X."""
        return self._vectors[0].jacobian(self.beam.frame(x))

    def position_bias(self, x: Array, u: Array) -> Array:
        """Return its second time derivative at zero accelerations of X."""
        return self._vectors[0].bias(self.beam.frame(x), self.beam.vectors(u))

    def _slope(self, x: Array) -> Array:
        return self._vectors[1].value(self.beam.frame(x), self.beam.vectors(x))

    def turned(self, x: Array, a: Array) -> Array:
        """Return vectors (3,), given in its axes, in ground axes: by the smallest rotation to the slope."""
        slope = self._slope(x)
        unit = slope / np.linalg.norm(slope, axis=-1, keepdims=True)
        return np.asarray(smallest_rotation(FIRST, unit) @ a)

    def turned_jacobian(self, x: Array, a: Array) -> Array:
        """Return the derivative of `turned` by X."""
        return along_line(self, x, a)

    def axis(self, x: Array, a: Array) -> Array:
        """Return the slope, times the first component."""
        return np.asarray(np.asarray(a)[0] * self._slope(x))

    @cached_property
    def square(self) -> SquareMarker:
        """Return it with a tangent of unit length."""
        return SquareMarker(self)

    def axis_jacobian(self, x: Array, a: Array) -> Array:
        """Return the derivative of `axis` by X."""
        return np.asarray(np.asarray(a)[0] * self._vectors[1].jacobian(self.beam.frame(x)))

    def axis_bias(self, x: Array, u: Array, a: Array) -> Array:
        """Return the second time derivative of `axis` at zero accelerations of X."""
        return np.asarray(np.asarray(a)[0] * self._vectors[1].bias(self.beam.frame(x), self.beam.vectors(u)))

    def spin_jacobian(self, x: Array) -> Array:
        """Return t x dt / |t|^2 of the slope."""
        t = self._slope(x)
        return skew(t / np.sum(t * t, axis=-1, keepdims=True)) @ self.axis_jacobian(x, FIRST)

    def spin_bias(self, x: Array, u: Array) -> Array:
        """Return t x t_b / |t|^2 - 2 (t . t') (t x t') / |t|^4."""
        t = self._slope(x)
        rate = (self.axis_jacobian(x, FIRST) @ u[:, self.columns, None])[..., 0]
        square = np.sum(t * t, axis=-1, keepdims=True)
        stretching = 2.0 * np.sum(t * rate, axis=-1, keepdims=True) / square
        return np.asarray(lever(t, self.axis_bias(x, u, FIRST) - stretching * rate) / square)

    def axis_stiffness(self, x: Array, a: Array, force: Array) -> Entries:
        """Return the second derivative of force . axis in one state, by differences."""
        return self.bent(x, lambda moved: force @ self.axis_jacobian(moved, a))


@frozen
class LowOrderElasticForce(SpatialLinearElasticForce):
    """Linear elastic force of axial variable and deflections of one beam of the model lowOrder in space."""

    runs_away: ClassVar[bool] = False

    def runaway(self, t: float, x: Array) -> None:
        """Return None."""


@frozen
class SpatialLowOrderBody(ForeshortenedBody, SpatialLinearBeam):
    """A cable with the foreshortening of its deflections: its nodal vectors are those without that."""

    _kind = LowOrderElasticForce
    coordinates: ClassVar[str] = "nodal vectors without foreshortening"

    @classmethod
    def of(cls, beam: Blueprint, framed: bool) -> Self:
        """Return the body of a beam; EI v'' does not depend on w, as of the curvature (r' x r'')/|r'|^2."""
        return super().of(beam._replace(measures=beam.measures._replace(curvature="exact")), framed)

    @property
    def described(self) -> tuple[str, str]:
        """Its coordinates relative to its frame."""
        return (
            f"axial and two transverse coordinates of {self.mesh.count} elements",
            "beam of model lowOrder, mass matrix anew in every state",
        )

    @cached_property
    def variable_mass(self) -> SpatialLowOrderBeam:
        """That of the beam."""
        return SpatialLowOrderBeam.of(self.beam)

    def marker(self, place: Place) -> SpatialLowOrderMarker:
        """Return the marker of a point of the centre line."""
        return SpatialLowOrderMarker(self.variable_mass, place[0])

    def section_axes(self, x: Array, places: Array) -> Array:
        """Return the axes of the root, carried along its line without turning about it."""
        return SpatialNodalBeam.section_axes(self, x, places)

    def _slopes(self, x: Array, places: Array) -> Array:
        """Return those of the foreshortened line."""
        return np.stack([marker.axis(x, FIRST) for marker in self.markers(places)], axis=1)

    def mass_entries(self) -> Entries:
        """Return none: the mass matrix is not constant."""
        return NOTHING

    def forces(self, n: int) -> Iterator[ForcePart]:
        """Yield inertia and weight, and elastic force and damping."""
        yield self.variable_mass
        yield self._elastic
