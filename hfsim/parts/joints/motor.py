"""Motor: a torque or a force between two bodies, constant or scaled over time."""

from collections.abc import Iterator, Mapping
from typing import Literal

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import Axis, Force, Moment
from hfsim.deck.law_specs import ScaleLaw
from hfsim.maths.arrays import Array
from hfsim.mechanics.constraints import Held
from hfsim.mechanics.resistances import Push, Resistance
from hfsim.parts.joints._actuator import ActuatorSpec
from hfsim.parts.joints._coordinate import coordinate


class MotorSpec(ActuatorSpec):
    """Turns B against A by a torque about an axis, or pushes it along one by a force; it holds nothing."""

    steadies = False
    measures = (("rad", "torque"), ("m", "force"))

    type: Literal["motor"]

    torque: Moment | None = None
    """Torque on B about the axis, its opposite on A [N m]; or give the force. In space the axis turns with A
    alone."""

    force: Force | None = None
    """Force on B along the axis, its opposite on A [N]; or give the torque."""

    axis: Axis | None = None
    """Axis in A's frame [-]: of a force, without it the first axis, in space [0, 0, 1]; of a torque in space,
    without it [0, 0, 1]."""

    law: ScaleLaw | None = None
    """Factor over time [-]; 1 without it."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield a motor of nothing or of two things."""
        if (self.torque is None) == (self.force is None):
            yield Complaint((), "a motor needs a torque or a force, one of the two")

    @property
    def carries(self) -> bool:
        """Whether it is a force."""
        return self.force is not None

    def coordinates(self, facing: Array | None = None) -> Iterator[tuple[str, Held]]:
        """Yield what it acts on."""
        yield "", coordinate(self.axis, self.force is None, facing)

    @property
    def resisting(self) -> Mapping[str, tuple[Resistance, ...]]:
        """The torque or the force."""
        law = self.law.build() if self.law else None
        return {"": (Push((self.torque or 0.0) if self.force is None else self.force, law),)}

    def resisted(self, facing: Array | None = None) -> Iterator[tuple[str, Held, tuple[Resistance, ...]]]:
        """Yield what it acts on: in space a torque does that whatever the angle."""
        for key, held in self.coordinates(facing):
            if facing is not None and self.force is None:
                from hfsim.mechanics.spatial_turns import TorqueAbout, about

                held = TorqueAbout(about(self.axis, facing))
            yield key, held, self.resisting[key]
