"""hfsim from Python: decks, runs and comparisons as objects. Nothing is printed; the manual has a page on it.

All of it stands in ``hfsim`` itself, from where it is imported on first use.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from hfsim import simulate as pipeline
from hfsim.deck.source import refuse_unknown
from hfsim.errors import INTERRUPTIONS, ArgumentError, Interrupted, UnfinishedRunError
from hfsim.marching.solution import Run
from hfsim.marching.stop import Budget, Progress, nobody
from hfsim.output.arguments import (
    AnyDeck,
    callback,
    deck_text,
    destination,
    finished,
    flags,
    in_arguments,
    model_setting,
    no_deck,
    real,
    settings,
    several,
    timed,
)
from hfsim.parts.bodies.models import MODELS
from hfsim.scene.loading import LoadedDeck, load_deck, parse_deck
from hfsim.scene.shipped import find_deck

if TYPE_CHECKING:
    from hfsim.integrators import Memory
    from hfsim.output.extras import Extras
    from hfsim.output.recording import Recording
    from hfsim.output.runfolder import RunFolder, RunLog, Stopwatch
    from hfsim.output.stream import Stream
    from hfsim.output.talk import Destination
    from hfsim.output.writers import Provenance
    from hfsim.studies.compare.result import Comparison
    from hfsim.studies.verify.result import Verification

Deck = LoadedDeck
"""A checked deck: ``deck`` has its entries, ``resolved()`` of it plain data, `changed` gives another one."""


def load(deck: AnyDeck, changes: Mapping[str, Any] | None = None) -> LoadedDeck:
    """Read and check a deck.

    Parameters
    ----------
    deck : path, str, mapping or Deck
        A file, the name of a shipped case, or the data of a deck as YAML would give it.
    changes : mapping, optional
        Values by dotted paths, e.g. ``{"bodies.b1.length": 2.0}``; None takes an entry out.

    Raises
    ------
    DeckError
        With every problem found, each with its place.
    DeckNotFoundError
        If there is no such file.
    """
    return _load(deck, settings(changes))


def without_blind(
    loaded: LoadedDeck, models: Sequence[str], note: Callable[[str], None] = nobody
) -> LoadedDeck:
    """Return a deck without channels that some models have not; say which."""
    from hfsim.studies.compare.choice import without_blind_channels

    blind = without_blind_channels(loaded.changed, models, note)
    return loaded.changed(blind) if blind else loaded


def for_models(base: LoadedDeck, models: Sequence[str]) -> LoadedDeck:
    """Return a deck without channels that some models have not, and with numbers of elements."""
    return without_blind(base, models).with_numbers()


def readable(loaded: LoadedDeck, note: Callable[[str], None] = nobody) -> LoadedDeck:
    """Return a deck without channels that it has not with a model which is set from outside; say which.

    A deck that itself names such a model contradicts itself, and is refused as it is built.
    """
    if not loaded.source.is_overridden(("solve", "model")):
        return loaded
    return without_blind(loaded, (loaded.deck.solve.model,), note)


def _load(deck: AnyDeck, overrides: Sequence[str]) -> LoadedDeck:
    if isinstance(deck, LoadedDeck):
        return deck.changed(overrides) if overrides else deck
    if isinstance(deck, Mapping):
        return parse_deck(deck_text(deck), "deck", overrides)
    if not isinstance(deck, str | os.PathLike):
        raise no_deck(deck)
    return load_deck(find_deck(os.fspath(deck)), overrides)


def run(
    deck: AnyDeck,
    changes: Mapping[str, Any] | None = None,
    *,
    model: str | None = None,
    output: str | os.PathLike[str] | None = None,
    force: bool = False,
    plots: bool | str = True,
    error_estimate: bool = True,
    diagnosis: bool = True,
    after: float | None = None,
    progress: Progress | None = None,
    check: bool = True,
) -> Run:
    """Simulate a deck, with a target error if it states one.

    Parameters
    ----------
    deck, changes
        As in `load`.
    model : str, optional
        Instead of the deck's.
    output : path, optional
        Folder that gets what ``hfsim run`` writes; nothing is written without it.
    force : bool
        Whether a finished run there is replaced.
    plots : bool or str
        Whether pictures are among what is written; or their format, ``"png"``, ``"svg"`` or ``"pdf"``.
    error_estimate : bool
        Whether to measure the errors of time and mesh by further runs.
    diagnosis : bool
        Whether to find out by short experiments why a run fails or is suspicious.
    after : float, optional
        CPU time for estimates and diagnosis [s]; without it as much as the run takes, or two seconds.
    progress : callable, optional
        Called with the share of all the work that is done, 0 to 1.
    check : bool
        Whether a run that fails or meets a limit is an error; if not, its ``status`` and ``reason`` tell.

    Returns
    -------
    Run
        ``run["b1.tip.x"]``, ``run.t``, ``run.final``, ``run.statistics`` (all that summary.json has)...

    Raises
    ------
    DeckError, DeckNotFoundError
        If the deck is bad.
    ArgumentError
        If there is no such format of pictures or time, or the folder has no name.
    UnfinishedRunError
        If the run fails or a limit stops it; ``error.run`` has what was computed until then.
    Interrupted
        If the keyboard or a signal ends it: a KeyboardInterrupt, ``error.found`` has what there is.
    FolderError, WriteError
        If the folder must not or cannot be written to.
    """
    to = destination(output, force, plots)
    flags(error_estimate=error_estimate, diagnosis=diagnosis, check=check)
    callback(progress=progress)
    real(after=after)
    if after is not None and not after >= 0.0:
        raise ArgumentError(f"after is {after}: estimates and diagnosis take no less than 0 s")
    loaded = readable(_load(deck, [*settings(changes), *model_setting(model)]))
    wish: dict[str, Any] = {"error_estimate": error_estimate, "diagnosis": diagnosis, "after": after}
    wish["outlines"] = True
    if to is None:
        result = carry_out(loaded, progress, **wish)
    else:
        with in_arguments():
            result = _written(loaded, progress, to, wish)
    result = replace(result, fine=None)  # the steps are many
    if result.exit_code in INTERRUPTIONS:
        raise Interrupted(result.reason, result)
    if check and result.exit_code:
        raise UnfinishedRunError(result)
    return result


def _written(
    loaded: LoadedDeck, progress: Progress | None, to: Destination, wish: Mapping[str, Any]
) -> Run:
    from hfsim.output.recording import Recording

    deck = loaded.deck
    folder, provenance, watch, log, wanted = folder_for(loaded, to, wish["after"])
    recording = Recording(folder, deck.name, deck.solve.model, provenance, watch, log)
    try:
        result = carry_out(loaded, progress, recording=recording, **wish)
    except BaseException as error:
        recording.abandon(error)
        raise
    return recording.finish(result, wanted)[0]


def folder_for(
    loaded: LoadedDeck, to: Destination, after: float | None = None
) -> tuple[RunFolder, Provenance, Stopwatch, RunLog, Extras]:
    """Return the folder of a run from Python, what it comes from, its clock and log, and what is drawn."""
    from hfsim.output.extras import Extras
    from hfsim.output.runfolder import RunLog, Stopwatch, claim
    from hfsim.output.writers import Provenance

    provenance = Provenance.of(loaded, loaded.source.file, loaded.overrides)
    wanted = Extras(to.plots, after=after, format=to.format).of(loaded.deck.output)
    assert to.output is not None
    return claim(to.output, to.force), provenance, Stopwatch(cpu_start=time.process_time()), RunLog(), wanted


def carry_out(
    loaded: LoadedDeck,
    progress: Progress | None,
    *,
    error_estimate: bool,
    diagnosis: bool,
    after: float | None,
    outlines: bool,
    recording: Recording | Stream | None = None,
    memory: Memory | None = None,
) -> Run:
    """Simulate a deck within its budget, or refine it to its target error; what `run` and ``hfsim run`` do.

    Parameters
    ----------
    outlines : bool
        Whether to compute the outlines of the bodies.
    recording : Recording or Stream, optional
        Gets the rows as they come.
    memory : Memory, optional
        From where a run that was put down goes on.
    """
    if loaded.has_target:
        from hfsim.studies.refine.study import refine

        pipeline.check(loaded)
        if recording is not None:
            recording.begin(loaded.deck.channels)
        result, chosen = refine(loaded, progress=progress, diagnosis=diagnosis, after=after)
        if progress is not None:
            progress(1.0)
        if recording is not None:
            recording.take(result, recording.provenance._replace(resolved=chosen.deck.resolved()))
        return result
    if loaded.deck.solve.budget is not None:
        budget = Budget(loaded.deck.solve.budget)
        progress = budget.limiting(progress or nobody)
    return pipeline.simulate(
        loaded,
        progress=progress,
        error_estimate=error_estimate,
        diagnosis=diagnosis,
        outlines=outlines,
        mesh_estimate=error_estimate,
        after=after,
        sink=recording,
        memory=memory,
    )


def compare(
    deck: AnyDeck,
    models: Sequence[str] | None = None,
    changes: Mapping[str, Any] | None = None,
    *,
    reference: str = "exact",
    max_error: float = 0.01,
    channels: Sequence[str] = (),
    repeats: int = 3,
    error_estimate: bool = False,
    progress: Progress | None = None,
) -> Comparison:
    """Run one scene with several models and hold them against one of them; what ``hfsim compare`` does.

    Parameters
    ----------
    deck, changes
        As in `load`.
    models : sequence of str, optional
        The reference is run too. Without it linear, lowOrder and exact, as far as all beams have them.
    reference : str
        Model that counts as true.
    max_error : float
        Largest difference of an adequate model, relative to each channel's range [-].
    channels : sequence of str
        Those that are judged; without any, positions, angles and deflections.
    repeats : int
        How often short solves are timed, for the median.
    error_estimate : bool
        Whether each run is to have error estimates of its own, beside those that the verdict needs.
    progress : callable, optional
        Called with the share of all the work that is done, 0 to 1.

    Returns
    -------
    Comparison
        ``verdict`` (the cheapest model that is good enough; None if the reference failed), ``sentence``,
        ``runs["linear"]``, and ``result("linear")`` with ``adequate``, ``solve_cpu`` [s], ``worst`` and
        ``differences``. A model that breaks down is a result.

    Raises
    ------
    DeckError, DeckNotFoundError
        If the deck is bad, with any of the models.
    HfsimError
        If a model or channel cannot be compared.
    Interrupted
        If the keyboard or a signal ends it: a KeyboardInterrupt, ``error.found`` has what there is.
    """
    from hfsim.studies.compare import choice, study
    from hfsim.studies.farm import Here

    real(max_error=max_error)
    timed(repeats)
    flags(error_estimate=error_estimate)
    callback(progress=progress)
    if not 0.0 < max_error < math.inf:
        raise ArgumentError(f"max_error is {max_error}: a difference is held against a positive number")
    base = load(deck, changes)
    wanted = choice.usual_models(base.changed, nobody) if models is None else several("models", models)
    chosen = choice.chosen_models(wanted, reference)
    refuse_unknown("model", chosen, MODELS)
    prepared = choice.prepare(base.changed, chosen, reference, several("channels", channels), nobody)
    found = study.carry_out(prepared, max_error, repeats, Here(), progress, error_estimate)
    finished(found, found.interrupted)
    return found


def verify(
    decks: AnyDeck | Sequence[AnyDeck] = (), *, jobs: int = 1, progress: Progress | None = None
) -> Verification:
    """Hold what is found against published values; what ``hfsim verify`` does.

    Parameters
    ----------
    decks : deck or sequence of decks
        As in `load`, with an entry ``verify``; or names of shipped benchmarks, all of them without any.
    jobs : int
        Processes at a time.
    progress : callable, optional
        Called with the share of the work that is done, 0 to 1.

    Returns
    -------
    Verification
        ``rows`` with ``quantity``, ``published``, ``found``, ``difference``, ``bound`` and ``verdict``
        (``held``, ``missed``, ``failed``); ``held``, how many; ``exit_code``, 0 where all are held.

    Raises
    ------
    DeckError, DeckNotFoundError
        If a deck is bad, or has no such entry.
    Interrupted
        If the keyboard or a signal ends it: a KeyboardInterrupt, ``error.found`` has what there is.
    """
    from hfsim.studies.farm import Farm
    from hfsim.studies.verify import study

    callback(progress=progress)
    shipped = study.published_decks()
    many = isinstance(decks, Iterable) and not isinstance(decks, Mapping | str | bytes)
    named: Sequence[Any] = list(decks) or list(shipped) if many else [decks]  # type: ignore[arg-type]
    found = (shipped.get(each, each) if isinstance(each, str) else each for each in named)
    result = study.verify(study.entries_of(load(each) for each in found), Farm(jobs), progress or nobody)
    finished(result, result.interrupted)
    return result


def check(deck: AnyDeck, changes: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Assemble a scene without running it; return its sizes, how its joints close, and what looks wrong.

    Raises
    ------
    DeckError, DeckNotFoundError
        If it cannot be assembled, or not be swept as it says itself.
    """
    return checked(readable(load(deck, changes)).with_numbers())


def checked(loaded: LoadedDeck) -> dict[str, Any]:
    """Return what `check` does of a deck that is loaded."""
    facts = pipeline.check(loaded)
    if loaded.deck.sweep is not None:
        from hfsim.output.sweep import check_sweep

        facts["warnings"] = [*facts["warnings"], *check_sweep(loaded)]
    return facts
