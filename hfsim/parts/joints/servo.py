"""Servo: a torque or a force that pulls an angle or a distance towards a law of time (PD control)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Literal

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import (
    Axis,
    Damping,
    PositiveForce,
    PositiveMoment,
    PositiveRotationalStiffness,
    PositiveStiffness,
    RotationalDamping,
)
from hfsim.deck.law_specs import AngleLaw, PositionLaw
from hfsim.maths.arrays import Array
from hfsim.mechanics.constraints import Held
from hfsim.mechanics.resistances import Control, Resistance
from hfsim.parts.joints._actuator import ActuatorSpec
from hfsim.parts.joints._coordinate import coordinate


class ServoSpec(ActuatorSpec):
    """Pulls the angle of B relative to A, or the distance of B from A along an axis, towards a law of time:
    stiffness times what is missing plus damping times the rate that is. It holds nothing.
    """

    measures = (("rad", "angle"), ("m", "position"))
    led_angle = "angle"

    type: Literal["servo"]

    angle: AngleLaw | None = None
    """Angle that B's frame is to have relative to A's over time [rad]; or give the position."""

    position: PositionLaw | None = None
    """Distance that B is to have from A along the axis over time [m]; or give the angle."""

    stiffness: PositiveRotationalStiffness
    """Proportional gain [N m/rad], of a position [N/m]."""

    damping: RotationalDamping = 0.0
    """Derivative gain [N m s/rad], of a position [N s/m]."""

    limit: PositiveMoment | None = None
    """Torque [N m], of a position force [N], that is not exceeded: limit tanh(what the gains ask / limit)."""

    axis: Axis | None = None
    """Axis in A's frame [-]: of a position, without it the first axis, in space [0, 0, 1]; of an angle in
    space, without it [0, 0, 1]."""

    @classmethod
    def _read(cls, value: Any, read: Callable[[Any], Any]) -> Any:
        """Read one of a position with its own units."""
        if cls is ServoSpec and isinstance(value, dict) and value.get("position") is not None:
            return SlidingServoSpec.model_validate(value)
        return super()._read(value, read)

    def complaints(self) -> Iterator[Complaint]:
        """Yield a servo towards nothing or towards two things."""
        if (self.angle is None) == (self.position is None):
            yield Complaint((), "a servo needs an angle or a position to go to, one of the two")

    @property
    def carries(self) -> bool:
        """Whether it acts on a distance."""
        return self.position is not None

    def coordinates(self, facing: Array | None = None) -> Iterator[tuple[str, Held]]:
        """Yield what it acts on."""
        yield "", coordinate(self.axis, self.position is None, facing)

    @property
    def resisting(self) -> Mapping[str, tuple[Resistance, ...]]:
        """The control."""
        law = self.angle or self.position
        assert law is not None
        return {"": (Control(law.build(), self.stiffness, self.damping, self.limit),)}


class SlidingServoSpec(ServoSpec):
    """Pulls the distance of B from A along an axis."""

    stiffness: PositiveStiffness
    """Proportional gain [N/m]."""

    damping: Damping = 0.0
    """Derivative gain [N s/m]."""

    limit: PositiveForce | None = None
    """Force that is never exceeded [N]: limit tanh(what the gains ask / limit)."""
