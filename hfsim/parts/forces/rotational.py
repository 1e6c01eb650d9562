"""Rotational spring and damper between two frames, in space about an axis."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from hfsim.deck.fields import (
    Angle,
    Axis,
    Between,
    Orientation,
    RotationalDamping,
    RotationalStiffness,
    degrees_as_radians,
)
from hfsim.deck.spec import Around, Complaint
from hfsim.maths.arrays import Array
from hfsim.maths.matrices import Entries
from hfsim.mechanics.constraints import Constraint, RelativeAngle
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.turns import TurnCount
from hfsim.parts.forces._base import Spring
from hfsim.parts.specs import SpringSpec


class RotationalSpec(SpringSpec):
    """Linear spring and damper on the angle of B relative to A, in space about an axis fixed in A."""

    vectors = ("axis",)
    spatial = ("axis", "orientation")

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

    axis: Axis | None = None
    """Axis in A's frame, in space [-]; [0, 0, 1] without it."""

    orientation: Orientation | None = None
    """Orientation of B's frame relative to A's where the angle is zero, in space; without it the smallest
    rotation that takes the axis in B to that in A."""

    def slips_in(self, around: Around) -> Iterator[Complaint]:
        """Yield an angle that looks like degrees."""
        return degrees_as_radians("rest_angle", self.rest_angle)

    def build(self, first: Marker, second: Marker, start: Array) -> "RotationalSpring":
        """Return the force between two markers."""
        known = first.keeps_turns and second.keeps_turns
        turns = None if known else TurnCount()
        angle = self._angle_between(first, second, start)
        return RotationalSpring(first, second, self.stiffness, self.damping, self.rest_angle, angle, turns)

    def _angle_between(self, first: Marker, second: Marker, start: Array) -> Constraint:
        if first.n_dim == 2:
            return RelativeAngle(first, second)
        from hfsim.mechanics.directions import THIRD
        from hfsim.mechanics.spatial_turns import About

        axis = self.axis or THIRD
        own, other = (np.array([one.turned(start[None], e)[0] for e in np.eye(3)]) for one in (first, second))
        (angle,) = About.of(axis, own @ other.T, zero=self.orientation).between(first, second)
        return angle


@dataclass(frozen=True)
class RotationalSpring(Spring):
    """Moment -k (angle - rest) - d angle' on the second body, the opposite on the first.

    The angle counts full turns: where vectors of a body give it, along the motion.

    Attributes
    ----------
    turn : Constraint
        Whose gap is the angle.
    counter : TurnCount or None
        None between bodies whose coordinates keep their turns.
    """

    turn: Constraint
    counter: TurnCount | None = None

    @property
    def quartic(self) -> bool:
        """Whether the angle is a coordinate."""
        return self.first.linear_turn and self.second.linear_turn and not self.damping

    def angle(self, x: Array) -> Array:
        """Return how far the second frame has turned against the first."""
        return np.asarray(self.turn.gap(x)[:, 0])

    def spin(self, x: Array, u: Array) -> Array:
        """Return the rate of that."""
        return self._rate(self._rows(x), u)

    def _rows(self, x: Array) -> list[Array]:
        return [self.turn.jacobian(end, x)[:, 0] for end in self._on_bodies]

    @cached_property
    def _on_bodies(self) -> list[int]:
        """Numbers of the ends that are not on the ground."""
        return [end for end, marker in enumerate(self.turn.ends) if not marker.grounded]

    def measured(self, t: Array, x: Array) -> tuple[Array, list[Array]]:
        """Return how far the second frame has turned against the first, from the rest angle."""
        angle = self.angle(x)
        if self.counter is not None:
            angle = self.counter.counted(t, angle)
        return angle - self.rest, self._rows(x)

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return k J^T J and what the angle's second derivative makes of the moment, in one state."""
        if self.damping:
            return super().tangent(t, x, u)
        moment = self.stiffness * self.measured(t, x)[0]
        parts = self._dyad(t, x, self.stiffness), self.turn.stiffness(x, moment[:, None])
        return Entries(*(np.concatenate(kind) for kind in zip(*parts, strict=True)))
