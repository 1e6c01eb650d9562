"""Beams in absolute nodal coordinates: models exact, linear and ancf."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.mechanics.body import Place
from hfsim.mechanics.markers import Marker, NodalMarker
from hfsim.mechanics.pose import Pose, Twist
from hfsim.parts.bodies.mesh import BeamMesh


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

    def placed(self, pose: Pose) -> Array:
        """Return the turned and shifted undeformed nodal vectors."""
        turned = pose.turned(self.mesh.undeformed)
        return np.asarray(turned + self.mesh.positions[:, None] * pose.origin).ravel()

    def moving(self, pose: Pose, twist: Twist) -> Array:
        """Return the rates of the nodal vectors."""
        turning = twist.turning(pose.turned(self.mesh.undeformed))
        return np.asarray(turning + self.mesh.positions[:, None] * twist.velocity).ravel()

    def outline(self, x: Array) -> Array:
        """Return points of the centre line."""
        rows = np.array([self.mesh.shape(float(a)) for a in self.mesh.outline_places])
        return np.asarray(rows @ x[:, self.columns].reshape(len(x), -1, 2))
