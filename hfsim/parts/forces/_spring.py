"""What the springs have in common."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from hfsim.deck.complaints import Complaint
from hfsim.mechanics.resistances import LinearSpring, Resistance, Wound
from hfsim.mechanics.tabled import TableSpring
from hfsim.parts.specs import SpringSpec

if TYPE_CHECKING:
    from hfsim.deck.laws import Law

_FORCES = ("stiffness", "damping", "damping_table", "friction", "stops", "latch", "preload")
"""Keys that give a force where they are not zero."""


class CoordinateSpringSpec(SpringSpec):
    """A spring on one coordinate, with what else resists that."""

    stiffness: Any
    damping: Any
    damping_table: Any
    friction: Any
    stops: Any
    latch: Any
    preload: Any
    table: Any

    if TYPE_CHECKING:  # as what resists in joints has them
        others: Any
        tabled: Any
        undamped: Any

    def complaints(self) -> Iterator[Complaint]:
        """Yield a spring that says nothing of its force, or says it twice."""
        if not {*_FORCES, "table"} & self.model_fields_set:
            hint = "or give a table, damping, friction, stops, a latch or a preload"
            yield Complaint(("stiffness",), "missing key", hint, True)
        for key in ("stiffness", "preload"):
            if self.table is not None and getattr(self, key):  # zeros stand in resolved decks
                yield Complaint((key,), "the table says this already", "leave one of them out", True)

    @property
    def acts(self) -> bool:
        """Whether it ever exerts a force."""
        return self.table is not None or any(getattr(self, key) for key in _FORCES)

    def from_rest(self, rest: float | Law) -> tuple[Resistance, ...]:
        """Return all that resists a coordinate that is without force at a value, or at one that moves."""
        if isinstance(rest, float):
            return (*self._springs(rest), *self.others)
        wound = LinearSpring(self.stiffness, self.damping, 0.0, self.preload), *self.tabled
        return (*(Wound(one, rest) for one in wound), *self.undamped)

    def _springs(self, rest: float) -> Iterator[Resistance]:
        if self.table is not None:
            yield TableSpring.through(self.table, rest)
        if self.table is None or self.damping:
            yield LinearSpring(self.stiffness, self.damping, rest, self.preload)
