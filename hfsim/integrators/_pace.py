"""Whether a run gets on: what ends it where its steps crawl."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hfsim.errors import SolverFailure
from hfsim.integrators._memory import Remembering, part_of

WINDOWS = ((100, 1e10), (1000, 1e7))
"""Attempted steps after which the pace is looked at, and those still to come, at the pace of two windows,
from which a run ends."""
IN_A_ROW = 3
"""Unsolved steps one after another from which it is looked whether something is not finite."""
GAINING = 1.2
"""Progress over that of the window before from which steps are growing, and the run is left alone."""


@dataclass(eq=False)
class _Window(Remembering):
    """What is known since some attempts ago."""

    attempts: int
    hopeless: float
    t: float
    rejected: int = 0
    before: float = -np.inf
    """Progress of the window before, if that was hopeless too."""
    remembers = ("t", "rejected", "before")

    def look(self, t: float, t_end: float, rejected: int) -> None:
        """Begin another window at t, by when some of all steps were rejected.

        Raises
        ------
        SolverFailure
            If the run crawls.
        """
        progress, share = t - self.t, (rejected - self.rejected) / self.attempts
        self.t, self.rejected = t, rejected
        left = (t_end - t) / progress * self.attempts if progress > 0.0 else np.inf
        if left <= self.hopeless:
            self.before = -np.inf
        elif progress > GAINING * self.before:
            self.before = progress
        else:
            raise SolverFailure(
                f"the steps crawl: the last {self.attempts} of them, {100.0 * share:.0f} % rejected, gained "
                f"{progress:.2g} s; at this pace more than {self.hopeless:.0e} would follow",
                t,
                evidence={"progress": progress, "rejected_share": share},
            )


@dataclass(eq=False)
class Pace(Remembering):
    """Ends a run that crawls: two windows in a row at whose pace the end is out of reach.

    Steps that are short at first and grow, as in a stiff start, gain in each window and are left alone.
    """

    t: float
    t_end: float
    attempts: int = 0
    rejected: int = 0
    unsolved: int = 0
    windows: list[_Window] = field(init=False)
    remembers = ("attempts", "rejected", "unsolved")

    def __post_init__(self) -> None:
        self.windows = [_Window(*one, self.t) for one in WINDOWS]
        self._looked()

    @property
    def doubtful(self) -> bool:
        """Whether it is time to look for what is not finite, as long as a step takes: ever more seldom."""
        rows, more = divmod(self.unsolved, IN_A_ROW)
        return not more and rows.bit_count() == 1

    def note(self, t: float, rejected: bool, unsolved: bool) -> None:
        """Count one attempt that ended at t.

        Raises
        ------
        SolverFailure
            If the run crawls.
        """
        self.attempts += 1
        self.rejected += rejected
        self.unsolved = self.unsolved + 1 if unsolved else 0
        if self.attempts == self._due:
            for window in self.windows:
                if not self.attempts % window.attempts:
                    window.look(t, self.t_end, self.rejected)
            self._looked()

    def _looked(self) -> None:
        """Take note of what the windows know, and of the attempts after which one is looked at next."""
        self._seen = self._of_windows()
        self._due = min((self.attempts // one.attempts + 1) * one.attempts for one in self.windows)

    def memory(self) -> dict[str, Any]:
        """Return the counts, and what each window knows."""
        return super().memory() | self._seen

    def _of_windows(self) -> dict[str, Any]:
        return {
            f"{k}.{name}": value for k, one in enumerate(self.windows) for name, value in one.memory().items()
        }

    def recall(self, memory: Mapping[str, Any]) -> None:
        """Go on as the one did whose memory this is."""
        super().recall(memory)
        for k, window in enumerate(self.windows):
            window.recall(part_of(memory, str(k)))
        self._looked()
