"""Several models of one scene held against a reference model: differences and the verdict.

Pure functions from runs to numbers; nothing is computed, printed or written here.  What differences are
divided by, and which of them count, is said in `hfsim.run.distance`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from hfsim.run.distance import ChannelScale, channel_scales, gap
from hfsim.run.solution import Run


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
        When it first passes the bound [s]; None if never.
    """

    channel: str
    unit: str
    max_abs: float
    max_relative: float
    rms: float
    time_of_max: float
    first_exceeded: float | None


@dataclass(frozen=True)
class ModelResult:
    """One model in a comparison.

    Attributes
    ----------
    model, method, status, reason : str
        As in `Run`.
    stop_time : float
        When its computation stopped [s].
    solve_cpu : float
        CPU time of the solve phase, median of the repeats [s].
    cpu_s : dict of str to float
        CPU time of each phase of its first run [s].
    repeats : int
        How often it was run for `solve_cpu`.
    differences : tuple of Difference
        One for each channel of the reference; empty when there is no common time.
    worst : Difference or None
        The judged one with the largest `max_relative`.
    adequate : bool
        Whether it reached the end and stayed within the bound in every judged channel.
    validity : dict of str to dict
        By body, when and why the model left its range, as in ``summary.json``; empty for whole models.
    """

    model: str
    method: str
    status: str
    reason: str
    stop_time: float
    solve_cpu: float
    cpu_s: dict[str, float]
    repeats: int
    differences: tuple[Difference, ...]
    worst: Difference | None
    adequate: bool
    validity: dict[str, dict[str, Any]] = field(default_factory=dict)

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
        The cheapest adequate model; None if the reference itself failed.
    """

    name: str
    reference: str
    duration: float
    max_error: float
    scales: tuple[ChannelScale, ...]
    models: tuple[ModelResult, ...]
    verdict: str | None

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
        return self.result(self.reference).status

    @property
    def sentence(self) -> str:
        """The verdict in one sentence."""
        if self.verdict is None:
            failed = self.result(self.reference)
            return f"verdict: none, because the reference {self.reference} {how_it_ended(failed)}"
        bound = f"{100 * self.max_error:.3g} %"
        best = self.result(self.verdict)
        if best.model != self.reference:
            return f"verdict: {best.model} is the cheapest model within {bound} {_worst_of(best)}"
        others = [m for m in self.models if m.model != self.reference]
        if not others:
            return f"verdict: only {self.reference} was run, nothing to compare it with"
        if any(m.adequate for m in others):
            return f"verdict: {best.model}, the reference, is itself the cheapest model within {bound}"
        return f"verdict: {best.model}, the reference: no other model stays within {bound}"


def _worst_of(result: ModelResult) -> str:
    if result.worst is None:
        return "(no channel could be judged)"
    return f"(worst channel {result.worst.channel}: {percent(result.worst.max_relative)})"


def how_it_ended(result: ModelResult) -> str:
    """Return how a model that did not reach the end stopped, with the time and the reason."""
    reason = f": {result.reason}" if result.reason else ""
    return f"{ending(result.status)} at {result.stop_time:.3g} s{reason}"


def ending(status: str) -> str:
    """Return the verb for an early end."""
    return {"failed": "broke down", "limit": "reached a limit", "interrupted": "was interrupted"}.get(
        status, "stopped"
    )


def percent(fraction: float) -> str:
    """Return a fraction in per cent with two digits, however large or small.

    Examples
    --------
    >>> percent(0.000312), percent(83.0), percent(0.0), percent(1e-15)
    ('0.031 %', '8300 %', '0 %', '1e-13 %')
    """
    value = 100.0 * fraction
    if value == 0.0:
        return "0 %"
    if 1e-3 <= abs(value) < 1e5:
        return f"{float(f'{value:.2g}'):.10g} %"
    return f"{value:.0e} %"


def difference(run: Run, reference: Run, scale: ChannelScale, max_error: float) -> Difference | None:
    """Return how far one channel of `run` is from the reference.

    Parameters
    ----------
    run, reference : Run
        Runs of the same scene; `run` may have ended early.
    scale : ChannelScale
        The channel and what to divide by.
    max_error : float
        Bound on the relative difference [-].

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
    found = gap(mine, other)
    passed = (np.abs(mine - other) > max_error * scale.scale) & scale.judged
    return Difference(
        channel=scale.channel,
        unit=scale.unit,
        max_abs=found.largest,
        max_relative=found.largest / scale.scale,
        rms=found.rms,
        time_of_max=float(times[found.at]),
        first_exceeded=float(times[passed.argmax()]) if passed.any() else None,
    )


def common_times(run: Run, reference: Run) -> np.ndarray:
    """Return the output times of the reference that `run` reached too, shape (n,) [s]."""
    if not len(run.t) or not len(reference.t):
        return np.empty(0)
    slack = 1e-9 * float(reference.t[-1] - reference.t[0])
    times: np.ndarray = reference.t[reference.t <= run.t[-1] + slack]
    return times


def compare(
    runs: Sequence[Run],
    reference: str,
    max_error: float,
    solve_cpu: Mapping[str, Sequence[float]] | None = None,
) -> Comparison:
    """Hold several models of one scene against one of them.

    Parameters
    ----------
    runs : sequence of Run
        One for each model, `reference` among them.
    reference : str
        Model that counts as the truth.
    max_error : float
        Largest difference of an adequate model, relative to each channel's scale [-].
    solve_cpu : mapping of str to sequence of float, optional
        CPU times of repeated solves by model [s]; their median replaces the run's own time.

    Returns
    -------
    Comparison
        A model that broke down is a result like any other.

    Raises
    ------
    ValueError
        If the reference is not among the runs.
    """
    by_model = {run.model: run for run in runs}
    if reference not in by_model:
        raise ValueError(f"the reference {reference} was not run")
    truth = by_model[reference]
    scales = channel_scales(truth.channels, truth.outlines) if len(truth.t) else ()
    repeats = solve_cpu or {}
    models = tuple(_judge(run, truth, scales, max_error, repeats.get(run.model, ())) for run in runs)
    return Comparison(
        name=truth.name,
        reference=reference,
        duration=truth.end_time,
        max_error=max_error,
        scales=scales,
        models=models,
        verdict=cheapest(models) if truth.status == "done" else None,
    )


def _judge(
    run: Run, truth: Run, scales: Sequence[ChannelScale], max_error: float, repeats: Sequence[float]
) -> ModelResult:
    found = [difference(run, truth, scale, max_error) for scale in scales]
    differences = tuple(d for d in found if d is not None)
    counted = {scale.channel for scale in scales if scale.judged}
    judged = [d for d in differences if d.channel in counted]
    worst = max(judged, key=lambda d: d.max_relative, default=None)
    complete = run.status == "done" and len(judged) == len(counted)
    return ModelResult(
        model=run.model,
        method=run.method,
        status=run.status,
        reason=run.reason,
        stop_time=run.stop_time,
        solve_cpu=float(np.median(repeats)) if len(repeats) else run.phase_cpu("solve"),
        cpu_s={phase: run.phase_cpu(phase) for phase in run.statistics.get("cpu_s") or {}},
        repeats=max(1, len(repeats)),
        differences=differences,
        worst=worst,
        adequate=complete and (worst is None or worst.max_relative <= max_error),
        validity=run.statistics.get("validity") or {},
    )


def cheapest(models: Sequence[ModelResult]) -> str | None:
    """Return the adequate model with the least solve CPU time; None if there is none."""
    adequate = [m for m in models if m.adequate]
    return min(adequate, key=lambda m: m.solve_cpu).model if adequate else None


def as_facts(comparison: Comparison) -> dict[str, Any]:
    """Return the comparison as JSON-ready facts (``compare.json``)."""
    facts = asdict(comparison)
    facts["models"] = {model.pop("model"): model for model in facts["models"]}
    scales = [scale._asdict() for scale in comparison.scales]
    facts["scales"] = {scale.pop("channel"): scale for scale in scales}
    return {"status": comparison.status, **facts, "sentence": comparison.sentence}
