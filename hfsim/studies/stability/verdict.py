"""What one run is worth: held against references and put into a class.

Two errors are told apart.  The *time error* is the distance to the same model solved by Gauss
collocation at a tight tolerance: what the method and its step do.  The *model error* is the distance of
that solution to the one of `exact`: what the model leaves out.  Both are the largest over time in the
worst channel, relative to the channel's scale (`hfsim.marching.distance`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from hfsim.marching.alike import alike
from hfsim.marching.distance import ChannelScale, farthest, gap
from hfsim.marching.solution import Channel
from hfsim.maths.arrays import Array

CLASSES = {
    "accurate": "completed; errors and energy drift within the bounds",
    "wrong": "completed, but an error or the energy drift is beyond its bound",
    "numerical": "failed, and the same model goes through with gauss at a tight tolerance",
    "model": "the model failed, and exact goes through",
    "physical": "the scene itself fails or is unstable: a tiny disturbance grows, whatever method and model",
    "deck": "the numbers or joints of the deck make it: refused, not finite, redundant, without mass",
    "no result": "no answer: time limit, crash or no reference",
    "not computed": "not reached: the budget was used up, or a signal ended the study",
}
"""Classes of points, in words."""

TRUTH_MODEL = "exact"
"""Model that counts as the truth."""
REFUSED = "the deck is refused: "
_CAUSES = ("numerical", "model", "physical", "deck")


@dataclass(frozen=True)
class Bounds:
    """What still counts as accurate.

    Attributes
    ----------
    error : float
        Largest time error and largest model error [-].
    drift : float
        Largest energy drift [-].
    """

    error: float = 1e-2
    drift: float = 1e-3


@dataclass(frozen=True)
class Ending:
    """How a run ended.

    Attributes
    ----------
    status : str
        ``done``, ``failed``, ``limit`` or ``lost`` (time limit, crash, refused deck); empty without a run.
    kind, item, reason : str
        Class, deck path and words of a failure or of what makes the run suspicious or the scene unstable. No
        class where experiments have not decided.
    end : float
        Where it ended [s].
    """

    status: str = ""
    kind: str = ""
    reason: str = ""
    end: float = 0.0
    item: str = ""


@dataclass(frozen=True)
class Truth(Ending):
    """A reference, or why there is none.

    Attributes
    ----------
    growth : float or None
        Factor by which a tiny disturbance grows while the time doubles, at most; None if not asked for.
    """

    channels: tuple[Channel, ...] = ()
    scales: tuple[ChannelScale, ...] = ()
    growth: float | None = None


@dataclass(frozen=True)
class Trial(Ending):
    """What came of one point before it is put into a class.

    Attributes
    ----------
    error : float or None
        Time error [-], with `channel`, the worst one.
    drift : float or None
        Energy drift [-].
    cpu : float
        CPU time of the integration [s].
    times : ndarray or None
        The output and its times [s].
    """

    error: float | None = None
    channel: str = ""
    drift: float | None = None
    steps: int = 0
    cpu: float = 0.0
    channels: tuple[Channel, ...] = field(default=(), repr=False)
    times: Array | None = field(default=None, repr=False)


NO_TRIAL = Trial()
"""Where nothing was run."""


@dataclass(frozen=True)
class Verdict:
    """The class of a point and what it rests on.

    Attributes
    ----------
    outcome : str
        A key of `CLASSES`.
    cause : str
        ``numerical``, ``model``, ``physical`` or ``deck``: what makes a point not accurate, or one that is
        suspicious; else empty.
    item : str
        Deck path of what is to blame, where that is known.
    time_error, model_error, energy_drift, growth : float or None
        Measured values [-]; None where there is none.
    channel : str
        The channel with the larger of the two errors.
    """

    outcome: str
    reason: str = ""
    cause: str = ""
    item: str = ""
    time_error: float | None = None
    model_error: float | None = None
    energy_drift: float | None = None
    growth: float | None = None
    channel: str = ""


def distance(
    channels: tuple[Channel, ...], truth: tuple[Channel, ...], scales: tuple[ChannelScale, ...]
) -> tuple[float | None, str]:
    """Return the largest relative difference of all judged channels, and in which; None without any."""
    true = {channel.name: channel.values for channel in truth}
    scale = {one.channel: one.scale for one in scales if one.judged}
    errors = {
        c.name: gap(c.values, true[c.name]).largest / scale[c.name]
        for c in alike(channels, truth)
        if c.name in scale and len(true[c.name]) == len(c.values)
    }
    worst, error = farthest(errors)
    return error, worst


def classify(trial: Trial, truth: Truth, exact: Truth, bounds: Bounds) -> Verdict:
    """Put a point into a class.

    Parameters
    ----------
    trial : Trial
        The point.
    truth : Truth
        The reference of its model.
    exact : Truth
        The reference of `exact` with the disturbed run.
    """
    if trial.status == "done":
        found = _completed(trial, truth, exact, bounds)
    elif trial.status == "failed":
        found = _failed(trial, truth, exact)
    else:
        found = Verdict("deck" if trial.reason.startswith(REFUSED) else "no result", trial.reason)
    return replace(found, cause=found.outcome) if found.outcome in _CAUSES else found


def _failed(trial: Trial, truth: Truth, exact: Truth) -> Verdict:
    at = trial.reason if " at t = " in trial.reason else f"{trial.reason} (t = {trial.end:.4g} s)"
    blamed: Ending = trial
    if trial.kind == "deck":
        outcome, reason = "deck", at
    elif truth.status == "done":
        outcome, reason = "numerical", f"{at}; gauss at a tight tolerance goes through"
    elif truth.status == "failed" and exact.status == "done":
        outcome, reason, blamed = "model", f"{truth.reason}; {TRUTH_MODEL} goes through", truth
    elif truth.status == exact.status == "failed":
        reason = f"{exact.reason}; {TRUTH_MODEL} at a tight tolerance fails as well"
        outcome, blamed = exact.kind or "numerical", exact
    elif trial.kind:
        outcome, reason = trial.kind, at
    else:
        outcome, reason, blamed = "no result", f"{at}; {_missing(truth, exact)}", Ending()
    return Verdict(outcome, reason, item=blamed.item, energy_drift=trial.drift, growth=exact.growth)


def _missing(truth: Truth, exact: Truth) -> str:
    lost = truth if truth.status == "lost" else exact
    return f"nothing to judge by: {lost.reason}"


def _completed(trial: Trial, truth: Truth, exact: Truth, bounds: Bounds) -> Verdict:
    if truth.status == "failed":
        where = f"the reference of this model ends at {truth.end:.4g} s: {truth.reason}"
        cause = "model" if exact.status == "done" else exact.kind
        facts: Mapping[str, Any] = {"energy_drift": trial.drift, "growth": exact.growth}
        return Verdict("wrong", where, cause, truth.item, **facts)
    model_error, channel = _model_error(truth, exact)
    facts = {
        "time_error": trial.error,
        "model_error": model_error,
        "energy_drift": trial.drift,
        "growth": exact.growth,
        "channel": trial.channel if (trial.error or 0.0) >= (model_error or 0.0) else channel,
    }
    if truth.status == "lost" or exact.status == "lost":
        return Verdict("no result", _missing(truth, exact), **facts)
    beyond = _beyond(trial, model_error, bounds)
    unstable = next((one for one in (exact, trial) if one.kind == "physical"), None)
    if unstable is not None and (trial.drift or 0.0) <= bounds.drift:
        why = f"{unstable.reason}{'; ' + beyond if beyond else ''}"
        return Verdict("physical", why, item=unstable.item, **facts)
    if not beyond:
        return Verdict("accurate", trial.reason, trial.kind, trial.item, **facts)
    # with a time error within its bound, the model itself leaves the truth or loses energy
    numerical = model_error == 0.0 or (trial.error or 0.0) > bounds.error
    return Verdict("wrong", beyond, "numerical" if numerical else "model", trial.item, **facts)


def _model_error(truth: Truth, exact: Truth) -> tuple[float | None, str]:
    if truth is exact:
        return 0.0, ""
    if truth.status != "done" or exact.status != "done":
        return None, ""
    return distance(truth.channels, exact.channels, exact.scales)


def _beyond(trial: Trial, model_error: float | None, bounds: Bounds) -> str:
    """Return which bounds are passed, in words."""
    found = (
        ("model error", model_error, bounds.error),
        ("time error", trial.error, bounds.error),
        ("energy drift", trial.drift, bounds.drift),
    )
    return ", ".join(f"{what} {x:.2g}" for what, x, most in found if x is not None and x > most)
