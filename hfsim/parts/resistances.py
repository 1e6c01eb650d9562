"""What decks say of damping, friction, stops and latches, in the free motions of joints and in springs.

But for damping they are read, and what resists is imported, where a deck has them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any

from hfsim.deck.fields import Damping, RotationalDamping, damping_table_of
from hfsim.deck.spec import Spec, entry_of

if TYPE_CHECKING:
    from hfsim.mechanics.resistances import Resistance

Rows = tuple[tuple[float, float], ...]


class _Resisted:
    """Damping, friction, stops and a latch of one coordinate."""

    if TYPE_CHECKING:
        damping: Any
        damping_table: Any
        friction: Any
        stops: Any
        latch: Any

    @property
    def resistances(self) -> tuple[Resistance, ...]:
        """What is stated."""
        if not self.damping:
            return self.others
        from hfsim.mechanics.resistances import LinearSpring

        return LinearSpring(0.0, self.damping), *self.others

    @property
    def others(self) -> tuple[Resistance, ...]:
        """What is stated besides the damping that is a number."""
        return (*self.tabled, *self.undamped)

    @property
    def undamped(self) -> tuple[Resistance, ...]:
        """What is stated besides any damping."""
        single = [one.build() for one in (self.friction, self.latch) if one]
        return (*single, *(self.stops.build() if self.stops else ()))

    @property
    def tabled(self) -> Iterator[Resistance]:
        """The damping that is a table."""
        if self.damping_table:
            from hfsim.mechanics.tabled import Curve, TableDamper

            yield TableDamper(Curve.through(self.damping_table))


class TurningResistanceSpec(_Resisted, Spec):
    """What resists a turn."""

    damping: RotationalDamping = 0.0
    """Damping [N m s/rad]."""

    damping_table: Annotated[Rows, *damping_table_of("angular_velocity", "moment")] | None = None
    """Rows [rate, moment that resists], [0, 0] among them, between them monotone cubics, beyond them
    straight lines [rad/s, N m]."""

    friction: Annotated[Any, entry_of("hfsim.parts.contacts.TurningFrictionSpec")] | None = None
    """Coulomb friction."""

    stops: Annotated[Any, entry_of("hfsim.parts.contacts.TurningStopsSpec")] | None = None
    """Stops."""

    latch: Annotated[Any, entry_of("hfsim.parts.contacts.TurningLatchSpec")] | None = None
    """Latch: holds for good from when the motion comes to its place."""


class SlidingResistanceSpec(_Resisted, Spec):
    """What resists a shift."""

    damping: Damping = 0.0
    """Damping [N s/m]."""

    damping_table: Annotated[Rows, *damping_table_of("velocity", "force")] | None = None
    """Rows [rate, force that resists], [0, 0] among them, between them monotone cubics, beyond them
    straight lines [m/s, N]."""

    friction: Annotated[Any, entry_of("hfsim.parts.contacts.SlidingFrictionSpec")] | None = None
    """Coulomb friction."""

    stops: Annotated[Any, entry_of("hfsim.parts.contacts.SlidingStopsSpec")] | None = None
    """Stops."""

    latch: Annotated[Any, entry_of("hfsim.parts.contacts.SlidingLatchSpec")] | None = None
    """Latch: holds for good from when the motion comes to its place."""
