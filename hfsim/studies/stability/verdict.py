"""What one run is worth: held against references and put into a class.

Two errors are told apart.  The *time error* is the distance to the same model solved by Gauss
collocation at a tight tolerance: what the method and its step do.  The *model error* is the distance of
that solution to the one of `exact`: what the model leaves out.  Both are the largest over time in the
worst channel, relative to the channel's scale (`hfsim.marching.distance`).

A reference has errors of its own.  One that nothing has borne out may be as far off as a point is from it;
once a second solution has been made, it is as far off as the two differ.  A point whose error may be on
either side of a bound is not called wrong: it is unsure.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

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
    "no result": "no answer: time limit, crash, no reference, or none that is known well enough",
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
    floors : dict of str to float or None
        How far a second solution is from it by channel, over its scales [-]; None before there is one.
    how : str
        How it was solved, or both were.
    doubt : str
        Why there is no second solution, where one was tried.
    """

    channels: tuple[Channel, ...] = ()
    scales: tuple[ChannelScale, ...] = ()
    growth: float | None = None
    floors: dict[str, float] | None = field(default=None, repr=False)
    how: str = ""
    doubt: str = ""

    @property
    def checked(self) -> bool:
        """Whether a second solution has been tried."""
        return self.floors is not None or bool(self.doubt)

    @property
    def floor(self) -> float | None:
        """How far the two solutions differ in the worst channel that counts [-]; None without a second."""
        if self.floors is None:
            return None
        return max((self.floors[one.channel] for one in self.scales if one.judged), default=0.0)

    @property
    def words(self) -> str:
        """How well it is known."""
        known = f"itself known to {self.floor:.2g}" if self.floors is not None else "that no second bears out"
        return f"{known} ({self.doubt or self.how})" if self.checked else known

    def own_error(self, channel: str, scale: float) -> float | None:
        """Return how far off it may be in a channel, over a scale [-]; None where that is not known."""
        if self.floors is None:
            return None
        own = next(one.scale for one in self.scales if one.channel == channel)
        return self.floors[channel] * own / scale


class Distance(NamedTuple):
    """How far a solution is from a reference.

    Attributes
    ----------
    error : float or None
        Largest relative difference of all judged channels [-]; None without any.
    channel : str
        Where that is.
    within : (float, float)
        Least and most that it is, by what is known of the reference [-].
    """

    error: float | None = None
    channel: str = ""
    within: tuple[float, float] = (0.0, 0.0)


_NOWHERE = Distance()


@dataclass(frozen=True)
class Trial(Ending):
    """What came of one point before it is put into a class.

    Attributes
    ----------
    distance : Distance
        From the reference of its model: the time error.
    drift : float or None
        Energy drift [-].
    cpu : float
        CPU time of the integration [s].
    times : ndarray or None
        The output and its times [s].
    """

    distance: Distance = _NOWHERE
    drift: float | None = None
    steps: int = 0
    cpu: float = 0.0
    channels: tuple[Channel, ...] = field(default=(), repr=False)
    times: Array | None = field(default=None, repr=False)

    def against(self, truth: Truth) -> Trial:
        """Return it with its distance from a reference, if both reached the end."""
        if self.status != "done" or truth.status != "done":
            return self
        return replace(self, distance=distance(self.channels, truth))


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
    reference_floor : float or None
        How well the references are known that decided, in their worst channel [-]; None where nothing depends
        on it, and they were not solved twice.
    time_within : (float, float)
        Least and most that the time error is, by what is known of the reference [-].
    unsure : tuple of str
        Errors of which the references do not tell on which side of the bound they are: ``time``, ``model``.
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
    reference_floor: float | None = None
    time_within: tuple[float, float] = (0.0, 0.0)
    unsure: tuple[str, ...] = ()

    def references(self, model: str) -> tuple[str, ...]:
        """Return whose references decide what is unsure of a point of a model."""
        return tuple({model, TRUTH_MODEL} if "model" in self.unsure else {model} if self.unsure else ())


def distance(channels: tuple[Channel, ...], truth: Truth, own: Truth | None = None) -> Distance:
    """Return how far channels are from a reference, both up to as much as they are off themselves.

    Parameters
    ----------
    own : Truth, optional
        What the channels are of, where they are a reference too; without it they are what they are.
    """
    true = {channel.name: channel.values for channel in truth.channels}
    scale = {one.channel: one.scale for one in truth.scales if one.judged}
    errors = {
        c.name: gap(c.values, true[c.name]).largest / scale[c.name]
        for c in alike(channels, truth.channels)
        if c.name in scale and len(true[c.name]) == len(c.values)
    }
    worst, error = farthest(errors)
    least = most = 0.0
    for name, found in errors.items():
        known = [one.own_error(name, scale[name]) for one in (truth, own) if one is not None]
        off = found if None in known else sum(filter(None, known))
        least, most = max(least, found - off), max(most, found + off)
    return Distance(error, worst, (least, most))


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
    model, floors = _model_distance(truth, exact), (truth.floor, exact.floor)
    errors = {"time": trial.distance, "model": model}
    unsure = tuple(what for what, one in errors.items() if one.within[0] <= bounds.error < one.within[1])
    nearer = (trial.distance.error or 0.0) >= (model.error or 0.0)
    facts = {
        "unsure": unsure,
        "time_error": trial.distance.error,
        "model_error": model.error,
        "energy_drift": trial.drift,
        "growth": exact.growth,
        "channel": (trial.distance if nearer else model).channel,
        "time_within": trial.distance.within,
        "reference_floor": max((one for one in floors if one is not None), default=None),
    }
    if truth.status == "lost" or exact.status == "lost":
        return Verdict("no result", _missing(truth, exact), **facts)
    beyond = _beyond(trial, errors, bounds)
    unstable = next((one for one in (exact, trial) if one.kind == "physical"), None)
    if unstable is not None and (trial.drift or 0.0) <= bounds.drift:
        why = f"{unstable.reason}{'; ' + beyond if beyond else ''}"
        return Verdict("physical", why, item=unstable.item, **facts)
    if unsure and not beyond:
        return Verdict("no result", _unsure(unsure, errors, truth, exact), **facts)
    if not beyond:
        return Verdict("accurate", trial.reason, trial.kind, trial.item, **facts)
    # with a time error within its bound, the model itself leaves the truth or loses energy
    numerical = model.error == 0.0 or (trial.distance.error or 0.0) > bounds.error
    return Verdict("wrong", beyond, "numerical" if numerical else "model", trial.item, **facts)


def _unsure(unsure: tuple[str, ...], errors: Mapping[str, Distance], truth: Truth, exact: Truth) -> str:
    """Return what the references do not decide, and how well they are known."""
    found = ", ".join(f"{what} error {errors[what].error:.2g}" for what in unsure)
    references = {one.words for one in ((truth, exact) if "model" in unsure else (truth,))}
    return f"{found} against a reference {', or one '.join(sorted(references))}"


def _model_distance(truth: Truth, exact: Truth) -> Distance:
    if truth is exact:
        return Distance(0.0)
    if truth.status != "done" or exact.status != "done":
        return _NOWHERE
    return distance(truth.channels, exact, truth)


def _beyond(trial: Trial, errors: Mapping[str, Distance], bounds: Bounds) -> str:
    """Return which bounds are passed for sure, in words."""
    found = [
        (f"{what} error", errors[what].error)
        for what in ("model", "time")
        if errors[what].within[0] > bounds.error
    ]
    if trial.drift is not None and trial.drift > bounds.drift:
        found.append(("energy drift", trial.drift))
    return ", ".join(f"{what} {value:.2g}" for what, value in found)
