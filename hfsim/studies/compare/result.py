"""What a comparison of models finds: differences and cost of each, and the verdict in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from hfsim.marching.distance import ChannelScale
from hfsim.marching.solution import Run
from hfsim.studies.compare.difference import Difference

REFUSED = "refused"
"""Status of a model with which the scene has no start."""
_ENDS = {"failed": "broke down", "limit": "reached a limit", "interrupted": "was interrupted"}


def ending(status: str, time: float) -> str:
    """Return how and when [s] a run or a model ended early."""
    return f"{_ENDS.get(status, 'stopped')} at {time:.3g} s"


def percent(fraction: float) -> str:
    """Return a fraction in per cent with two digits, however large or small.

    Examples
    --------
    >>> percent(0.000312), percent(83.0), percent(0.0), percent(1e-15), percent(5e-6)
    ('0.031 %', '8300 %', '0 %', '1e-13 %', '5e-4 %')
    """
    value = 100.0 * fraction
    if value == 0.0:
        return "0 %"
    if 1e-3 <= abs(value) < 1e5:
        return f"{float(f'{value:.2g}'):.10g} %"
    return f"{value:.0e} %".replace("e-0", "e-")


@dataclass(frozen=True)
class ModelResult:
    """One model in a comparison.

    Attributes
    ----------
    model, method, status, reason : str
        As in `Run`; or ``refused``, where the scene has no start with it.
    stop_time : float
        When its computation stopped [s].
    solve_cpu, solve_cpu_min, solve_cpu_max : float
        CPU time of the solve phase, median and extremes of the repeats [s].
    cpu_s : dict of str to float
        CPU time of each phase of its first run [s].
    repeats : int
        How often it was run for `solve_cpu`.
    differences : tuple of Difference
        One for each channel of the reference; empty when there is no common time.
    worst : Difference or None
        The judged one that is largest beyond the errors in time.
    adequate : bool
        Whether it and the reference reached the end, it stayed within the bound in every judged channel, of
        which there is one at least, and errors in time are within it too.
    validity : dict of str to dict
        By body, when and why the model left its range, as in ``summary.json``; empty for whole models.
    coordinates : str
        Those in which its steps are made, ``frame`` or ``absolute``; empty where not known.
    time_error : float or None
        Its own error in time in the worst judged channel over its scale; None where not measured [-].
    time_error_channel : str
        That channel.
    undecided : Difference or None
        The judged one whose errors in time are beyond the bound, where they alone keep it from adequacy.
    """

    model: str
    method: str
    status: str
    reason: str
    stop_time: float
    solve_cpu: float
    solve_cpu_min: float
    solve_cpu_max: float
    cpu_s: dict[str, float]
    repeats: int
    differences: tuple[Difference, ...]
    worst: Difference | None
    adequate: bool
    validity: dict[str, dict[str, Any]] = field(default_factory=dict)
    coordinates: str = ""
    time_error: float | None = None
    time_error_channel: str = ""
    undecided: Difference | None = None

    @property
    def left_range(self) -> list[tuple[float, str, str]]:
        """Time [s], body and reason where the model left its range, the earliest first."""
        facts = ((one["left_at"], body, one["reason"]) for body, one in self.validity.items())
        return sorted((time, body, why) for time, body, why in facts if time is not None)

    def difference(self, channel: str) -> Difference | None:
        """Return the difference in a channel; None where there is none."""
        return next((d for d in self.differences if d.channel == channel), None)

    @property
    def broke_down(self) -> bool:
        """Whether it did not reach the end."""
        return self.status != "done"

    @property
    def ended(self) -> str:
        """How and when it ended early."""
        if self.status == REFUSED:
            return "has no start"
        return ending(self.status, self.stop_time)

    @property
    def why_ended(self) -> str:
        """The same with the reason."""
        return f"{self.ended}: {self.reason}" if self.reason else self.ended

    @property
    def first_exceeded(self) -> Difference | None:
        """The difference that passes the bound first, if any does."""
        passed = [d for d in self.differences if d.first_exceeded is not None]
        return min(passed, key=lambda d: d.first_exceeded or 0.0, default=None)


@dataclass(frozen=True)
class Comparison:
    """All models against the reference.

    Attributes
    ----------
    name : str
        Name of the deck.
    reference : str
        The reference model.
    duration : float
        Span of the reference [s].
    max_error : float
        The bound [-], relative to each channel's scale.
    scales : tuple of ChannelScale
        One for each channel.
    models : tuple of ModelResult
        In the order in which they were asked for, the reference included.
    verdict : str or None
        The cheapest adequate model, of those that tie the one that leaves out least; None if the reference
        itself failed, no channel can be judged, or a signal ended the comparison.
    ties : tuple of str
        Adequate models whose CPU time cannot be told from that of the verdict.
    interrupted : bool
        Whether a signal ended it: what had been computed until then is all there is.
    runs : mapping of str to Run
        By model, but for those that are refused.
    """

    name: str
    reference: str
    duration: float
    max_error: float
    scales: tuple[ChannelScale, ...]
    models: tuple[ModelResult, ...]
    verdict: str | None
    ties: tuple[str, ...] = ()
    interrupted: bool = False
    runs: Mapping[str, Run] = field(default_factory=dict, repr=False, compare=False)

    def __repr__(self) -> str:
        """Return what it is in a line: its differences would fill the screen."""
        models = ", ".join(one.model for one in self.models)
        return f"<Comparison {self.name}: {models}; verdict {self.verdict}>"

    def result(self, model: str) -> ModelResult:
        """Return the result of one model.

        Raises
        ------
        KeyError
            If the model was not compared.
        """
        return {result.model: result for result in self.models}[model]

    @property
    def status(self) -> str:
        """Status of the reference run: without it there is nothing to compare with."""
        return "interrupted" if self.interrupted else self.result(self.reference).status

    @property
    def sentence(self) -> str:
        """The verdict in one sentence."""
        if self.interrupted:
            return "verdict: none: the comparison was interrupted; what was computed until then is kept"
        if self.verdict is None:
            truth = self.result(self.reference)
            failed = f"the reference {self.reference} {truth.why_ended}" if truth.broke_down else ""
            return f"verdict: none, because {failed or 'no channel can be judged'}"
        return f"verdict: {self._cheapest(self.result(self.verdict))}{self._ties}{self._twins}"

    def _cheapest(self, best: ModelResult) -> str:
        bound = f"{100 * self.max_error:.3g} %"
        if best.model != self.reference:
            return f"{best.model} is the cheapest model within {bound} {_worst_of(best)}"
        others = [m for m in self.models if m.model != self.reference]
        if not others:
            return f"only {self.reference} was run, nothing to compare it with"
        if any(m.adequate for m in others):
            return f"{best.model}, the reference, is itself the cheapest model within {bound}"
        if any(m.undecided for m in others):
            return f"{best.model}, the reference: of no other model it is sure that it stays within {bound}"
        return f"{best.model}, the reference: no other model stays within {bound}"

    @property
    def _ties(self) -> str:
        if not self.ties:
            return ""
        return f"; its CPU time ties with that of {' and '.join(self.ties)}, and it leaves out least"

    @property
    def _twins(self) -> str:
        """What is to be said of a verdict for exact or ancf whose times differ by their coordinates alone."""
        twins = {one.model: one.coordinates for one in self.models if one.model in ("exact", "ancf")}
        if len(twins) < 2 or self.verdict not in twins or twins["exact"] == twins["ancf"]:
            return ""
        return "; exact and ancf are one model: in absolute coordinates exact makes the steps of ancf"


def _worst_of(result: ModelResult) -> str:
    assert result.worst is not None, "an adequate model has a judged channel"
    if result.worst.equal:
        return "(equal within the time error)"
    return f"(worst channel {result.worst.channel}: {percent(result.worst.beyond)})"


def as_facts(comparison: Comparison) -> dict[str, Any]:
    """Return the comparison as JSON-ready facts (``compare.json``)."""
    facts = asdict(replace(comparison, runs={}))
    del facts["runs"]
    facts["models"] = {model.pop("model"): model for model in facts["models"]}
    scales = [{**scale._asdict(), "group": scale.group} for scale in comparison.scales]
    facts["scales"] = {scale.pop("channel"): scale for scale in scales}
    return {"status": comparison.status, **facts, "sentence": comparison.sentence}
