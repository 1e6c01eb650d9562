"""Revolute joint: two points stay together."""

from __future__ import annotations

from typing import Literal

from hfsim.spec import Between, Spec


class RevoluteSpec(Spec):
    """Two points stay together, the bodies may turn."""

    type: Literal["revolute"]
    """Kind of joint."""

    between: Between
    """The two points, [A, B]."""
