"""Spring and damper along the line between two points."""

from __future__ import annotations

from typing import Literal

from hfsim.spec import Between, Damping, NonNegativeLength, Spec, Stiffness


class TwoPointSpec(Spec):
    """Linear spring and damper on the distance of two points."""

    type: Literal["two_point"]
    """Kind of spring."""

    between: Between
    """The two points, [A, B]."""

    stiffness: Stiffness
    """Stiffness [N/m]."""

    damping: Damping = 0.0
    """Damping [N s/m]."""

    rest_length: NonNegativeLength | None = None
    """Distance without force [m]; without it, the distance at the start."""
