"""Beams of elements, and their internal forces by balance.

The part of a beam beyond a section moves by what acts on it, and by what the part before the section does.
So the section bears loads, joints and weight beyond it less the inertia there, whatever the measures of
strain are: these are the sums that the equations of motion hold to rounding, for the whole beam and element
by element, and inside an element integrals of its own shapes.  What strains give instead is as smooth as
the shapes' highest derivatives are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hfsim.deck.sections import Fibres
from hfsim.maths.arrays import Array, slices
from hfsim.maths.rotations import lever
from hfsim.mechanics.body import Acting, Body
from hfsim.mechanics.markers import Marker

if TYPE_CHECKING:
    from hfsim.parts.bodies.mesh import BeamMesh
    from hfsim.parts.bodies.section_mesh import SectionMesh

ENTRIES = 8_000_000
"""Of shape rows that are made at once: 64 MB."""
ROUNDING = 1e-9
"""Distance, over the length of a beam, that counts as none."""
Pair = tuple[Array, Array]
"""Forces [N], (n_batch, n_places, n_dim), and moments [N m], (n_batch, n_places, n_spin), about the root."""


class MeshedBeam(Body):
    """A beam of elements; its internal forces hold the balance of what lies beyond a section."""

    if TYPE_CHECKING:

        @property
        def mesh(self) -> BeamMesh | SectionMesh:
            """Its elements."""

        def along(self, marker: Marker) -> float:
            """Return how far from the root the section of one of its points is [m]."""

        def line(self, x: Array, places: Array) -> Array:
            """Return points of its line, (n_batch, n_places, n_dim)."""

        def resultant(self, x: Array, force: Array) -> Pair:
            """Return force and moment about its root of a generalised force (n_batch, n_columns)."""

        def carried_beyond(self, x: Array, u: Array, a: Array, places: Array) -> Pair:
            """Return weight less inertia of its parts beyond places."""

        def section_axes(self, x: Array, places: Array) -> Array:
            """Return the axes of sections at places, (n_batch, n_places, 3, 3), as columns."""

    @property
    def length(self) -> float:
        """Undeformed [m]."""
        return self.mesh.length

    @property
    def outline_places(self) -> Array:
        """Those of its mesh."""
        return self.mesh.outline_places

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
        from hfsim.parts.bodies.section_axes import in_axes

        force, moment = self.carried_beyond(x, u, a, places)
        sections = places - ROUNDING * self.length * (places > (1.0 - ROUNDING) * self.length)
        for marker, load in acting.points:
            beyond = (self.along(marker) > sections + 0.5 * ROUNDING * self.length).astype(float)[:, None]
            own, about = self.resultant(x, load)
            force, moment = force + beyond * own[:, None], moment + beyond * about[:, None]
        points = self.line(x, np.append(0.0, places))
        for line, forces in acting.lines:
            shares, own = line.beyond(places), np.stack(forces, axis=1)
            arms = np.stack([marker.position(x) for marker in line.places], axis=1) - points[:, :1]
            force, moment = force + shares @ own, moment + shares @ lever(arms, own)
        moment = moment - lever(points[:, 1:] - points[:, :1], force)
        axes = self.section_axes(x, places)
        return in_axes(axes, _padded(force, after=True), _padded(moment, after=False))


def _padded(numbers: Array, after: bool) -> Array:
    """Return vectors (..., n) of three numbers: those that the plane has not are zero."""
    missing = 3 - numbers.shape[-1]
    return np.pad(numbers, ((0, 0), (0, 0), (0, missing) if after else (missing, 0)))
