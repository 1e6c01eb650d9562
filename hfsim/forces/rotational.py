"""Rotational spring and damper between two frames."""

from __future__ import annotations

from typing import Literal

from hfsim.spec import Angle, Between, RotationalDamping, RotationalStiffness, Spec


class RotationalSpec(Spec):
    """Linear spring and damper on the angle of B relative to A."""

    type: Literal["rotational"]
    """Kind of spring."""

    between: Between
    """The two points whose frames it connects, [A, B]."""

    stiffness: RotationalStiffness
    """Stiffness [N m/rad]."""

    damping: RotationalDamping = 0.0
    """Damping [N m s/rad]."""

    rest_angle: Angle = 0.0
    """Angle of B relative to A without moment [rad]."""
