"""Joints; `JOINTS` names every kind there is. The module of a kind is imported when a deck has one."""

from typing import TYPE_CHECKING, Annotated

from hfsim.deck.spec import OneOf, Spec

if TYPE_CHECKING:
    from hfsim.parts.joints.cylindrical import CylindricalSpec
    from hfsim.parts.joints.driver import DriverSpec
    from hfsim.parts.joints.fixed import FixedSpec
    from hfsim.parts.joints.gear import GearSpec
    from hfsim.parts.joints.motion import MotionSpec
    from hfsim.parts.joints.motor import MotorSpec
    from hfsim.parts.joints.prismatic import PrismaticSpec
    from hfsim.parts.joints.revolute import RevoluteSpec
    from hfsim.parts.joints.servo import ServoSpec
    from hfsim.parts.joints.spherical import SphericalSpec
    from hfsim.parts.joints.universal import UniversalSpec

    AnyPlanar = RevoluteSpec | FixedSpec | PrismaticSpec | DriverSpec | MotionSpec | MotorSpec | ServoSpec
    AnyJoint = AnyPlanar | GearSpec | SphericalSpec | UniversalSpec | CylindricalSpec

JOINTS = {
    "revolute": "hfsim.parts.joints.revolute.RevoluteSpec",
    "fixed": "hfsim.parts.joints.fixed.FixedSpec",
    "prismatic": "hfsim.parts.joints.prismatic.PrismaticSpec",
    "spherical": "hfsim.parts.joints.spherical.SphericalSpec",
    "universal": "hfsim.parts.joints.universal.UniversalSpec",
    "cylindrical": "hfsim.parts.joints.cylindrical.CylindricalSpec",
    "driver": "hfsim.parts.joints.driver.DriverSpec",
    "motion": "hfsim.parts.joints.motion.MotionSpec",
    "gear": "hfsim.parts.joints.gear.GearSpec",
    "motor": "hfsim.parts.joints.motor.MotorSpec",
    "servo": "hfsim.parts.joints.servo.ServoSpec",
}

if not TYPE_CHECKING:
    AnyJoint = Annotated[Spec, OneOf("type", JOINTS)]

__all__ = ["JOINTS", "AnyJoint"]
