"""What decks say of Coulomb friction, stops and latches, of turns and of shifts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import (
    Angle,
    Damping,
    Dissipation,
    Length,
    PositiveAngle,
    PositiveAngularVelocity,
    PositiveForce,
    PositiveLength,
    PositiveMoment,
    PositiveRotationalStiffness,
    PositiveStiffness,
    PositiveVelocity,
    RotationalDamping,
    RotationalDissipation,
)
from hfsim.deck.law_specs import ScaleLaw
from hfsim.deck.laws import Law
from hfsim.deck.spec import Around, Spec
from hfsim.mechanics.friction import Friction
from hfsim.mechanics.latches import Latch
from hfsim.mechanics.resistances import Stop


class FrictionSpec(Spec):
    """Coulomb friction."""

    law: ScaleLaw | None = None
    """Factor over time, never negative, as of a brake [-]; 1 without it."""

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield a factor that becomes negative, so that friction would drive."""
        yield from super().complaints_in(around)
        if self.law is not None and (told := self.law.below_zero(around)):
            yield Complaint(("law",), f"{told}, and friction never drives", "at least 0 at all times")

    @property
    def factor(self) -> Law | None:
        """The law, built."""
        return self.law.build() if self.law else None


class TurningFrictionSpec(FrictionSpec):
    """Coulomb friction of a turn: torque tanh(rate / velocity)."""

    torque: PositiveMoment
    """Torque of sliding [N m]; it does not depend on what the joint bears."""

    velocity: PositiveAngularVelocity = 1e-3
    """Rate at which it has 76 % of that, and at twice as much 96 % [rad/s]; what would stick creeps."""

    def build(self) -> Friction:
        """Return the friction."""
        return Friction(self.torque, self.velocity, self.factor)


class SlidingFrictionSpec(FrictionSpec):
    """Coulomb friction of a shift: force tanh(rate / velocity)."""

    force: PositiveForce
    """Force of sliding [N]; it does not depend on what the joint bears."""

    velocity: PositiveVelocity = 1e-3
    """Rate at which it has 76 % of that, and at twice as much 96 % [m/s]; what would stick creeps."""

    def build(self) -> Friction:
        """Return the friction."""
        return Friction(self.force, self.velocity, self.factor)


class StopsSpec(Spec):
    """Stiff springs beyond the limits of a coordinate, that only ever push."""

    lower: Any = None
    upper: Any = None
    stiffness: Any
    damping: Any
    transition: Any

    def complaints(self) -> Iterator[Complaint]:
        """Yield stops without limits, or with limits in the wrong order."""
        if self.lower is None and self.upper is None:
            yield Complaint((), "stops need a lower or an upper limit", "e.g. upper: 1.2")
        elif self.lower is not None and self.upper is not None and self.lower >= self.upper:
            message = f"must be greater than the lower limit, {self.lower:g}, not {self.upper:g}"
            yield Complaint(("upper",), message)

    def build(self) -> Iterator[Stop]:
        """Yield a stop for each limit."""
        for limit, side in ((self.lower, -1.0), (self.upper, 1.0)):
            if limit is not None:
                yield Stop(limit, side, self.stiffness, self.damping, self.transition)


class TurningStopsSpec(StopsSpec):
    """Stops of a turn."""

    angles = ("lower", "upper")

    lower: Angle | None = None
    """Least angle [rad]; or give the upper one alone."""

    upper: Angle | None = None
    """Largest angle [rad]."""

    stiffness: PositiveRotationalStiffness
    """Stiffness beyond them [N m/rad]."""

    damping: RotationalDissipation = 0.0
    """Factor c of Hunt and Crossley [s/rad]: where the turn goes on at a small rate w, the moment is 1 + c w
    times that of the stiffness, and it never pulls."""

    transition: PositiveAngle = 1e-3
    """Angle beyond a limit over which the stiffness sets in [rad]."""


class SlidingStopsSpec(StopsSpec):
    """Stops of a shift."""

    lower: Length | None = None
    """Least distance [m]; or give the upper one alone."""

    upper: Length | None = None
    """Largest distance [m]."""

    stiffness: PositiveStiffness
    """Stiffness beyond them [N/m]."""

    damping: Dissipation = 0.0
    """Factor c of Hunt and Crossley [s/m]: where the shift goes on at a small rate w, the force is 1 + c w
    times that of the stiffness, and it never pulls."""

    transition: PositiveLength = 1e-3
    """Distance beyond a limit over which the stiffness sets in [m]."""


class TurningLatchSpec(Spec):
    """A latch on a turn: it holds for good from when the angle comes to its place, or starts there."""

    angles = ("angle",)

    angle: Angle
    """Where it catches, and holds without moment [rad]."""

    stiffness: PositiveRotationalStiffness
    """Stiffness with which it holds [N m/rad]."""

    damping: RotationalDamping = 0.0
    """Damping with which it does [N m s/rad]."""

    def build(self) -> Latch:
        """Return the latch."""
        return Latch(self.angle, self.stiffness, self.damping)


class SlidingLatchSpec(Spec):
    """A latch on a shift: it holds for good from when the distance comes to its place, or starts there."""

    distance: Length
    """Where it catches, and holds without force [m]."""

    stiffness: PositiveStiffness
    """Stiffness with which it holds [N/m]."""

    damping: Damping = 0.0
    """Damping with which it does [N s/m]."""

    def build(self) -> Latch:
        """Return the latch."""
        return Latch(self.distance, self.stiffness, self.damping)
