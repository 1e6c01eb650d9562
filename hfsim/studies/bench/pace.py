"""How long a solve would take that was cut off: as in its last steps, not as in its first ones.

A solve begins by making its matrices and with its shortest steps.  What it has taken by then over the share
that is done forecasts a hundred times what it takes.
"""

from __future__ import annotations

from typing import NamedTuple

from hfsim.marching.stop import Budget, Progress, TimeUp

_LEAST = 1.5
"""What a solve is taken to need at the least, over the time after which it was cut off."""
_STEADY = 0.5
"""Forecast by the last steps over that by those before, below which a solve still quickens."""
_SLOWEST = 1e-6
"""Share that is taken to be done in all the time, so that nothing is divided by zero."""


class Forecast(NamedTuple):
    """What a solve that was cut off would have taken.

    Attributes
    ----------
    seconds : float
        Going on as in its last steps [s].
    steady : bool
        Whether its pace held, so that more of it would hardly tell otherwise.
    """

    seconds: float
    steady: bool


class Pace:
    """Guards a solve and notes how far it has come, at the steps 1, 2, 4, 8 and so on.

    Parameters
    ----------
    budget : Budget
        Whose clock counts.
    allowed : float
        Time after which the solve ends [s].
    """

    def __init__(self, budget: Budget, allowed: float) -> None:
        self._guard: Progress = budget.guard(allowed)
        self._budget, self._start = budget, budget.used
        self._calls = 0
        self._marks = [(0.0, 0.0), (0.0, 0.0)]

    def __call__(self, share: float) -> None:
        """Take note of the share that is done; raise `TimeUp` if the time is."""
        self._calls += 1
        if not self._calls & (self._calls - 1):
            self._marks.append((self._budget.used - self._start, share))
        self._guard(share)

    def forecast(self, stop: TimeUp, spent: float) -> Forecast:
        """Return what the solve would have taken that ended so after some time [s]."""
        before, now = self._marks[-2], (spent, stop.share)
        last, first = _whole(before, now), _whole(self._marks[0], before)
        ahead = spent + (1.0 - stop.share) * last
        return Forecast(max(ahead, _LEAST * spent), last >= _STEADY * first > 0.0)


def _whole(one: tuple[float, float], other: tuple[float, float]) -> float:
    """Return the time of a whole at the pace between two marks, each a time [s] and the share done."""
    return (other[0] - one[0]) / max(other[1] - one[1], _SLOWEST)
