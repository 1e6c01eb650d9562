"""How far one channel of a model is from the reference, and how much of that is not error in time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hfsim.marching.distance import ChannelScale, gap
from hfsim.marching.solution import Run


@dataclass(frozen=True)
class Difference:
    """One channel of one model against the reference, over the time both have reached.

    Attributes
    ----------
    channel, unit : str
        Name and SI unit.
    max_abs, rms : float
        Largest and root-mean-square difference, in `unit`.
    max_relative : float
        `max_abs` divided by the channel's scale [-].
    time_of_max : float
        When the difference is largest [s].
    first_exceeded : float or None
        When it first passes the bound beyond the errors in time [s]; None if never.
    time_error : float or None
        Errors in time of model and reference together, in `unit`; None where they were not measured.
    time_error_relative : float or None
        The same over the channel's scale [-].
    beyond : float
        What is left of `max_relative` without them: the part that is the model's for sure [-].
    equal : bool
        Whether nothing is left: the models are equal as far as the errors in time tell.
    """

    channel: str
    unit: str
    max_abs: float
    max_relative: float
    rms: float
    time_of_max: float
    first_exceeded: float | None
    time_error: float | None = None
    time_error_relative: float | None = None
    beyond: float = 0.0
    equal: bool = False


def difference(
    run: Run, reference: Run, scale: ChannelScale, max_error: float, time_error: float | None = None
) -> Difference | None:
    """Return how far one channel of `run` is from the reference.

    Parameters
    ----------
    run, reference : Run
        Runs of the same scene; `run` may have ended early.
    scale : ChannelScale
        The channel and what to divide by.
    max_error : float
        Bound on the relative difference [-].
    time_error : float, optional
        Errors in time of both together, in the unit of the channel.

    Returns
    -------
    Difference or None
        None when `run` lacks the channel or shares no time with the reference. Between its own
        output times `run` is interpolated linearly; on a shared output grid nothing is.
    """
    own = {channel.name: channel.values for channel in run.channels}.get(scale.channel)
    times = common_times(run, reference)
    if own is None or not len(times):
        return None
    other = {channel.name: channel.values for channel in reference.channels}[scale.channel]
    mine, other = np.interp(times, run.t, own), other[: len(times)]
    found, in_time = gap(mine, other), time_error or 0.0
    passed = (np.abs(mine - other) - in_time > max_error * scale.scale) & scale.judged
    return Difference(
        channel=scale.channel,
        unit=scale.unit,
        max_abs=found.largest,
        max_relative=found.largest / scale.scale,
        rms=found.rms,
        time_of_max=float(times[found.at]),
        first_exceeded=float(times[passed.argmax()]) if passed.any() else None,
        time_error=time_error,
        time_error_relative=None if time_error is None else time_error / scale.scale,
        beyond=max(0.0, found.largest - in_time) / scale.scale,
        equal=time_error is not None and found.largest <= time_error,
    )


def common_times(run: Run, reference: Run) -> np.ndarray:
    """Return the output times of the reference that `run` reached too, shape (n,) [s]."""
    if not len(run.t) or not len(reference.t):
        return np.empty(0)
    slack = 1e-9 * float(reference.t[-1] - reference.t[0])
    times: np.ndarray = reference.t[reference.t <= run.t[-1] + slack]
    return times
