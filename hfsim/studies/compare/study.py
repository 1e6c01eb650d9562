"""All of a comparison: each model is run, measured and judged; a signal ends it with what there is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from hfsim.marching.solution import Run
from hfsim.marching.stop import Progress, Share, nobody
from hfsim.simulate import simulate
from hfsim.studies.compare.choice import Prepared
from hfsim.studies.compare.judge import compare
from hfsim.studies.compare.measurements import Measured, measure
from hfsim.studies.compare.result import Comparison
from hfsim.studies.farm import Executor
from hfsim.studies.timing import uninterrupted

_RUNS = 0.6
"""Share of the runs themselves in all the work: the looser runs and repeats take the rest."""


def carry_out(
    prepared: Prepared,
    max_error: float,
    repeats: int,
    executor: Executor,
    progress: Progress | None = None,
    error_estimate: bool = False,
    take: Callable[[str, Run], Run] = lambda model, run: run,
) -> Comparison:
    """Run, measure and judge all models.

    Parameters
    ----------
    max_error : float
        Largest difference of an adequate model, relative to each channel's scale [-].
    repeats : int
        How often a short solve is timed.
    executor : Executor
        Does the runs.
    progress : callable, optional
        Told the share that is done of all the work, 0 to 1.
    error_estimate : bool
        Whether each run measures its own error too.
    take : callable
        (model, run) -> the run as it is kept; one that a signal has cut off meanwhile ends the comparison.
    """
    tell = progress or nobody
    models, part = list(prepared.decks), _RUNS / len(prepared.decks)
    runs: dict[str, Run] = {}
    found, ended = Measured(), False
    try:
        jobs = [(model, Share(tell, k * part, part)) for k, model in enumerate(models)]
        for k, run in executor.results(partial(_run_of, prepared, error_estimate), jobs):
            runs[models[k]] = run
            runs[models[k]] = take(models[k], run)
            tell(len(runs) * part)
            uninterrupted(runs[models[k]])
        runs = {model: runs[model] for model in models}
        measure(prepared.decks, [*runs.values()], repeats, found, executor, Share(tell, _RUNS, 1.0 - _RUNS))
        ended = True
    except KeyboardInterrupt:
        pass
    there = [runs[model] for model in models if model in runs]
    found_out = compare(
        there,
        prepared.reference,
        max_error,
        found,
        prepared.channels,
        interrupted=not ended,
        refused=prepared.refused,
    )
    asked = list(prepared.overrides)
    return replace(found_out, models=tuple(sorted(found_out.models, key=lambda one: asked.index(one.model))))


def _run_of(prepared: Prepared, error_estimate: bool, job: tuple[str, Progress]) -> Run:
    """Run one model, outlines included: the extent of the bodies is a scale of the comparison."""
    model, tell = job
    deck = prepared.decks[model]
    return simulate(deck, model=model, progress=tell, error_estimate=error_estimate, outlines=True)
