"""Joints; the union names every kind there is."""

from typing import Annotated

from pydantic import Field

from hfsim.joints.driver import DriverSpec
from hfsim.joints.fixed import FixedSpec
from hfsim.joints.prismatic import PrismaticSpec
from hfsim.joints.revolute import RevoluteSpec

AnyJoint = Annotated[RevoluteSpec | FixedSpec | PrismaticSpec | DriverSpec, Field(discriminator="type")]

__all__ = ["AnyJoint", "DriverSpec", "FixedSpec", "PrismaticSpec", "RevoluteSpec"]
