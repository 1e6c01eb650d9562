"""Beams of the model lowOrder, and their points."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import normal, rotate
from hfsim.mechanics.body import Place
from hfsim.mechanics.deformation import Deformation
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.pose import Pose, Twist
from hfsim.parts.bodies.blueprint import Blueprint
from hfsim.parts.bodies.foreshortened import ForeshortenedBody, ForeshortenedMarker
from hfsim.parts.bodies.mesh import BeamMesh
from hfsim.parts.bodies.planar_low_order import PLACE, RIGID, TURN, LowOrderBeam


@frozen
class LowOrderMarker(ForeshortenedMarker):
    """A point of the centre line of a `LowOrderBeam`, its direction along the slope (1 + w', v')."""

    beam: LowOrderBeam

    @cached_property
    def _rows(self) -> tuple[Array, Array, Array]:
        """Shape row, its derivative by x, and H, all at the place of the marker."""
        beam, place = self.beam, self.place
        return beam.mesh.shape(place), beam.mesh.shape(place, 0.0, (1, 0)), beam.foreshortening(place)

    def _arm(self, x: Array) -> tuple[Array, Array]:
        """Return s', shape (n_batch, 2), and its derivative by (w, v)."""
        _, _, w, v = self.beam.split(x)
        row, _, H = self._rows
        Hv = v @ H
        s = np.stack([self.place + w @ row[1:] - 0.5 * np.sum(Hv * v, -1), v @ row[2:]], axis=-1)
        nw = self.beam.n_w
        S_p = np.zeros((len(x), 2, nw + self.beam.n_v))
        S_p[:, 0, :nw] = row[1:]
        S_p[:, 0, nw:] = -Hv
        S_p[:, 1, nw:] = row[2:]
        return s, S_p

    def position(self, x: Array) -> Array:
        """Return r0 + A s'."""
        r0, theta, _, _ = self.beam.split(x)
        return np.asarray(r0 + rotate(theta, self._arm(x)[0]))

    def position_jacobian(self, x: Array) -> Array:
        """Return (1, A s' turned by a quarter, A ds'/dp)."""
        _, theta, _, _ = self.beam.split(x)
        s, S_p = self._arm(x)
        J = np.zeros((*s.shape, self.beam.n))
        J[:, :, PLACE] = np.eye(s.shape[1])
        J[:, :, TURN] = rotate(theta, normal(s))
        J[:, :, RIGID:] = rotate(theta[:, None], S_p.swapaxes(1, 2)).swapaxes(1, 2)
        return J

    def position_bias(self, x: Array, u: Array) -> Array:
        """Return A (-omega^2 s' + 2 omega x s'_t - (v'^T H v', 0))."""
        _, theta, _, _ = self.beam.split(x)
        _, omega, dw, dv = self.beam.split(u)
        s, S_p = self._arm(x)
        ds = (S_p @ np.concatenate([dw, dv], axis=1)[:, :, None])[:, :, 0]
        local = -(omega**2)[:, None] * s + 2.0 * omega[:, None] * normal(ds)
        local[:, 0] -= np.sum((dv @ self._rows[2]) * dv, axis=-1)
        return rotate(theta, local)

    def _slope(self, x: Array) -> tuple[Array, Array]:
        """Return ds'/dx = (1 + w' - 1/2 v'^2, v') and its derivative by (w, v)."""
        _, _, w, v = self.beam.split(x)
        row = self._rows[1]
        bend = v @ row[2:]
        t = np.stack([1.0 + w @ row[1:] - 0.5 * bend**2, bend], axis=-1)
        nw = self.beam.n_w
        t_p = np.zeros((len(x), 2, nw + self.beam.n_v))
        t_p[:, 0, :nw] = row[1:]
        t_p[:, 0, nw:] = -bend[:, None] * row[2:]
        t_p[:, 1, nw:] = row[2:]
        return t, t_p

    def angle(self, x: Array) -> Array:
        """Return theta plus the angle of ds'/dx."""
        t, _ = self._slope(x)
        return np.asarray(self.beam.split(x)[1] + np.arctan2(t[:, 1], t[:, 0]))

    def spin_jacobian(self, x: Array) -> Array:
        """Return (0, 0, 1, (t x t_p)/|t|^2)."""
        t, t_p = self._slope(x)
        turn = normal(t) / np.sum(t * t, -1, keepdims=True)
        row = np.zeros((len(x), self.n_spin, self.beam.n))
        row[..., TURN] = 1.0
        row[..., RIGID:] = turn[:, None] @ t_p
        return row

    def spin_bias(self, x: Array, u: Array) -> Array:
        """Return (t x t_b)/|t|^2 - 2 (t.t')(t x t')/|t|^4 with t_b = (-v'_t^2, 0)."""
        t, t_p = self._slope(x)
        _, _, dw, dv = self.beam.split(u)
        dt = (t_p @ np.concatenate([dw, dv], axis=1)[:, :, None])[:, :, 0]
        square = np.sum(t * t, -1)
        n = normal(t)
        own = -n[:, 0] * dt[:, 1] ** 2 / square
        return np.asarray(own - 2.0 * np.sum(t * dt, -1) * np.sum(n * dt, -1) / square**2)[:, None]


@frozen
class LowOrderBody(ForeshortenedBody):
    """A beam of the model lowOrder."""

    beam: LowOrderBeam

    @classmethod
    def of(cls, beam: Blueprint, framed: bool) -> LowOrderBody:
        """Return the body of a beam; it has a body frame whatever is asked for."""
        own = LowOrderBeam.of(beam)
        return cls(beam.name, own.columns, beam.points, own)

    @property
    def mesh(self) -> BeamMesh:
        """Its elements."""
        return self.beam.mesh

    @property
    def described(self) -> tuple[str, str]:
        """Its coordinates relative to its frame."""
        return (
            "frame, axial and transverse coordinates",
            "beam of model lowOrder, mass matrix anew in every state",
        )

    @property
    def angle_column(self) -> int | None:
        """The one after the origin."""
        return int(self.columns.start) + len(self.beam.gravity)

    def marker(self, place: Place) -> LowOrderMarker:
        """Return the marker of a point of the centre line."""
        return LowOrderMarker(self.beam, place[0])

    def placed(self, pose: Pose) -> Array:
        """Return (origin, angle, no deformation)."""
        return np.concatenate([*pose, np.zeros(self.beam.n_w + self.beam.n_v)])

    def moving(self, pose: Pose, twist: Twist) -> Array:
        """Return (velocity, omega, no deformation)."""
        return np.concatenate([*twist, np.zeros(self.beam.n_w + self.beam.n_v)])

    def resultant(self, x: Array, force: Array) -> tuple[Array, Array]:
        """Return force and moment about its root of a generalised force (n_batch, n_columns)."""
        return force[:, PLACE], force[:, TURN : TURN + 1]

    def section_axes(self, x: Array, places: Array) -> Array:
        """Return the axes along and across its line, (n_batch, n_places, 3, 3), as columns."""
        from hfsim.parts.bodies.section_axes import in_the_plane

        first = np.array([1.0, 0.0])
        slopes = [marker.turned(x, first) for marker in self.markers(places)]
        return in_the_plane(np.stack(slopes, axis=1))

    def deformation(self, x: Array, u: Array) -> Deformation:
        """Return that of w and v."""
        _, _, w, v = self.beam.split(x)
        axis, spin = self.mesh.axis, self.beam.split(u)[1]
        slope, curvature, tip = (v @ rows[..., 2:].T for rows in (axis.slope, axis.curvature, axis.tip))
        axial = w @ axis.slope[:, 1:].T
        return Deformation(
            axis.places,
            axis.weights,
            axial,
            slope[..., None],
            curvature[..., None],
            tip[:, None],
            spin[:, None],
        )

    @property
    def variable_mass(self) -> LowOrderBeam:
        """That of the beam."""
        return self.beam

    def forces(self, n: int) -> Iterator[ForcePart]:
        """Yield inertia, elastic force, damping and weight as one."""
        yield self.beam
