"""Force on a point."""

from __future__ import annotations

from typing import Literal

from hfsim.laws import ScaleLaw
from hfsim.spec import Flag, ForceVector, Spec


class ForceSpec(Spec):
    """Force on a point, constant or scaled over time."""

    type: Literal["force"]
    """Kind of load."""

    at: str
    """Point it acts on."""

    force: ForceVector
    """Force [N], in the ground frame; in the frame of the point if it follows."""

    follower: Flag = False
    """Whether the force turns with the frame of its point."""

    law: ScaleLaw | None = None
    """Factor over time [-]; 1 without it."""
