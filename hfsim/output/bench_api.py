"""Error against run time, and the cost of the elastic force, from Python."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from hfsim.marching.stop import Budget, Progress, nobody
from hfsim.output.api import for_models, load
from hfsim.output.arguments import (
    AnyDeck,
    callback,
    destination,
    finished,
    numbers,
    positive,
    several,
    study_in,
    timed,
    workers,
)
from hfsim.output.study import time_to_draw
from hfsim.simulate import check

if TYPE_CHECKING:
    from hfsim.studies.bench.result import Bench
    from hfsim.studies.separation.results import SeparationBench


def bench(
    deck: AnyDeck,
    changes: Mapping[str, Any] | None = None,
    *,
    methods: Sequence[str] | str = (),
    tolerances: Sequence[float] = (),
    steps: Sequence[float] = (),
    models: Sequence[str] | str = (),
    elements: Sequence[int] = (),
    degrees: Sequence[int] = (),
    budget: float = 60.0,
    repeats: int = 3,
    jobs: int = 1,
    dask: str = "",
    dask_config: str | os.PathLike[str] | None = None,
    output: str | os.PathLike[str] | None = None,
    force: bool = False,
    plots: bool | str = True,
    progress: Progress | None = None,
) -> Bench:
    """Measure error against CPU time for methods, tolerances, models and meshes; what ``hfsim bench`` does.

    Parameters
    ----------
    deck, changes
        As in `hfsim.load`.
    methods, models : sequence of str
        All methods, and the deck's model, without any.
    tolerances, steps : sequence of float
        Tolerances [-], 1e-3 to 1e-10 by decades without any; or fixed steps [s] in their place.
    elements, degrees : sequence of int
        Elements of each beam, and degrees of those of cable elements, 3 to 12; the deck's without any.
    budget : float
        CPU time that all may take [s].
    repeats : int
        How often short points are timed, for the median.
    jobs : int
        Processes; side by side, points disturb one another's times. 0 for all cores.
    dask, dask_config, output, force
        As in `hfsim.sweep`; nothing is written without `output`.
    plots : bool or str
        As of `hfsim.run`.
    progress : callable, optional
        Called with the share of the budget that is used, 0 to 1.

    Returns
    -------
    Bench
        ``found["error"]``, ``found["cpu"]`` and so on: arrays, a value for each point;
        ``found.recommendations``; ``found.status`` is ``failed`` where there is no reference, ``limit``
        where the budget did not suffice for a single point.

    Raises
    ------
    DeckError, DeckNotFoundError
        If the deck is bad.
    ArgumentError
        If an argument cannot be meant so.
    FolderError, WriteError
        If the folder must not or cannot be written to.
    Interrupted
        If the keyboard or a signal ends it: a KeyboardInterrupt, ``error.found`` has what there is.
    """
    from hfsim.output.bench import publish_bench
    from hfsim.studies.bench.study import bench as measure
    from hfsim.studies.bench.sweep import Sweep

    start = time.process_time()
    positive(budget=budget)
    callback(progress=progress)
    timed(repeats)
    wanted = Sweep(
        several("methods", methods), several("models", models), numbers("tolerances", tolerances),
        numbers("steps", steps), numbers("elements", elements, int), numbers("degrees", degrees, int),
        repeats,
    )  # fmt: skip
    to, where = destination(output, force, plots), workers(jobs, dask, dask_config)
    loaded = for_models(load(deck, changes), wanted.models)
    check(loaded)
    wanted, study = wanted.completed(loaded), study_in("bench", to, loaded)
    drawing = 0.0 if to is None else time_to_draw(to.plots, budget)
    if study is not None:
        study.begin()
    with where.executor(loaded.source.texts, timing=True) as executor:
        allowed = Budget(budget - drawing, time.process_time, start, progress or nobody)
        result = measure(loaded, wanted, allowed, executor, drawing)
    if study is not None:
        publish_bench(result, study)
    finished(result, result.status == "interrupted", executor)
    return result


def separation(
    *,
    elements: Sequence[int] = (),
    element: Sequence[str] | str = (),
    states: Sequence[int] = (),
    budget: float = 60.0,
    repeats: int = 3,
    output: str | os.PathLike[str] | None = None,
    force: bool = False,
    plots: bool | str = True,
    progress: Progress | None = None,
) -> SeparationBench:
    """Time the ways to the elastic force, the paper's Table 1; what ``hfsim bench --separation`` does.

    Parameters
    ----------
    elements, states : sequence of int
        Numbers of elements; beams that move at once.
    element : sequence of str
        Kinds of element; all without any.
    budget, repeats, output, force, plots, progress
        As in `bench`.

    Returns
    -------
    SeparationBench
        ``cells`` with the times of each form; ``verdicts``; ``status`` is ``wrong`` where forms disagree.

    Raises
    ------
    ArgumentError, FolderError, WriteError, Interrupted
        As of `bench`.
    """
    from hfsim.output.separation import publish_separation
    from hfsim.studies.separation.measure import known_kinds, measure

    start = time.process_time()
    positive(budget=budget)
    callback(progress=progress)
    timed(repeats)
    counts, batches = numbers("elements", elements, int), numbers("states", states, int)
    kinds = known_kinds(several("element", element))
    study = study_in("bench", destination(output, force, plots), "separation")
    if study is not None:
        study.begin()
    allowed = Budget(budget, time.process_time, start, progress or nobody)
    result = measure(counts, kinds, repeats, allowed, batches)
    if study is not None:
        publish_separation(result, study)
    finished(result, result.status == "interrupted")
    return result
