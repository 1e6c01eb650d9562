"""Whether a run gets on: what ends it where its steps crawl."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hfsim.errors import SolverFailure
from hfsim.integrators._memory import Remembering

WINDOW = 1000
"""Attempted steps after which the pace is looked at."""
HOPELESS = 1e7
"""Attempted steps still to come, at the pace of two windows, from which a run ends."""
GAINING = 1.2
"""Progress over that of the window before from which steps are growing, and the run is left alone."""


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
    before: float = -np.inf
    """Progress of the window before, if that was hopeless too."""
    remembers = ("t", "attempts", "rejected", "unsolved", "before")

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
        if self.attempts % WINDOW:
            return
        progress, self.t = t - self.t, t
        share, self.rejected = self.rejected / WINDOW, 0
        left = (self.t_end - t) / progress * WINDOW if progress > 0.0 else np.inf
        if left <= HOPELESS:
            self.before = -np.inf
        elif progress > GAINING * self.before:
            self.before = progress
        else:
            raise _crawl(t, progress, share)


def _crawl(t: float, progress: float, rejected: float) -> SolverFailure:
    return SolverFailure(
        f"the steps crawl: the last {WINDOW} of them, {100.0 * rejected:.0f} % rejected, gained "
        f"{progress:.2g} s; at this pace more than {HOPELESS:.0e} would follow",
        t,
        evidence={"progress": progress, "rejected_share": rejected},
    )
