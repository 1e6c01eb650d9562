"""Prismatic joint: one point slides along an axis of the other body."""

from __future__ import annotations

from typing import Literal

from hfsim.spec import Angle, Axis, Between, Spec


class PrismaticSpec(Spec):
    """Point B slides along an axis through A; the frames there keep their relative angle."""

    type: Literal["prismatic"]
    """Kind of joint."""

    between: Between
    """The two points, [A, B]."""

    axis: Axis = (1.0, 0.0)
    """Direction of sliding in A's frame [-]; its length does not matter."""

    angle: Angle = 0.0
    """Angle of B's frame relative to A's at the joint [rad]."""
