"""Bodies; the union names every kind there is."""

from typing import Annotated

from pydantic import Field

from hfsim.bodies.beam import BeamSpec, QuadratureSpec
from hfsim.bodies.rigid import RigidSpec

AnyBody = Annotated[BeamSpec | RigidSpec, Field(discriminator="type")]

__all__ = ["AnyBody", "BeamSpec", "QuadratureSpec", "RigidSpec"]
