"""Rigid bodies."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import Inertia, Points, PositiveMass, flat, within
from hfsim.deck.reader import Path
from hfsim.deck.spec import Around
from hfsim.maths.rotations import freedoms
from hfsim.mechanics.body import Body, places
from hfsim.parts.specs import BodySpec

_FAR = (200.0, 5000.0)
"""Radius of gyration over the distance of the farthest point, with an inertia in kg mm^2."""


class RigidSpec(BodySpec):
    """Rigid body; its frame is at the centre of mass."""

    rigid = True
    noun = "rigid body"
    element: ClassVar[None] = None

    type: Literal["rigid"]
    """Kind of body."""

    mass: PositiveMass
    """Mass [kg]."""

    inertia: Inertia
    """Moment of inertia about the centre of mass [kg m^2]; in space the three principal moments or the whole
    matrix, in body axes."""

    points: Points = Field(default_factory=dict)
    """Named points in the body frame [m]."""

    def spaces(self) -> Iterator[tuple[int, Path]]:
        """Yield what its vectors say, and a moment of inertia of several numbers."""
        if isinstance(self.inertia, tuple):
            yield 3, ("inertia",)
        yield from super().spaces()

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield a moment of inertia that space or no body has."""
        yield from super().complaints_in(around)
        if around.n_dim == 2:
            if isinstance(self.inertia, tuple):
                yield Complaint(("inertia",), "must be one number: this scene is planar")
        elif isinstance(self.inertia, tuple):
            from hfsim.parts.bodies.spatial_rigid import inertia_complaint

            if complaint := inertia_complaint(self.inertia):
                yield Complaint(("inertia",), *complaint)
        else:
            why = f": {around.why}" if around.why else ""
            hint = f"a ball has [{self.inertia:g}, {self.inertia:g}, {self.inertia:g}]"
            message = f"must be 3 numbers or 3 rows of 3: this scene is spatial{why}"
            yield Complaint(("inertia",), message, hint)

    def slips_in(self, around: Around) -> Iterator[Complaint]:
        """Yield a moment of inertia that puts the mass far away from all points of the body."""
        reach = max((math.hypot(*point) for point in self.points.values()), default=0.0)
        largest = self.inertia if isinstance(self.inertia, float) else max(map(abs, flat(self.inertia)))
        gyration = math.sqrt(largest / self.mass)
        if reach and within(gyration / reach, _FAR):
            message = f"as if its mass were {gyration:.3g} m from its centre, no point beyond {reach:.3g} m"
            yield Complaint(("inertia",), message, f"'{largest:g} kg mm2'?")

    def assemble(self, name: str, start: int, deck: Any, model: Any) -> Body:
        """Return the body whose coordinates begin at a column; rigid bodies have no models."""
        gravity = np.array(deck.gravity)
        if isinstance(self.inertia, tuple):
            from hfsim.parts.bodies.spatial_flat_body import FlatRigidBody
            from hfsim.parts.bodies.spatial_rigid import SpatialRigidBody, inertia_matrix

            columns = slice(start, start + SpatialRigidBody.SIZE)
            J = inertia_matrix(self.inertia)
            body = SpatialRigidBody(name, columns, places(self.points), self.mass, J, gravity)
            return FlatRigidBody.of(body) or body
        from hfsim.parts.bodies.planar_rigid import RigidBody

        columns = slice(start, start + freedoms(len(gravity)))
        return RigidBody(name, columns, places(self.points), self.mass, self.inertia, gravity)
