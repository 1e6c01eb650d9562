"""The judgement of models: pure functions from runs and measurements to differences and the verdict."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from hfsim.marching.alike import alike
from hfsim.marching.distance import ChannelScale, channel_scales, decisive
from hfsim.marching.solution import Run
from hfsim.parts.bodies.models import MODELS
from hfsim.studies.compare.difference import Difference, difference
from hfsim.studies.compare.measurements import Measured
from hfsim.studies.compare.result import REFUSED, Comparison, ModelResult
from hfsim.studies.timing import Spread

_SCATTER = 0.1
"""Scatter of a CPU time that is assumed at the least, however close its repeats are [-]."""
_STRAINS = ("none", "linear", "low_order", "exact")
"""Strain measures, from what leaves out most to what leaves out least."""


def compare(
    runs: Sequence[Run],
    reference: str,
    max_error: float,
    measured: Measured | None = None,
    channels: Collection[str] = (),
    interrupted: bool = False,
    refused: Mapping[str, str] = MappingProxyType({}),
) -> Comparison:
    """Hold several models of one scene against one of them.

    Parameters
    ----------
    runs : sequence of Run
        One for each model, `reference` among them unless a signal came before it.
    reference : str
        Model that counts as the truth.
    max_error : float
        Largest difference of an adequate model beyond errors in time, relative to each channel's scale [-].
    measured : Measured, optional
        Errors in time, and CPU times of repeated solves, whose median replaces the run's own time.
    channels : collection of str
        Those that are judged; without any, positions, angles and deflections, see `decisive`.
    interrupted : bool
        Whether a signal ended the runs or what was measured of them: there is no verdict then.
    refused : mapping of str to str
        Models with which the scene has no start, and why; they stand first.

    Returns
    -------
    Comparison
        A model that broke down is a result like any other.

    Raises
    ------
    ValueError
        If the reference is not among the runs.
    """
    truth = next((run for run in runs if run.model == reference), None)
    if truth is None and not interrupted:
        raise ValueError(f"the reference {reference} was not run")
    scales: tuple[ChannelScale, ...] = ()
    if truth is not None and len(truth.t):
        scales = decisive(channel_scales(truth.channels, truth.outlines), channels)
    found = measured or Measured()
    judged = (_judged(run, truth, scales, max_error, found) for run in runs)
    models = (*(_refused(model, why) for model, why in refused.items()), *judged)
    whole = truth is not None and truth.status == "done" and not interrupted
    best = cheapest(models, reference) if whole else None
    return Comparison(
        name=runs[0].name if runs else "",
        reference=reference,
        duration=truth.end_time if truth is not None else 0.0,
        max_error=max_error,
        scales=scales,
        models=models,
        verdict=best.model if best else None,
        ties=tuple(m.model for m in models if best and m is not best and m.adequate and ties(m, best)),
        interrupted=interrupted,
        runs={run.model: run for run in runs},
    )


def _refused(model: str, why: str) -> ModelResult:
    return ModelResult(model, "", REFUSED, why, 0.0, 0.0, 0.0, 0.0, {}, 0, (), None, adequate=False)


def _judged(
    run: Run, truth: Run | None, scales: Sequence[ChannelScale], max_error: float, measured: Measured
) -> ModelResult:
    spread = Spread.of(measured.times.get(run.model) or [run.phase_cpu("solve")])
    result = ModelResult(
        model=run.model,
        method=run.method,
        status=run.status,
        reason=run.reason,
        stop_time=run.stop_time,
        solve_cpu=spread.median,
        solve_cpu_min=spread.least,
        solve_cpu_max=spread.most,
        cpu_s={phase: run.phase_cpu(phase) for phase in run.statistics.get("cpu_s") or {}},
        repeats=max(1, len(measured.times.get(run.model, ()))),
        differences=(),
        worst=None,
        adequate=False,
        validity=run.statistics.get("validity") or {},
        coordinates=measured.coordinates.get(run.model, ""),
    )
    return result if truth is None else _held_against(result, run, truth, scales, max_error, measured)


def _held_against(
    result: ModelResult,
    run: Run,
    truth: Run,
    scales: Sequence[ChannelScale],
    max_error: float,
    measured: Measured,
) -> ModelResult:
    mine, theirs = measured.errors.get(run.model, {}), measured.errors.get(truth.model, {})
    both = {name: mine[name] + theirs[name] for name in mine if name in theirs and run is not truth}
    n = min(len(run.t), len(truth.t))
    if np.array_equal(run.t[:n], truth.t[:n]):
        run = replace(run, channels=alike(run.channels, truth.channels))
    found = [difference(run, truth, scale, max_error, both.get(scale.channel)) for scale in scales]
    counted = {scale.channel: scale.scale for scale in scales if scale.judged}
    judged = [d for d in found if d is not None and d.channel in counted]
    own = {name: mine[name] / scale for name, scale in counted.items() if name in mine}
    whole = run.status == truth.status == "done" and 0 < len(judged) == len(counted)
    within = whole and all(d.beyond <= max_error for d in judged)
    vague = max(judged, key=_vagueness, default=None)
    decided = vague is None or _vagueness(vague) <= max_error
    channel = max(own, key=lambda name: own[name], default="")
    return replace(
        result,
        differences=tuple(d for d in found if d is not None),
        worst=max(judged, key=lambda d: (d.beyond, d.max_relative), default=None),
        adequate=within and decided,
        undecided=vague if within and not decided else None,
        time_error=own.get(channel),
        time_error_channel=channel,
    )


def _vagueness(found: Difference) -> float:
    return found.time_error_relative or 0.0


# --- cost ----------------------------------------------------------------------------------------


def cheapest(models: Sequence[ModelResult], reference: str = "") -> ModelResult | None:
    """Return the adequate model with the least solve CPU time; None if there is none.

    Of models whose times tie with that, it is the one that leaves out least; the reference before its like.
    """
    adequate = [m for m in models if m.adequate]
    if not adequate:
        return None
    least = min(adequate, key=lambda m: m.solve_cpu)
    alike = [m for m in adequate if ties(m, least)]
    wholeness = {m.model: _STRAINS.index(MODELS[m.model].strain) for m in alike}
    return min(alike, key=lambda m: (-wholeness[m.model], m.model != reference, m.solve_cpu))


def ties(one: ModelResult, other: ModelResult) -> bool:
    """Return whether the CPU times of two models cannot be told apart: what they scatter in overlaps."""
    (low, high), (least, most) = map(_scatter, (one, other))
    return low <= most and least <= high


def _scatter(model: ModelResult) -> tuple[float, float]:
    half = max(0.5 * (model.solve_cpu_max - model.solve_cpu_min), _SCATTER * model.solve_cpu)
    return model.solve_cpu - half, model.solve_cpu + half
