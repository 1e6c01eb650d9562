"""What decks say of damping, friction, stops and latches, in the free motions of joints and in springs.

But for damping they are read, and what resists is imported, where a deck has them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from hfsim.deck.fields import Damping, RotationalDamping
from hfsim.deck.spec import Spec, entry_of

if TYPE_CHECKING:
    from hfsim.mechanics.resistances import Resistance


class _Resisted:
    """Damping, friction, stops and a latch of one coordinate."""

    if TYPE_CHECKING:
        damping: Any
        friction: Any
        stops: Any
        latch: Any

    @property
    def resistances(self) -> tuple[Resistance, ...]:
        """What is stated."""
        if not self.damping:
            return self.contacts
        from hfsim.mechanics.resistances import LinearSpring

        return LinearSpring(0.0, self.damping), *self.contacts

    @property
    def contacts(self) -> tuple[Resistance, ...]:
        """What is stated besides damping."""
        single = [one.build() for one in (self.friction, self.latch) if one]
        return (*single, *(self.stops.build() if self.stops else ()))


class TurningResistanceSpec(_Resisted, Spec):
    """What resists a turn."""

    damping: RotationalDamping = 0.0
    """Damping [N m s/rad]."""

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

    friction: Annotated[Any, entry_of("hfsim.parts.contacts.SlidingFrictionSpec")] | None = None
    """Coulomb friction."""

    stops: Annotated[Any, entry_of("hfsim.parts.contacts.SlidingStopsSpec")] | None = None
    """Stops."""

    latch: Annotated[Any, entry_of("hfsim.parts.contacts.SlidingLatchSpec")] | None = None
    """Latch: holds for good from when the motion comes to its place."""
