"""Universal joint: two points stay together, and an axis of each body at right angles to one of the other."""

from collections.abc import Iterator
from typing import Annotated, Literal

import numpy as np

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import Angle, Axis, Orientation, entries
from hfsim.deck.spec import Before
from hfsim.maths.arrays import Array
from hfsim.mechanics.constraints import Held, Shift
from hfsim.parts.specs import JointSpec

_SQUARE = 1e-3
"""Cosine of an angle that is not a right one."""

TwoAxes = Annotated[tuple[Axis, Axis], Before(lambda value: entries(value, (2,), "axes"))]


class UniversalSpec(JointSpec):
    """Two points stay together; the bodies turn about two axes at right angles, one fixed in each."""

    spatial = True
    meets = swings = True

    type: Literal["universal"]

    axes: TwoAxes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    """Axis fixed in A and axis fixed in B, both in A's frame where no angle has changed yet [-]."""

    angle: Angle | None = None
    """Angle of B's frame relative to A's about z where no angle has changed yet [rad]."""

    orientation: Orientation | None = None
    """Orientation of B's frame relative to A's where no angle has changed yet; the same without it."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield axes that are no pair in space at right angles."""
        if any(len(axis) != 3 for axis in self.axes):
            yield Complaint(("axes",), "must be two lists of 3 numbers: only space has this joint")
            return
        a, b = (np.asarray(axis) / np.linalg.norm(axis) for axis in self.axes)
        if abs(a @ b) > _SQUARE:
            degrees = np.degrees(np.arccos(np.clip(a @ b, -1.0, 1.0)))
            near = ", ".join(f"{part:.6g}" for part in b - (a @ b) * a)
            message = f"are at {degrees:.4g} degrees to each other, not at right angles"
            yield Complaint(("axes",), message, f"the second may be [{near}]")

    def held(self, facing: Array | None = None) -> tuple[Held, ...]:
        """Return what the joint holds."""
        from hfsim.mechanics.directions import Square, direction, unit

        assert facing is not None
        first, second = (unit(axis) for axis in self.axes)
        return Shift(), Square(first, direction(facing.T @ second))
