"""Ending a run on purpose: its steps are kept, and whoever asked for it knows it again by its class."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from hfsim.errors import LimitReached

Progress = Callable[[float], None]
"""Told the share of the duration that is done, 0 to 1, at every step; may raise to end the run."""


class Halted(LimitReached):
    """A watcher ended the run; ``share`` of the duration was done by then."""

    def __init__(self, reason: str, share: float = 0.0) -> None:
        super().__init__(reason)
        self.share = share


class TimeUp(Halted):
    """The time allowed was used up."""


@dataclass
class Budget:
    """Time that work may take [s].

    Attributes
    ----------
    seconds : float
    clock : callable
        Returns a time [s]: wall time, or CPU time, or that of a test.
    start : float
        Reading of `clock` from which the budget counts.
    report : callable
        Told the used share, 0 to 1, at every step.
    """

    seconds: float
    clock: Callable[[], float] = time.perf_counter
    start: float = -1.0
    report: Progress = lambda share: None

    def __post_init__(self) -> None:
        if self.start < 0.0:
            self.start = self.clock()

    @property
    def used(self) -> float:
        """Time used so far [s]."""
        return self.clock() - self.start

    @property
    def left(self) -> float:
        """Time left [s]; negative when overdrawn."""
        return self.seconds - self.used

    def guard(self, allowed: float | None = None) -> Progress:
        """Return what ends a run after ``allowed`` seconds from now, or when the budget is used up."""
        end = self.used + allowed if allowed is not None else self.seconds

        def check(share: float) -> None:
            used = self.used
            self.report(min(1.0, used / self.seconds) if self.seconds > 0.0 else 1.0)
            if used > end:
                raise TimeUp(f"cut off at {100 * share:.2g} % of the duration", share)

        return check
