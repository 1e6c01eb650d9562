"""Bodies; the union names every kind there is."""

from typing import Annotated

from hfsim.deck.spec import OneOf
from hfsim.parts.bodies.beam import BeamSpec, QuadratureSpec
from hfsim.parts.bodies.rigid import RigidSpec
from hfsim.parts.specs import BodySpec

BODIES: dict[str, type[BodySpec]] = {"beam": BeamSpec, "rigid": RigidSpec}
AnyBody = Annotated[BeamSpec | RigidSpec, OneOf("type", BODIES)]

__all__ = ["BODIES", "AnyBody", "BeamSpec", "QuadratureSpec", "RigidSpec"]
