"""Motion joint: one point moves against another as laws of time say."""

from collections.abc import Iterator
from typing import Literal

import numpy as np

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import Angle, Axis, Orientation
from hfsim.deck.law_specs import AngleLaw, PositionLaw
from hfsim.maths.arrays import Array
from hfsim.mechanics.constraints import Held, Shift, Turn
from hfsim.parts.joints._driven import DrivenSpec


class MotionSpec(DrivenSpec):
    """Moves point B against A, and turns it, as laws of time say: ground that shakes, an end that is led.

    What has no law is held as by a fixed joint.
    """

    led = ("x", "y", "z", "turn")
    led_angle = "turn"
    vectors = ("axis",)
    spatial = ("z", "axis", "orientation")
    angles = ("angle",)

    type: Literal["motion"]

    x: PositionLaw | None = None
    """Place of B along A's first axis over time [m]; zero without it."""

    y: PositionLaw | None = None
    """Place of B along A's second axis over time [m]; zero without it."""

    z: PositionLaw | None = None
    """Place of B along A's third axis over time, in space [m]; zero without it."""

    turn: AngleLaw | None = None
    """What comes to the relative angle over time, in space about the axis [rad]; nothing without it."""

    axis: Axis | None = None
    """Axis of the turn in A's frame, in space [-]; [0, 0, 1] without it."""

    angle: Angle = 0.0
    """Angle of B's frame relative to A's without the turn, in space about z [rad]."""

    orientation: Orientation | None = None
    """Orientation of B's frame relative to A's without the turn, in space; the same without it."""

    hinged: bool = False
    """Whether B may turn freely, in space as on a ball joint."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield a motion without laws, and turns that are free and stated."""
        yield from super().complaints()
        if not any(self.laws):
            yield Complaint((), "a motion needs a law: x, y, z or turn", "or take a fixed joint")
        turns = ("turn", "axis", "angle", "orientation")
        stated = [key for key in turns if getattr(self, key) not in (None, 0.0)]
        if self.hinged:
            why = "it is hinged: all turns are free"
            yield from (Complaint((key,), why, "remove this key", True) for key in stated)
        elif self.axis is not None and self.turn is None:
            yield Complaint(("axis",), "there is no turn about it", "state a turn, or remove this key", True)

    def held(self, facing: Array | None = None) -> tuple[Held, ...]:
        """Return the place and the turn that follow the laws."""
        n_dim = 2 if facing is None else 3
        laws = {key: law.build() for key, law in self.laws}
        turn = laws.pop("turn", None)
        axes = zip("xyz", np.eye(n_dim), strict=False)
        led = (Shift(tuple(map(float, axis)), laws.get(key)) for key, axis in axes)
        places = tuple(led) if laws else (Shift(),)
        if self.hinged:
            return places
        if facing is None:
            return *places, Turn(self.angle, turn)
        from hfsim.mechanics.directions import THIRD, Facing, direction, shared_axis, unit
        from hfsim.mechanics.spatial_turns import About

        if turn is None:
            return *places, Facing.of(facing)
        axis = unit(self.axis or THIRD)
        about = About(axis, tuple(direction(row) for row in facing), turn)
        return *places, shared_axis(axis, facing), about
