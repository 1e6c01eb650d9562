"""Ending a run on purpose: its steps are kept, and whoever asked for it knows it again by its class."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from hfsim.errors import LimitReached
from hfsim.maths.frozen import frozen, mutable

Progress = Callable[[float], None]
"""Told the share of the duration that is done, 0 to 1, at every step; may raise to end the run."""


def nobody(told: object) -> None:
    """Take what nobody has asked for, such as a share that is done."""


class Halted(LimitReached):
    """A watcher ended the run; ``share`` of the duration was done by then."""

    def __init__(self, reason: str, share: float = 0.0) -> None:
        super().__init__(reason)
        self.share = share


class TimeUp(Halted):
    """The time allowed was used up."""


class BudgetUsedError(TimeUp):
    """The budget of a run [s] was used up."""

    def __init__(self, seconds: float, share: float = 0.0) -> None:
        super().__init__(f"the budget of {seconds:g} s was used up at {_done(share)} of the duration", share)
        self.seconds = seconds


class Shield:
    """Holds interruptions back while something is done that must not be left half done."""

    def __init__(self) -> None:
        self.taken: KeyboardInterrupt | None = None
        """The interruption that has come, if any: what goes wrong after it is no mistake."""
        self.process = 0
        """A worker process that takes signals itself; others that inherit this end at once."""
        self._depth = 0
        self._held: KeyboardInterrupt | None = None

    def take_over(self, process: int) -> None:
        """Let a process forked off take signals itself; what its parent shields counts no more."""
        self.process, self._depth, self._held = process, 0, None

    def interrupt(self, by: KeyboardInterrupt) -> None:
        """Raise the interruption, or keep it until the last block that is shielded has ended."""
        self.taken = by
        if not self._depth:
            raise by
        self._held = by

    def __enter__(self) -> None:
        self._depth += 1

    def __exit__(self, *error: object) -> None:
        self._depth -= 1
        if not self._depth and self._held is not None:
            held, self._held = self._held, None
            raise held


SHIELD = Shield()
"""That of this process."""


@frozen
class Share:
    """Tells how much is done of some work that is a part of more; in another process, nobody.

    Attributes
    ----------
    report : callable
        Told the share of all.
    before, part : float
        Of all the work what comes before, and this.
    """

    report: Progress
    before: float
    part: float

    def __call__(self, share: float) -> None:
        """Tell the share of this that is done."""
        self.report(self.before + self.part * share)

    def __reduce__(self) -> tuple[Any, ...]:
        return Share, (nobody, 0.0, 0.0)


@mutable
class Budget:
    """Time that work may take [s].

    Attributes
    ----------
    clock : callable
        Returns a time [s]: wall time, or CPU time, or that of a test.
    start : float
        Reading of `clock` from which the budget counts.
    report : callable
        Told the used share, 0 to 1, at every step.
    spent : bool
        Whether the budget that this is a part of is used up.
    """

    seconds: float
    clock: Callable[[], float] = time.perf_counter
    start: float = -1.0
    report: Progress = nobody
    spent: bool = False

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
        return -math.inf if self.spent else self.seconds - self.used

    def guard(self, allowed: float | None = None) -> Progress:
        """Return what ends a run after ``allowed`` seconds from now, or when the budget is used up."""
        end = self.used + allowed if allowed is not None else self.seconds

        def check(share: float) -> None:
            used = self.used
            try:
                self.report(min(1.0, used / self.seconds) if self.seconds > 0.0 else 1.0)
            except BudgetUsedError:
                self.spent = True
                raise
            if used > end:
                raise TimeUp(f"cut off at {_done(share)} of the duration", share)

        return check

    def charge(self, seconds: float) -> None:
        """Count time that was used elsewhere."""
        self.start -= seconds
        self.report(min(1.0, self.used / self.seconds))

    def __reduce__(self) -> tuple[Any, ...]:
        return _going_on, (self.seconds, self.clock, self.used)

    def limiting(self, report: Progress) -> Progress:
        """Return what reports how far a run has come and ends it when the budget is used up."""

        def check(share: float) -> None:
            report(share)
            if self.left < 0.0:
                raise BudgetUsedError(self.seconds, share)

        return check


def _going_on(seconds: float, clock: Callable[[], float], used: float) -> Budget:
    """Return a budget of which some is used, as it is in another process; there it tells nobody."""
    budget = Budget(seconds, clock)
    budget.start -= used
    return budget


def _done(share: float) -> str:
    """Return a share that is less than all in per cent.

    Examples
    --------
    >>> _done(0.00513), _done(0.25), _done(0.9999)
    ('0.51 %', '25 %', '99.9 %')
    """
    return f"{min(100.0 * share, 99.9):.{3 if share > 0.99 else 2}g} %"
