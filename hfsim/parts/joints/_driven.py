"""What joints have in common that follow laws of time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from hfsim.deck.complaints import Complaint
from hfsim.deck.spec import Around
from hfsim.parts.specs import JointSpec


class DrivenSpec(JointSpec):
    """Base of joints of which some fields are laws of time."""

    led: ClassVar[tuple[str, ...]] = ()
    """These fields."""

    @property
    def laws(self) -> Iterator[tuple[str, Any]]:
        """Yield those that are stated, with their keys."""
        return ((key, law) for key in self.led if (law := getattr(self, key)) is not None)

    def complaints(self) -> Iterator[Complaint]:
        """Yield laws that no body can follow."""
        for key, law in self.laws:
            if where := law.kink:
                smooth = getattr(law, "interpolation", "") == "cubic"
                table = "" if smooth else ", a table with interpolation: cubic,"
                hint = f"smooth_step{table} or what begins with rate zero"
                yield Complaint((key,), f"its rate jumps{where}, and no body's can", hint)

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield a law whose rate or acceleration is not finite somewhere."""
        yield from super().complaints_in(around)
        for key, law in self.laws:
            if around.duration is not None and (why := law.trouble(around.duration)):
                yield Complaint((key,), why)
