"""Assembled bodies: where their coordinates stand, their markers, their placement as rigid bodies.

What joints, the initial state and the channels need to know of a body, whatever its model.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.rotations import normal, rotate
from hfsim.mechanics.markers import GroundMarker, Marker, NodalMarker, RigidMarker
from hfsim.parts.bodies.low_order import LowOrderBeam, LowOrderMarker
from hfsim.parts.bodies.mesh import BeamMesh

Place = tuple[float, float]


class Body(Protocol):
    """A body of an assembled scene."""

    @property
    def name(self) -> str:
        """Name in the deck."""

    @property
    def columns(self) -> slice:
        """Its coordinates in x."""

    @property
    def angle_column(self) -> int | None:
        """Column of `System.arranged` that is its frame angle with all turns; None where slopes give it."""

    @property
    def points(self) -> dict[str, Place]:
        """Named points in the undeformed body frame [m]."""

    @property
    def position_columns(self) -> IntArray:
        """Coordinates that are positions, shape (n, 2), that of the origin first; none in body frames."""

    def marker(self, place: Place) -> Marker:
        """Return the marker of a material point."""

    def placed(self, origin: Array, angle: float) -> Array:
        """Return the coordinates of the undeformed body at an origin (2,) and angle, (n_columns,)."""

    def moving(self, angle: float, velocity: Array, omega: float) -> Array:
        """Return the rates of the undeformed body in rigid motion, (n_columns,)."""

    def outline(self, x: Array) -> Array:
        """Return points along the body for pictures, shape (n_batch, n_points, 2)."""


@dataclass(frozen=True)
class RigidBody:
    """A rigid body with coordinates (x, y, angle); its origin is its centre of mass.

    Attributes
    ----------
    name : str
    columns : slice
    mass, inertia : float
        Mass [kg] and moment of inertia about the centre of mass [kg m^2].
    points : dict of str to Place
    """

    name: str
    columns: slice
    mass: float
    inertia: float
    points: dict[str, Place] = field(default_factory=dict)

    @property
    def angle_column(self) -> int | None:
        """The third coordinate."""
        return int(self.columns.start) + 2

    @property
    def position_columns(self) -> IntArray:
        """The centre of mass."""
        return np.asarray(self.columns.start + np.arange(2)[None])

    def marker(self, place: Place) -> Marker:
        """Return the marker of a point of the body."""
        return RigidMarker(self.columns, place)

    def placed(self, origin: Array, angle: float) -> Array:
        """Return (x, y, angle)."""
        return np.array([*origin, angle])

    def moving(self, angle: float, velocity: Array, omega: float) -> Array:
        """Return (vx, vy, omega)."""
        return np.array([*velocity, omega])

    def outline(self, x: Array) -> Array:
        """Return the polyline from the centre of mass through the named points."""
        return _polyline(self, x)


@dataclass(frozen=True)
class FoldedBody:
    """A body that cannot move: it has no coordinates, and its points are points of the ground.

    Attributes
    ----------
    origin : tuple of float
        Place of its origin [m].
    angle : float
        Angle of its frame, full turns included [rad].
    """

    name: str
    origin: Place
    angle: float
    points: dict[str, Place]
    columns: slice = field(default_factory=lambda: slice(0, 0))

    @property
    def angle_column(self) -> int | None:
        """None: it has no coordinates."""
        return None

    @property
    def position_columns(self) -> IntArray:
        """None."""
        return np.zeros((0, 2), dtype=np.intp)

    def marker(self, place: Place) -> Marker:
        """Return a point of the ground."""
        x, y = np.array(self.origin) + rotate(np.array([self.angle]), np.array(place))[0]
        return GroundMarker((float(x), float(y)), self.angle)

    def placed(self, origin: Array, angle: float) -> Array:
        """Return no coordinates."""
        return np.zeros(0)

    def moving(self, angle: float, velocity: Array, omega: float) -> Array:
        """Return no rates."""
        return np.zeros(0)

    def outline(self, x: Array) -> Array:
        """Return the polyline from the origin through the named points."""
        return _polyline(self, x)


@dataclass(frozen=True)
class RigidBeam(RigidBody):
    """A beam of the model rigid: its frame is at the root, its coordinates are those of its mid-point."""

    length: float = 0.0

    @classmethod
    def of(cls, name: str, columns: slice, mesh: BeamMesh, points: dict[str, Place]) -> RigidBeam:
        """Return the rigid body with the mass and the inertia that a mesh has in rigid motion."""
        mass = float(mesh.positions @ mesh.mass @ mesh.positions)
        about_root = float(np.sum(mesh.undeformed * (mesh.mass @ mesh.undeformed)))
        inertia = about_root - mass * (0.5 * mesh.length) ** 2
        return cls(name, columns, mass, inertia, points, mesh.length)

    def _to_centre(self, angle: float) -> Array:
        return 0.5 * self.length * np.array([np.cos(angle), np.sin(angle)])

    def marker(self, place: Place) -> Marker:
        """Return the marker of a material point."""
        return RigidMarker(self.columns, (place[0] - 0.5 * self.length, place[1]))

    def placed(self, origin: Array, angle: float) -> Array:
        """Return the mid-point and the angle."""
        return super().placed(origin + self._to_centre(angle), angle)

    def moving(self, angle: float, velocity: Array, omega: float) -> Array:
        """Return the velocity of the mid-point and the angular velocity."""
        return super().moving(angle, velocity + omega * normal(self._to_centre(angle)), omega)

    def outline(self, x: Array) -> Array:
        """Return root and tip."""
        return np.stack([self.marker((a, 0.0)).position(x) for a in (0.0, self.length)], axis=1)


@dataclass(frozen=True)
class NodalBeam:
    """A beam in absolute nodal coordinates: models exact, linear and ancf."""

    name: str
    columns: slice
    mesh: BeamMesh
    framed: bool
    points: dict[str, Place]

    @property
    def angle_column(self) -> int | None:
        """The third coordinate, if the state has a body frame."""
        return int(self.columns.start) + 2 if self.framed else None

    @property
    def position_columns(self) -> IntArray:
        """Those of the nodes, unless they are relative to a frame."""
        if self.framed:
            return np.zeros((0, 2), dtype=np.intp)
        vectors = np.flatnonzero(self.mesh.positions)
        return np.asarray(self.columns.start + 2 * vectors[:, None] + np.arange(2))

    def marker(self, place: Place) -> Marker:
        """Return the marker of a material point; its direction is that of the beam's axis there."""
        return NodalMarker(self.columns, self.mesh.shape(*place), self.mesh.shape(place[0], place[1], (1, 0)))

    def placed(self, origin: Array, angle: float) -> Array:
        """Return the turned and shifted undeformed nodal vectors."""
        turned = rotate(np.full(self.mesh.n_vectors, angle), self.mesh.undeformed)
        return np.asarray(turned + self.mesh.positions[:, None] * origin).ravel()

    def moving(self, angle: float, velocity: Array, omega: float) -> Array:
        """Return the rates of the nodal vectors."""
        turned = rotate(np.full(self.mesh.n_vectors, angle), self.mesh.undeformed)
        return np.asarray(omega * normal(turned) + self.mesh.positions[:, None] * velocity).ravel()

    def outline(self, x: Array) -> Array:
        """Return points of the centre line."""
        rows = np.array([self.mesh.shape(float(a)) for a in _outline_places(self.mesh)])
        return np.asarray(rows @ x[:, self.columns].reshape(len(x), -1, 2))


@dataclass(frozen=True)
class LowOrderBody:
    """A beam of the model lowOrder."""

    name: str
    beam: LowOrderBeam
    points: dict[str, Place]

    @property
    def columns(self) -> slice:
        """Coordinates of the beam."""
        return self.beam.columns

    @property
    def angle_column(self) -> int | None:
        """The third coordinate."""
        return int(self.columns.start) + 2

    @property
    def position_columns(self) -> IntArray:
        """None: its coordinates are relative to a frame."""
        return np.zeros((0, 2), dtype=np.intp)

    def marker(self, place: Place) -> Marker:
        """Return the marker of a point of the centre line."""
        return LowOrderMarker(self.beam, place[0])

    def placed(self, origin: Array, angle: float) -> Array:
        """Return (origin, angle, no deformation)."""
        return np.concatenate([origin, [angle], np.zeros(self.beam.n_w + self.beam.n_v)])

    def moving(self, angle: float, velocity: Array, omega: float) -> Array:
        """Return (velocity, omega, no deformation)."""
        return np.concatenate([velocity, [omega], np.zeros(self.beam.n_w + self.beam.n_v)])

    def outline(self, x: Array) -> Array:
        """Return points of the centre line."""
        places = _outline_places(self.beam.mesh)
        return np.stack([LowOrderMarker(self.beam, float(a)).position(x) for a in places], axis=1)


def _polyline(body: Body, x: Array) -> Array:
    places = [(0.0, 0.0), *body.points.values()]
    return np.stack([body.marker(place).position(x) for place in places], axis=1)


def _outline_places(mesh: BeamMesh) -> Array:
    interior = mesh.element.stride - mesh.element.per_node
    per_element = max(1, min(8 * (1 + interior), 200 // mesh.count))
    return np.linspace(0.0, mesh.length, min(mesh.count * per_element, 400) + 1)
