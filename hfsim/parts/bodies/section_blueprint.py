"""What a beam with sections is made of, before it has a model."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.mechanics.body import Place, places
from hfsim.parts.bodies.beam_axis import Axis
from hfsim.parts.bodies.section_mesh import SectionMesh


class SectionBlueprint(NamedTuple):
    """A beam with sections before it has a model.

    Attributes
    ----------
    name : str
        Of the body.
    start : int
        Column of x where its coordinates begin.
    gravity : ndarray, shape (n_dim,)
        [m/s^2].
    points : dict of str to Place
        Named points, root and tip among them.
    """

    name: str
    start: int
    mesh: SectionMesh
    gravity: Array
    points: dict[str, Place]

    @classmethod
    def of(cls, spec: Any, name: str, start: int, deck: Any) -> SectionBlueprint:
        """Return what a beam of a deck, a `BeamSpec`, is made of; its coordinates begin at a column."""
        axis, properties = Axis.of(spec, deck.dimension), deck.section_properties(name)
        mesh = SectionMesh(axis, spec.elements, spec.degree, properties)
        beside = (0.0,) * (deck.dimension - 1)
        ends = {"root": (0.0, *beside), "tip": (spec.length, *beside)}
        return cls(name, start, mesh, np.array(deck.gravity), places(spec.points) | ends)

    @property
    def n_dim(self) -> int:
        """Number of components of a vector."""
        return len(self.gravity)

    @property
    def sections(self) -> SectionMesh:
        """Its mesh: the line has sections."""
        return self.mesh

    @property
    def inertia(self) -> tuple[float, Array, Array]:
        """Mass [kg], its centre [m], and Euler's tensor about that, (n_dim, n_dim) [kg m^2], undeformed."""
        return self.mesh.inertia

    def columns(self, count: int) -> slice:
        """Return the run of so many coordinates."""
        return slice(self.start, self.start + count)
