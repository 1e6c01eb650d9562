"""Bodies; the union names every kind there is."""

from typing import Annotated

from hfsim.bodies.beam import BeamSpec, QuadratureSpec
from hfsim.bodies.rigid import RigidSpec
from hfsim.spec import OneOf

AnyBody = Annotated[BeamSpec | RigidSpec, OneOf("type", {"beam": BeamSpec, "rigid": RigidSpec})]

__all__ = ["AnyBody", "BeamSpec", "QuadratureSpec", "RigidSpec"]
