"""What flexible beams whose coordinates are vectors have in common, whatever their elements."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from hfsim.errors import SolverFailure
from hfsim.maths.arrays import Array, IntArray, distinct
from hfsim.maths.rotations import lever
from hfsim.mechanics.body import Place, VectorBody
from hfsim.mechanics.markers import LinearMarker, Marker
from hfsim.parts.bodies.balance import ROUNDING, MeshedBeam, Pair

FARTHEST = np.radians(120.0)
"""Angle between sections of neighbouring nodes beyond which an element means nothing; between two nodes alone
section vectors have half their length then."""


class VectorBeam(MeshedBeam, VectorBody):
    """A beam of elements whose coordinates are vectors."""

    has_sections: ClassVar[bool] = False
    """Whether its nodes have section vectors of unit length, so that `widest_turn` tells something."""

    if TYPE_CHECKING:
        framed: bool

        @property
        def gravity(self) -> Array:
            """Acceleration of gravity that acts on it [m/s^2]."""

    @property
    def positions(self) -> Array:
        """One for the positions of nodes."""
        return self.mesh.positions

    @property
    def banded(self) -> bool:
        """Whether it has no body frame, with which all its coordinates are coupled."""
        return not self.framed

    @property
    def position_columns(self) -> IntArray:
        """Those of the nodes, unless they are relative to a frame."""
        return super().position_columns[: 0 if self.framed else None]

    def widest_turn(self, x: Array) -> float:
        """Return the largest angle between sections of neighbouring nodes in a state (1, n) [rad]."""
        return 0.0

    def beyond_mesh(self, t: float, x: Array) -> SolverFailure | None:
        """Return the failure of elements that turn by more than `FARTHEST` from node to node.

        Section vectors in between, which are polynomials through those of the nodes, shrink then, and the
        line grows in their stead without any strain: a rod that is wound up gets many times longer.
        """
        if not (turn := self.widest_turn(x)) > FARTHEST:
            return None
        return SolverFailure(
            reason=f"body '{self.name}' turns by {np.degrees(turn):.0f} deg from one node to the "
            f"next at t = {t:.4g} s: its elements cannot follow that",
            time=t,
            item=self.item,
            kind="model",
            evidence={"turn_between_nodes": turn},
            remedy=f"--set {self.item}.elements={2 * self.mesh.count}, or loads that wind it up less",
        )

    def reference(self, place: Place) -> Place:
        """Return where a point is in the undeformed body frame: places count along the line."""
        return self.mesh.reference(place)

    def along(self, marker: Marker) -> float:
        """Return how far from the root the section of one of its points is [m]."""
        assert isinstance(marker, LinearMarker)
        return float(marker.place_row @ self.mesh.distances)

    def carried_beyond(self, x: Array, u: Array, a: Array, places: Array) -> Pair:
        """Return weight less inertia of its parts beyond places, and their moment about the root."""
        mesh, shifts = self.mesh, self.positions[:, None]
        spans, length = mesh.spans, mesh.length / mesh.count
        arms, pulls = self.arms(x), shifts * self.gravity - self.vectors(a)

        def summed(start: float, e: IntArray) -> Array:
            """Return force and moment, side by side, of parts of elements beyond a share of their length."""
            masses = mesh.masses_from(start)
            own = (masses if len(masses) == 1 else masses[e]) @ pulls[:, spans[e]]
            force = np.sum(shifts[spans[e]] * own, axis=2)
            return np.concatenate([force, lever(arms[:, spans[e]], own).sum(axis=2)], axis=-1)

        whole = summed(0.0, np.arange(mesh.count))
        beyond = np.zeros_like(whole)
        beyond[:, :-1] = np.cumsum(whole[:, :0:-1], axis=1)[:, ::-1]
        e = np.minimum((places / length + ROUNDING).astype(int), mesh.count - 1)
        starts = np.clip(np.round(places / length - e, 9), 0.0, 1.0)
        found = beyond[:, e]
        for start in distinct(starts):
            some = starts == start
            found[:, some] += summed(float(start), e[some])
        return found[..., : self.n_dim], found[..., self.n_dim :]
