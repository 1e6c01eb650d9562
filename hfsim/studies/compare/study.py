"""All of a comparison: each model is run, measured and judged; a signal ends it with what there is."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from hfsim.marching.solution import Run
from hfsim.marching.stop import Progress
from hfsim.simulate import simulate
from hfsim.studies.compare.choice import Prepared
from hfsim.studies.compare.judge import compare
from hfsim.studies.compare.measurements import Measured, measure
from hfsim.studies.compare.result import Comparison
from hfsim.studies.timing import uninterrupted

_RUNS = 0.6
"""Share of the runs themselves in all the work: the looser runs and repeats take the rest."""


def run_of(
    prepared: Prepared, model: str, progress: Progress | None = None, error_estimate: bool = False
) -> Run:
    """Run one model, outlines included: the extent of the bodies is a scale of the comparison."""
    deck = prepared.decks[model]
    return simulate(deck, model=model, progress=progress, error_estimate=error_estimate, outlines=True)


def carry_out(
    prepared: Prepared,
    max_error: float,
    repeats: int,
    run: Callable[[str, Progress], Run],
    progress: Progress | None = None,
) -> Comparison:
    """Run, measure and judge all models.

    Parameters
    ----------
    prepared : Prepared
    max_error : float
        Largest difference of an adequate model, relative to each channel's scale [-].
    repeats : int
        How often a short solve is timed.
    run : callable
        Gives the run of a model; gets a function to be told its share.
    progress : callable, optional
        Told the share that is done of all the work, 0 to 1.
    """
    tell = progress or (lambda share: None)
    runs: list[Run] = []
    found, ended = Measured(), False
    try:
        for n, model in enumerate(prepared.decks):
            part = _RUNS / len(prepared.decks)
            runs.append(run(model, partial(_tell_part, tell, n * part, part)))
            uninterrupted(runs[-1])
        measure(prepared.decks, runs, repeats, found, partial(_tell_part, tell, _RUNS, 1.0 - _RUNS))
        ended = True
    except KeyboardInterrupt:
        pass
    return compare(runs, prepared.reference, max_error, found, prepared.channels, interrupted=not ended)


def _tell_part(tell: Progress, before: float, part: float, share: float) -> None:
    tell(before + part * share)
