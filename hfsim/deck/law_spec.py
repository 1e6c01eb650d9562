"""What all laws of time that decks may state have in common."""

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from hfsim.deck.complaints import Complaint, degrees_as_radians
from hfsim.deck.laws import Law, ShiftedLaw
from hfsim.deck.spec import Around, Spec

_STILL = 1e-9
"""Rate, over one more than the acceleration, that counts as none."""
_TIMES = 2000
"""Times of a run, and of an oscillation, at which a law is looked at."""
_ROUNDING = 1e-9
"""Value below zero, over the largest, that counts as none."""


class LawSpec(Spec):
    """Base of all laws a deck may state."""

    type: str
    """Kind of law."""

    value_keys: ClassVar[tuple[str, ...]] = ()
    """Keys that measure what the law drives."""

    rate_keys: ClassVar[tuple[str, ...]] = ()
    """Keys that measure its rate."""

    begin_key: ClassVar[str] = "start"
    """Key that says when it begins."""

    @property
    def constant(self) -> float | None:
        """Its value where that never changes."""
        return None

    @property
    def kink(self) -> str:
        """Where its rate jumps, so that it cannot drive a body; empty where it never does."""
        if not self.begin:
            return ""
        law = self.unshifted()
        least = _STILL * (1.0 + abs(float(law.acceleration(0.0))))
        return f" at {self.begin:g} s, where the law begins" if abs(float(law.rate(0.0))) > least else ""

    @property
    def begin(self) -> float:
        """Time at which it begins [s]: before, it holds its value at 0."""
        return getattr(self, "start", None) or 0.0

    def slips_in(self, around: Around) -> Iterator[Complaint]:
        """Yield a law that begins when the run is over."""
        if around.duration is not None and self.begin >= around.duration:
            message = f"begins at {self.begin:g} s, when the run of {around.duration:g} s is over"
            yield Complaint((self.begin_key,), message, f"'{self.begin:g} ms'?")

    def turns_in_degrees(self) -> Iterator[Complaint]:
        """Yield values that look like degrees where the law drives an angle."""
        for key, name in self.fields_by_key().items():
            if key in self.value_keys:
                yield from degrees_as_radians(key, getattr(self, name))

    def trouble(self, duration: float) -> str:
        """Return why it cannot drive a body for so long, though its rate does not jump."""
        return ""

    def below_zero(self, around: Around) -> str:
        """Return how far it is below zero where it is most, and when; empty if it never is in the run."""
        if around.duration is None or any(self.complaints_in(around)):
            return ""  # beyond its end a table has no values
        law, end = self.build(), around.duration
        spans = np.array([end, min(end, law.period(0.0, end, end))])
        breaks = np.clip(law.breaks(0, end), 0.0, end)
        times = np.concatenate([np.linspace(0.0, spans, _TIMES).ravel(), breaks])
        values = law.value(times)
        worst = int(values.argmin())
        below = values[worst] < -_ROUNDING * np.abs(values).max()
        return f"is {values[worst]:.3g} at {times[worst]:.4g} s" if below else ""

    def build(self) -> Law:
        """Return the law."""
        return ShiftedLaw(self.unshifted(), self.begin) if self.begin else self.unshifted()

    def unshifted(self) -> Law:
        """Return the law as if it began at 0."""
        raise NotImplementedError
