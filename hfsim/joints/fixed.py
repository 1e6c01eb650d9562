"""Fixed joint: two points stay together and do not turn."""

from __future__ import annotations

from typing import Literal

from hfsim.spec import Angle, Between, Spec


class FixedSpec(Spec):
    """Two points stay together and the frames there keep their relative angle."""

    type: Literal["fixed"]
    """Kind of joint."""

    between: Between
    """The two points, [A, B]."""

    angle: Angle = 0.0
    """Angle of B's frame relative to A's at the joint [rad]."""
