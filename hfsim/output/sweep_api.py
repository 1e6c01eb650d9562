"""Sweeps from Python: many runs of one deck as one object."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hfsim.errors import ArgumentError
from hfsim.marching.stop import Progress, nobody
from hfsim.output.api import load
from hfsim.output.arguments import (
    AnyDeck,
    callback,
    destination,
    finished,
    flags,
    in_arguments,
    integral,
    mapping,
    one_of,
    positive,
    several,
    value_text,
    values_text,
    workers,
)
from hfsim.output.sweep import KEPT, Rows, Wanted, into_folder, perform, wanted_of
from hfsim.output.talk import Talk
from hfsim.studies.sweep.asked import Asked
from hfsim.studies.sweep.collected import COLLECT
from hfsim.studies.sweep.plan import SAMPLE, SAMPLER, SEED, TABLE, VARY
from hfsim.studies.sweep.sensitivity import Sensitivity, sensitivities

if TYPE_CHECKING:
    from hfsim.output.talk import Destination
    from hfsim.scene.loading import LoadedDeck
    from hfsim.studies.cluster import Workers
    from hfsim.studies.sweep.result import Sweep

_CALLED = {option: option.removeprefix("--") for option in (VARY, TABLE, SAMPLE, SAMPLER, SEED, COLLECT)}
"""What options are called here."""


def sweep(
    deck: AnyDeck,
    vary: Mapping[str, Any] | None = None,
    collect: Sequence[str] = (),
    changes: Mapping[str, Any] | None = None,
    *,
    sample: int | None = None,
    sampler: str | None = None,
    seed: int | None = None,
    table: str | os.PathLike[str] | None = None,
    jobs: int = 0,
    dask: str = "",
    dask_config: str | os.PathLike[str] | None = None,
    error_estimate: bool = True,
    mesh_error: bool = False,
    limit: float | None = None,
    output: str | os.PathLike[str] | None = None,
    force: bool = False,
    resume: bool = False,
    keep: str = "nothing",
    plots: bool | str = True,
    progress: Progress | None = None,
) -> Sweep:
    """Run a deck many times with other values of its entries; what ``hfsim sweep`` does.

    Parameters
    ----------
    deck, changes
        As in `hfsim.load`.
    vary : mapping, optional
        By dotted paths, or ``parameters.NAME``: a sequence of values, or text such as ``"lin(0.5, 2, 7)"``.
        All combinations are run. Without it, and without a table, the deck's own entry ``sweep`` counts.
    collect : sequence of str
        Numbers of each run: ``"max(b1.tip.x)"``. Without any, last values and extremes of all channels.
    sample : int, optional
        So many random runs instead; ``vary`` may have distributions then. ``sampler`` is ``"lhs"``,
        ``"sobol"`` or ``"random"``, ``seed`` a whole number.
    table : path, optional
        CSV file that has the runs, paths in its first row.
    jobs : int
        Processes; 0 for all cores.
    dask, dask_config : str, path
        Instead: the address of a scheduler of dask.distributed or ``"local"``, or a file that says what
        cluster is started.
    error_estimate, mesh_error : bool
        Whether errors of time and mesh are measured.
    limit : float, optional
        Wall time that a run may take [s].
    output : path, optional
        Folder that gets what ``hfsim sweep`` writes; nothing is written without it. ``force``, ``resume``
        and ``keep`` are as the options, ``plots`` is as of `hfsim.run`.
    progress : callable, optional
        Called with the share of the runs that is done, 0 to 1.

    Returns
    -------
    Sweep
        ``sweep["max(b1.tip.x)"]``, ``sweep["bodies.b1.length"]``, ``sweep["status"]``: arrays, a value for
        each run.

    Raises
    ------
    DeckError, DeckNotFoundError
        If the deck is bad, or refuses what is varied.
    HfsimError
        If the sweep cannot be made as it is asked for, or the folder must not be written to.
    Interrupted
        If the keyboard or a signal ends it: a KeyboardInterrupt, ``error.found`` has the runs that have
        ended.
    """
    said = mapping("vary", vary, '{"bodies.b1.length": [1.0, 1.2]}')
    integral(sample=sample, seed=seed)
    flags(error_estimate=error_estimate, mesh_error=mesh_error)
    asked = Asked(
        {path: values_text("vary", values) for path, values in said.items()}, sample, sampler, seed,
        None if table is None else Path(table), several("collect", collect), True, error_estimate, mesh_error,
        limit=limit, called=_CALLED,
    )  # fmt: skip
    one_of("keep", keep, KEPT)
    kept = None if keep == "nothing" else keep
    to = destination(output, force, plots, resume=resume, keep=kept)
    where = workers(jobs, dask, dask_config)
    return _done(asked, load(deck, changes), where, to, resume, keep, progress)[0]


def sensitivity(
    deck: AnyDeck,
    vary: Sequence[str] | Mapping[str, float | str | None],
    collect: Sequence[str],
    changes: Mapping[str, Any] | None = None,
    *,
    jobs: int = 0,
    dask: str = "",
    dask_config: str | os.PathLike[str] | None = None,
    limit: float | None = None,
    output: str | os.PathLike[str] | None = None,
    force: bool = False,
    resume: bool = False,
    plots: bool | str = True,
    progress: Progress | None = None,
) -> tuple[Sensitivity, ...]:
    """Find how numbers of a run change with entries of its deck; what ``hfsim sweep --sensitivity`` does.

    Parameters
    ----------
    deck, changes
        As in `hfsim.load`.
    vary : sequence of str, or mapping
        Dotted paths, or ``parameters.NAME``; with a number each, or text with a unit, where it is not the
        deck's own that counts.
    collect : sequence of str
        Numbers of each run: ``"max(b1.tip.x)"``.
    jobs, dask, dask_config, limit, output, force, resume, plots, progress
        As in `hfsim.sweep`.

    Returns
    -------
    tuple of Sensitivity
        One for each number and entry: ``quantity``, ``path``, ``derivative``, ``error``, ``elasticity``,
        ``sure``.

    Raises
    ------
    DeckError, DeckNotFoundError
        If the deck is bad, or refuses what is varied.
    HfsimError
        If the deck's own run fails, or the folder must not be written to.
    Interrupted
        If the keyboard or a signal ends it: a KeyboardInterrupt, ``error.found`` has the runs that have
        ended.
    """
    values = vary if isinstance(vary, Mapping) else dict.fromkeys(several("vary", vary))
    texts = {path: "" if value is None else value_text("vary", value) for path, value in values.items()}
    asked = Asked(
        texts, collect=several("collect", collect), many=True, limit=limit, sensitivity=True, called=_CALLED
    )
    to = destination(output, force, plots, resume=resume)
    where = workers(jobs, dask, dask_config)
    result, wanted = _done(asked, load(deck, changes), where, to, resume, "nothing", progress)
    assert wanted.differences is not None
    return sensitivities(result, wanted.differences)


def _done(
    asked: Asked,
    loaded: LoadedDeck,
    where: Workers,
    to: Destination | None,
    resume: bool,
    keep: str,
    progress: Progress | None,
) -> tuple[Sweep, Wanted]:
    """Do what is asked for; return all of its runs, and what they are."""
    positive(limit=asked.limit)
    flags(resume=resume)
    callback(progress=progress)
    if resume and to is not None and to.force:
        raise ArgumentError("resume and force are one or the other")
    wanted, told = wanted_of(asked, loaded.with_numbers(), nobody, keep), progress or nobody
    with where.executor(wanted.loaded.source.texts) as executor:
        if to is None:
            result = perform(wanted, executor, Rows(wanted.plan), told)
        else:
            with in_arguments():
                result = into_folder(wanted, executor, to, Talk(quiet=True), told, resume)
    finished(result, result.status == "interrupted", executor)
    return result, wanted
