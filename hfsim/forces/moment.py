"""Moment on the frame of a point."""

from __future__ import annotations

from typing import Literal

from hfsim.laws import ScaleLaw
from hfsim.spec import Moment, Spec


class MomentSpec(Spec):
    """Moment on the frame of a point, constant or scaled over time."""

    type: Literal["moment"]
    """Kind of load."""

    at: str
    """Point it acts on."""

    moment: Moment
    """Moment [N m], positive counter-clockwise."""

    law: ScaleLaw | None = None
    """Factor over time [-]; 1 without it."""
