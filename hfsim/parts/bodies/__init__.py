"""Bodies; the union names every kind there is."""

from typing import Annotated

from hfsim.deck.spec import OneOf
from hfsim.parts.bodies.beam import BeamSpec, QuadratureSpec
from hfsim.parts.bodies.rigid import RigidSpec

AnyBody = Annotated[BeamSpec | RigidSpec, OneOf("type", {"beam": BeamSpec, "rigid": RigidSpec})]

__all__ = ["AnyBody", "BeamSpec", "QuadratureSpec", "RigidSpec"]
