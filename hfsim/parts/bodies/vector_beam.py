"""What flexible beams whose coordinates are vectors have in common, whatever their elements."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from hfsim.deck.sections import Fibres
from hfsim.errors import SolverFailure
from hfsim.maths.arrays import Array, IntArray, slices
from hfsim.mechanics.body import Acting, VectorBody
from hfsim.mechanics.markers import Marker

if TYPE_CHECKING:
    from hfsim.parts.bodies.mesh import BeamMesh
    from hfsim.parts.bodies.section_mesh import SectionMesh

ENTRIES = 8_000_000
"""Of shape rows that are made at once: 64 MB."""
FARTHEST = np.radians(120.0)
"""Angle between sections of neighbouring nodes beyond which an element means nothing; between two nodes alone
section vectors have half their length then."""


class VectorBeam(VectorBody):
    """A beam of elements; its internal forces hold the balance of what lies beyond a section."""

    has_sections: ClassVar[bool] = False
    """Whether its nodes have section vectors of unit length, so that `widest_turn` tells something."""

    if TYPE_CHECKING:
        framed: bool

        @property
        def mesh(self) -> BeamMesh | SectionMesh:
            """Its elements."""

        def line(self, x: Array, places: Array) -> Array:
            """Return points of its line, (n_batch, n_places, n_dim)."""

        def section_axes(self, x: Array, places: Array) -> Array:
            """Return the axes of sections at places, (n_batch, n_places, 3, 3), as columns."""

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

    @property
    def weighing(self) -> Array:
        """Acceleration of gravity that acts on it [m/s^2]."""
        raise NotImplementedError

    @property
    def length(self) -> float:
        """Undeformed [m]."""
        return self.mesh.length

    def outline(self, x: Array) -> Array:
        """Return points of the centre line, as many at once as their shape rows take little memory."""
        places = self.outline_places
        parts = slices(len(places), ENTRIES // (self.columns.stop - self.columns.start))
        return np.concatenate([self.line(x, places[some]) for some in parts], axis=1)

    extent = outline

    def fibres(self, places: Array) -> Fibres | None:
        """Return those of its sections."""
        return self.mesh.at(places).fibres

    def section_forces(self, x: Array, u: Array, a: Array, acting: Acting, places: Array) -> Array:
        """Return those of the balance, in axes along the line or of its sections."""
        from hfsim.parts.bodies.balance import balanced

        return balanced(self, x, u, a, acting, places)

    def along(self, marker: Marker) -> float:
        """Return how far from the root the section of one of its points is [m]."""
        from hfsim.parts.bodies.balance import along_vectors

        return along_vectors(self.mesh, marker)

    def carried_beyond(self, x: Array, u: Array, a: Array, places: Array) -> tuple[Array, Array]:
        """Return weight less inertia of its parts beyond places, and their moment about the root."""
        from hfsim.parts.bodies.balance import carried_by_vectors

        return carried_by_vectors(self, self.mesh, self.weighing, x, a, places)
