"""Joints; `JOINTS` names every kind there is. The module of a kind is imported when a deck has one."""

from typing import TYPE_CHECKING, Annotated

from hfsim.spec import OneOf, Spec

if TYPE_CHECKING:
    from hfsim.joints.driver import DriverSpec
    from hfsim.joints.fixed import FixedSpec
    from hfsim.joints.prismatic import PrismaticSpec
    from hfsim.joints.revolute import RevoluteSpec

    AnyJoint = RevoluteSpec | FixedSpec | PrismaticSpec | DriverSpec

JOINTS = {
    "revolute": "hfsim.joints.revolute.RevoluteSpec",
    "fixed": "hfsim.joints.fixed.FixedSpec",
    "prismatic": "hfsim.joints.prismatic.PrismaticSpec",
    "driver": "hfsim.joints.driver.DriverSpec",
}

if not TYPE_CHECKING:
    AnyJoint = Annotated[Spec, OneOf("type", JOINTS)]

__all__ = ["JOINTS", "AnyJoint"]
