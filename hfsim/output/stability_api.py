"""Maps of stability and longest stable steps from Python: ``hfsim.stability``, ``hfsim.limits``."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from hfsim.marching.stop import Progress, nobody
from hfsim.output.api import for_models, load
from hfsim.output.arguments import (
    AnyDeck,
    callback,
    destination,
    finished,
    mapping,
    one_of,
    positive,
    several,
    study_in,
    values_text,
    workers,
)
from hfsim.output.study import time_to_draw
from hfsim.studies.axes import NAMED, Axis, varied
from hfsim.studies.compare.choice import usual_models
from hfsim.studies.limits import Limits, limits_of_models
from hfsim.studies.stability.asked import ENDINGS, Plan, axes_of
from hfsim.studies.stability.verdict import Bounds

if TYPE_CHECKING:
    from hfsim.studies.stability.results import StabilityMap


def stability(
    deck: AnyDeck,
    vary: Mapping[str, Any] | None = None,
    changes: Mapping[str, Any] | None = None,
    *,
    scale_stiffness: Any = None,
    scale_speed: Any = None,
    amplitude: Any = None,
    slenderness: Any = None,
    step: Any = None,
    elements: Any = None,
    methods: Sequence[str] | str = (),
    models: Sequence[str] | str = (),
    max_error: float = 1e-2,
    max_drift: float = 1e-3,
    bisect: float | None = None,
    ending: str = "accurate",
    budget: float = 60.0,
    limit: float = 20.0,
    jobs: int = 0,
    dask: str = "",
    dask_config: str | os.PathLike[str] | None = None,
    output: str | os.PathLike[str] | None = None,
    force: bool = False,
    plots: bool | str = True,
    progress: Progress | None = None,
) -> StabilityMap:
    """Map where methods and models hold, over no axis, one or two; what ``hfsim stability`` does.

    Parameters
    ----------
    deck, changes
        As in `hfsim.load`.
    vary : mapping, optional
        Axes by dotted paths: a sequence of values, or text such as ``"log(1e5, 1e9, 5)"``.
    scale_stiffness, scale_speed, amplitude, slenderness, step, elements : sequence or str, optional
        Axes too: factors on stiffness, speeds, loads, initial angles and how far drivers go; length over
        height of every beam; fixed steps [s]; elements of every beam.
    methods, models : sequence of str
        All methods, and the models that `hfsim.compare` takes, without any.
    max_error, max_drift : float
        Error over each channel's range, and energy drift, beyond which a point is wrong [-].
    bisect : float, optional
        Relative width to which the end of the class `ending` is located along the one axis.
    budget, limit : float
        Wall time that all and one point may take [s].
    jobs, dask, dask_config, output, force
        As in `hfsim.sweep`; nothing is written without `output`.
    plots : bool or str
        As of `hfsim.run`.
    progress : callable, optional
        Called with the share of the points that is done, 0 to 1.

    Returns
    -------
    StabilityMap
        ``found["class"]``, ``found["time_error"]`` and so on: arrays, a value for each point;
        ``found.grid("exact", "gauss")`` the classes over the axes; ``found.boundaries``.

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
    from hfsim.output.stability import publish_map
    from hfsim.studies.stability.maps import stability_map

    start = time.perf_counter()
    named = {
        "stiffness": scale_stiffness, "speed": scale_speed, "amplitude": amplitude,
        "slenderness": slenderness, "step": step, "elements": elements,
    }  # fmt: skip
    callback(progress=progress)
    positive(max_error=max_error, max_drift=max_drift, bisect=bisect, budget=budget, limit=limit)
    one_of("ending", ending, ENDINGS)
    plan = Plan(
        _axes(vary, named), several("methods", methods), several("models", models),
        Bounds(max_error, max_drift), budget, limit, bisect=bisect, ending=ending,
    )  # fmt: skip
    to, where = destination(output, force, plots), workers(jobs, dask, dask_config)
    base = load(deck, changes)
    usual = plan.models or usual_models(base.changed, nobody)
    loaded = for_models(base, plan.models)
    drawing = 0.0 if to is None else time_to_draw(to.plots, budget)
    plan = plan.completed(usual, time.perf_counter() - start + drawing)
    study = study_in("stability", to, loaded)
    with where.executor(loaded.source.texts) as executor:
        result = stability_map(loaded, plan, executor, progress or nobody)
    if study is not None:
        publish_map(result, study, ending)
    finished(result, result.status == "interrupted", executor)
    return result


def limits(
    deck: AnyDeck,
    changes: Mapping[str, Any] | None = None,
    *,
    methods: Sequence[str] | str = (),
    models: Sequence[str] | str = (),
    budget: float = 60.0,
    limit: float = 20.0,
    jobs: int = 0,
    dask: str = "",
    dask_config: str | os.PathLike[str] | None = None,
    output: str | os.PathLike[str] | None = None,
    force: bool = False,
) -> tuple[Limits, ...]:
    """Measure the longest stable step of each method; what ``hfsim stability --limits`` does.

    Parameters
    ----------
    models : sequence of str
        The deck's without any.
    deck, changes, methods, budget, limit, jobs, dask, dask_config, output, force
        As in `hfsim.stability`; `limit` is of one method.

    Returns
    -------
    tuple of Limits
        One for each model: ``found["method"]``, ``found["order"]``, ``found["longest"]`` and
        ``found["predicted"]`` are arrays, steps in fastest periods; ``found.spectra`` has these.

    Raises
    ------
    LimitsError
        If the scene has nothing that swings, or too many unknowns.
    DeckError, ArgumentError, FolderError, Interrupted
        As of `hfsim.stability`.
    """
    from hfsim.output.limits import publish_limits

    start = time.perf_counter()
    positive(budget=budget, limit=limit)
    plan = Plan((), several("methods", methods), several("models", models), seconds=budget, limit=limit)
    to, where = destination(output, force, plots=True), workers(jobs, dask, dask_config)
    loaded = for_models(load(deck, changes), plan.models)
    plan = plan.completed((loaded.deck.solve.model,), time.perf_counter() - start)
    study = study_in("stability", to, loaded)
    with where.executor(loaded.source.texts) as executor:
        found = limits_of_models(loaded, plan, executor)
    if study is not None:
        publish_limits(found, study)
    finished(tuple(found), found[-1].interrupted, executor)
    return tuple(found)


def _axes(vary: Mapping[str, Any] | None, named: Mapping[str, Any]) -> tuple[Axis, ...]:
    said: list[tuple[str, Callable[[str], Axis], str]] = [
        (f"vary: {path}", partial(varied, path, "vary"), values_text("vary", values))
        for path, values in mapping("vary", vary, '{"bodies.b1.length": [1.0, 1.2]}').items()
    ]
    for name, values in named.items():
        if values is not None:
            argument = f"scale_{name}" if name in ("stiffness", "speed") else name
            said.append((argument, NAMED[name], values_text(argument, values)))
    return axes_of(said)
