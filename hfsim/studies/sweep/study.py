"""All runs of a sweep: what is wrong is found before any of them, then each is a job of an executor."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from hfsim.deck.overrides import why_unset
from hfsim.deck.quantities import Quantity, QuantityError, read_quantity
from hfsim.deck.ranges import Value, written
from hfsim.errors import DeckError, DeckProblem
from hfsim.integrators import import_for
from hfsim.marching.solution import Run
from hfsim.scene.build import build
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.schema import Deck
from hfsim.studies.collect import channels_of
from hfsim.studies.farm import Executor, Outcome, Task
from hfsim.studies.sweep.plan import Plan, SweepError
from hfsim.studies.sweep.work import LOST, Order, Row, Setting, row_without, solve_row

_TRIES = 3
"""How often a run is begun whose workers die."""
_PATIENCE = 2.0
"""Time after which a worker is ended, over that which its run may take."""
_TRIED = 12
"""Values of each path that are tried before anything runs."""
_USUAL = ("final", "min", "max")
"""What is collected of every channel where nothing is named."""

Keep = Callable[[LoadedDeck, Run], dict[str, bytes]]
"""Makes the files that are kept of a run."""


@dataclass(frozen=True)
class PathProblem(DeckProblem):
    """Something wrong with an entry that is varied, which has no place in the deck."""

    def headline(self, file: str, kind: str = "error") -> str:
        """Return the same of the command line."""
        return super().headline("--vary", kind)


def read_collected(texts: Sequence[str], loaded: LoadedDeck) -> tuple[Quantity, ...]:
    """Return what is collected; without any text last values and extremes of all channels of the deck.

    Raises
    ------
    SweepError
        If a text names no quantity of a run.
    """
    if not texts:
        return tuple(Quantity(kind, name) for name in loaded.deck.channels for kind in _USUAL)
    found = []
    for text in texts:
        try:
            found.append(read_quantity(text))
        except QuantityError as error:
            hint = f" ({error.hint})" if error.hint else ""
            raise SweepError(f"--collect {text}: {error}{hint}") from None
        if not found[-1].of_runs:
            raise SweepError(f"--collect {text}: a run has no {found[-1].kind}")
        if (found[-1].time or 0.0) > loaded.deck.solve.duration:
            raise SweepError(f"--collect {text}: the run ends at {loaded.deck.solve.duration:g} s")
    return tuple(dict.fromkeys(found))


def setting_of(loaded: LoadedDeck, quantities: Sequence[Quantity], base: Setting) -> Setting:
    """Return what all runs of a deck share: its text, and that what is collected is among its channels.

    Raises
    ------
    SweepError
        If there is no such channel.
    """
    names = loaded.deck.channels
    more = [name for name in channels_of(quantities) if name not in names]
    overrides = loaded.overrides
    for name in more:
        try:
            loaded.changed([f"output.channels=[{name}]"])
        except DeckError as error:
            wrong = error.problems[0]
            hint = f" ({wrong.hint})" if wrong.hint else ""
            raise SweepError(f"--collect: {wrong.message}{hint}") from None
    if more:
        overrides = (*overrides, f"output.channels=[{', '.join([*names, *more])}]")
    source = loaded.source
    return replace(
        base,
        text=source.text,
        file=source.file,
        overrides=(*overrides, *base.overrides),
        quantities=tuple(quantities),
    )


# --- before anything runs ------------------------------------------------------------------------


def refuse_hopeless(setting: Setting, plan: Plan, note: Callable[[str], None]) -> None:
    """Refuse entries that do not exist or refuse all their values, and sweeps whose runs are all refused.

    Values that alone are refused, among others that are not, are told to `note`: their runs will say so.

    Raises
    ------
    DeckError
    """
    loaded = setting.load(())
    refuse_paths(loaded, plan.paths)
    for path, values in zip(plan.paths, plan.values, strict=True):
        tried = [values.at((k + 0.5) / _TRIED) for k in range(_TRIED)]
        if not values.kind:
            tried = [values.listed[round(k)] for k in _spread(len(values.listed))]
        problems = {one: _problem(setting, path, one) for one in dict.fromkeys(tried)}
        wrong = {one: problem for one, problem in problems.items() if problem is not None}
        if wrong and len(wrong) == len(problems):
            first = next(iter(wrong.values()))
            raise _refused(loaded, first.path, first.message, first.hint)
        for one, problem in wrong.items():
            note(f"{path}={written(one)} is refused: {problem.message}; its runs will say so")
    _refuse_unbuilt(setting, plan)


def refuse_paths(loaded: LoadedDeck, paths: Iterable[str]) -> None:
    """Refuse entries that a deck has no place for.

    Raises
    ------
    DeckError
    """
    for path in paths:
        if why := why_unset(loaded.source.data, path, Deck):
            raise _refused(loaded, path, *why)


def _spread(count: int) -> list[float]:
    most = min(count, _TRIED)
    return [k * (count - 1) / max(1, most - 1) for k in range(most)]


def _problem(setting: Setting, path: str, value: Value) -> DeckProblem | None:
    try:
        setting.load((f"{path}={written(value)}",))
    except DeckError as error:
        return error.problems[0]
    return None


def _refused(loaded: LoadedDeck, path: str, message: str, hint: str = "") -> DeckError:
    return DeckError(loaded.source.file, [PathProblem(path, message, hint)])


def _refuse_unbuilt(setting: Setting, plan: Plan) -> None:
    """Raise what is wrong with the first run if it cannot be put together, nor some others."""
    first: DeckError | None = None
    for number in dict.fromkeys((0, plan.count // 2, plan.count - 1)):
        try:
            build(setting.load(plan.overrides(number)))
            return
        except DeckError as error:
            first = first or error
    assert first is not None
    raise first


# --- the runs ------------------------------------------------------------------------------------


def do_runs(
    setting: Setting,
    plan: Plan,
    executor: Executor,
    missing: Callable[[int], bool],
    take: Callable[[int, Row, dict[str, bytes]], None],
    keep: Keep | None = None,
) -> bool:
    """Do the runs of a plan that are missing; return whether a signal has ended that.

    Parameters
    ----------
    setting : Setting
    plan : Plan
    executor : Executor
    missing : callable
        Whether a run is to be done, by its number.
    take : callable
        Gets the number of each run, its row and the files kept of it, as they come in.
    keep : callable, optional
    """
    with suppress(DeckError):
        import_for([setting.load(()).deck.solve.method])  # once here, not in every worker
    limit = _PATIENCE * setting.limit if math.isfinite(setting.limit) else math.inf

    def tasks() -> Iterator[Task]:
        for number in range(plan.count):
            if missing(number):
                order = Order(setting, plan.overrides(number), keep)
                yield Task(number, solve_row, order, limit, _TRIES)

    def done(outcome: Outcome) -> None:
        row, files = outcome.value or (row_without(LOST, outcome.lost, setting), {})
        take(outcome.key, row, files)

    executor.feed(tasks())
    executor.serve(done)
    return executor.interrupted
