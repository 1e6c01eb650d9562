"""Beams in absolute nodal coordinates: models exact and ancf, and what linear shares with them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.matrices import Entries
from hfsim.mechanics.body import Body, Place
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.markers import Marker, NodalMarker
from hfsim.mechanics.pose import Pose, Twist
from hfsim.parts.bodies.blueprint import Blueprint
from hfsim.parts.bodies.frame import FrameChart
from hfsim.parts.bodies.interior import InteriorBeams
from hfsim.parts.bodies.mesh import BeamMesh
from hfsim.parts.bodies.natural import BeamIncrements, NaturalBeams


@dataclass(frozen=True)
class NodalBeam(Body):
    """A beam in absolute nodal coordinates.

    Attributes
    ----------
    beam : Blueprint
    framed : bool
        Whether it is stepped in a body frame and coordinates relative to that.
    """

    beam: Blueprint
    framed: bool

    @classmethod
    def of(cls, beam: Blueprint, framed: bool) -> Self:
        """Return the body of a beam."""
        return cls(beam.name, beam.nodal_columns, beam.points, beam, framed)

    @property
    def mesh(self) -> BeamMesh:
        """Its elements."""
        return self.beam.mesh

    @property
    def described(self) -> tuple[str, str]:
        """Its elements."""
        return f"positions and slopes of {self.mesh.count} elements", "flexible"

    @property
    def banded(self) -> bool:
        """Whether it has no body frame, with which all its coordinates are coupled."""
        return not self.framed

    @property
    def angle_column(self) -> int | None:
        """The one after the origin, if the state has a body frame."""
        return int(self.columns.start) + self.beam.n_dim if self.framed else None

    @property
    def position_columns(self) -> IntArray:
        """Those of the nodes, unless they are relative to a frame."""
        if self.framed:
            return super().position_columns
        vectors, n_dim = np.flatnonzero(self.mesh.positions), self.beam.n_dim
        return np.asarray(self.columns.start + n_dim * vectors[:, None] + np.arange(n_dim))

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
        return np.asarray(rows @ x[:, self.columns].reshape(len(x), -1, self.beam.n_dim))

    def mass_entries(self) -> Entries:
        """Return those of its elements."""
        block = np.kron(self.mesh.element.mass(self.mesh.inertia), np.eye(self.beam.n_dim))
        columns = self.beam.element_columns
        return Entries.of_block(columns, columns, np.broadcast_to(block, (len(columns), *block.shape)))

    def forces(self, n: int) -> Iterator[ForcePart]:
        """Yield weight, elastic force and damping."""
        yield self.beam.weight(n)
        yield self.beam.elastic_force(n)
        yield self.beam.kelvin_voigt(n)

    def chart(self) -> FrameChart | None:
        """Return the map to the body frame, if it is stepped in that."""
        return FrameChart(self.columns, 1, self.mesh.element.stride) if self.framed else None

    def increments(self) -> BeamIncrements | None:
        """Return the natural increments of the Green strain."""
        element = self.mesh.element
        kind = InteriorBeams if element.stride > element.per_node else NaturalBeams
        return kind(self.columns, 1, element.stride, element.length, self.framed)
