"""Springs between two points and loads on one; the unions name every kind there is."""

from typing import Annotated

from pydantic import Field

from hfsim.forces.force import ForceSpec
from hfsim.forces.moment import MomentSpec
from hfsim.forces.rotational import RotationalSpec
from hfsim.forces.two_point import TwoPointSpec

AnySpring = Annotated[RotationalSpec | TwoPointSpec, Field(discriminator="type")]
AnyLoad = Annotated[ForceSpec | MomentSpec, Field(discriminator="type")]

__all__ = ["AnyLoad", "AnySpring", "ForceSpec", "MomentSpec", "RotationalSpec", "TwoPointSpec"]
