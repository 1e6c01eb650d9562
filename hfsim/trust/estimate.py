"""What is said of an error, and what every estimate of one needs: a run again, and its distance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from hfsim.errors import HfsimError
from hfsim.marching.distance import channel_errors, error_scales, farthest, scene_sizes
from hfsim.marching.integration import Integration, Leg
from hfsim.marching.record import Record
from hfsim.marching.solution import Channel
from hfsim.marching.stop import Budget, BudgetUsedError, TimeUp

USED_UP, LARGER = "the budget of the run was used up", "allow more with --budget"


class Estimate(NamedTuple):
    """An error, or why it is not known.

    Attributes
    ----------
    error : float or None
        Largest over time in the worst channel, relative to its range [-].
    reason : str
        Why there is none, or why it is zero.
    channel : str
        The worst one.
    by : str
        How it was estimated.
    each : mapping of str to float
        Error of each channel, in its unit.
    until : float or None
        Time up to which something was compared, where that is not all [s].
    instead : str
        What the error is relative to where the range of the channel is too small to judge by.
    """

    error: float | None
    reason: str = ""
    channel: str = ""
    by: str = ""
    each: Mapping[str, float] = {}
    until: float | None = None
    instead: str = ""

    def facts(self, name: str) -> dict[str, Any]:
        """Return what summaries say of it, by keys that begin with a name such as ``error``."""
        facts: dict[str, Any] = {"estimate": self.error, "estimate_reason": self.reason}
        facts |= {"estimate_channel": self.channel}
        facts |= {"estimate_by": self.by, "by_channel": dict(self.each)} if self.error is not None else {}
        facts |= {"estimate_until": self.until} if self.until is not None else {}
        facts |= {"estimate_relative_to": self.instead} if self.instead else {}
        return {f"{name}_{key}": value for key, value in facts.items()}


class Compared(NamedTuple):
    """The run whose error is asked for.

    Attributes
    ----------
    channels : tuple of Channel
        Its whole output.
    """

    legs: Sequence[Leg]
    channels: tuple[Channel, ...]

    @property
    def end(self) -> float:
        """Time that the run has reached [s]."""
        return self.legs[-1].done.trajectory.t_end

    def distance(self, again: Record, part: float = 1.0) -> Estimate:
        """Return a part of the distance from a second run, which may have ended earlier, as the error."""
        times = again.table()[:, 0]
        if len(times) < 2:
            return Estimate(None, "fewer than two rows of output: nothing to compare")
        with np.errstate(all="ignore"):
            other, sizes = again.channels(), scene_sizes(self.legs[0].scene)
            absolute, relative = channel_errors(self.channels, other, sizes)
            scales = {one.channel: one for one in error_scales(self.channels, other, sizes)}
        worst, error = farthest(relative)
        if error is None:
            return Estimate(None, "no channel of the output has a range to be judged by")
        if not all(map(math.isfinite, (*absolute.values(), *relative.values()))):
            return Estimate(None, "the second run is not finite")
        until = float(times[-1]) if len(times) < len(self.channels[0].values) else None
        each = {name: part * value for name, value in absolute.items()}
        scale = scales[worst]
        instead = f"{scale.scale:.2g} {scale.unit}" if scale.small else ""
        return Estimate(part * error, "", worst, "", each, until, instead)


def why_not(done: Integration, words: str, seconds: float) -> str:
    """Return why a second run is of no use; empty if it reached its end.

    Parameters
    ----------
    words : str
        What is different in it.
    seconds : float
        CPU time of the first run [s].

    Raises
    ------
    KeyboardInterrupt
        If that ended it.
    """
    stop = done.stop
    if isinstance(stop, KeyboardInterrupt):
        raise stop
    if isinstance(stop, BudgetUsedError):
        return f"{USED_UP} in a second run with {words}; {LARGER}"
    if isinstance(stop, TimeUp):
        return f"a second run with {words} was {stop}, as its time was up; {_longer(seconds)}"
    if isinstance(stop, HfsimError):
        return f"a second run with {words} stopped at {done.trajectory.t_end:.4g} s: {stop}"
    return ""


def advice(seconds: float, budget: Budget) -> str:
    """Return which option would allow second runs more time than a run has taken [s]."""
    if budget.spent:
        return f"{USED_UP}; {LARGER}"
    return _longer(seconds)


def no_time(words: str, seconds: float, budget: Budget) -> str:
    """Return why a second run, with some words on it, is not even begun."""
    if budget.spent:
        return f"{USED_UP} before {words} could tell the error; {LARGER}"
    return f"no time for {words}; {_longer(seconds)}"


def _longer(seconds: float) -> str:
    return f"allow more with --after {max(2, math.ceil(4.0 * seconds))}s"
