"""What the springs have in common."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hfsim.deck.spec import Complaint
from hfsim.mechanics.resistances import LinearSpring, Resistance
from hfsim.parts.specs import SpringSpec


class CoordinateSpringSpec(SpringSpec):
    """A spring on one coordinate, with what else resists that."""

    stiffness: Any
    damping: Any
    friction: Any
    stops: Any

    def complaints(self) -> Iterator[Complaint]:
        """Yield a spring that says nothing of its force."""
        if not {"stiffness", "damping", "friction", "stops"} & self.model_fields_set:
            yield Complaint(("stiffness",), "missing key", "or give damping, friction or stops", True)

    @property
    def acts(self) -> bool:
        """Whether it ever exerts a force."""
        return bool(self.stiffness or self.damping or self.friction or self.stops)

    def from_rest(self, rest: float) -> tuple[Resistance, ...]:
        """Return all that resists a coordinate that is without force at a value."""
        return (LinearSpring(self.stiffness, self.damping, rest), *self.contacts)  # type: ignore[attr-defined]
