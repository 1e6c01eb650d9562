"""All runs of a sweep: what is wrong is found before any of them, then each is a job of an executor."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial

from hfsim.deck.overrides import why_unset
from hfsim.deck.ranges import Value, Values, written
from hfsim.errors import DeckError, DeckProblem
from hfsim.scene.build import build
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.schema import Deck
from hfsim.studies.farm import Executor, Outcome, Task
from hfsim.studies.sweep.collected import COLLECT
from hfsim.studies.sweep.plan import TABLE, VARY, Plan
from hfsim.studies.sweep.work import LOST, Keep, Row, Setting, row_without, solve_row

_TRIES = 3
"""How often a run is begun whose workers die."""
_PATIENCE = 2.0
"""Time after which a worker is ended, over that which its run may take."""
_TRIED = 12
"""Values of each path that are tried before anything runs."""


def latest_end(setting: Setting, vary: Mapping[str, Values]) -> float:
    """Return when runs end at the latest [s]: infinite where that follows from what is varied."""
    own = setting.load(()).deck.solve.duration
    for path, values in vary.items():
        for value in _tried(values):
            with suppress(DeckError):
                if setting.load((f"{path}={written(value)}",)).deck.solve.duration != own:
                    return math.inf
    return own


# --- before anything runs ------------------------------------------------------------------------


_ENTRIES = {VARY: "vary", TABLE: "runs", COLLECT: "collect"}
"""What decks have under ``sweep`` for these options."""


class Refusals:
    """All that is wrong with what is asked for: gathered, and then told at once.

    Parameters
    ----------
    loaded : LoadedDeck
    own : collection of str
        Options whose place the deck's own entry ``sweep`` takes: what is wrong with them stands there.
    called : mapping of str to str
        What options are called where they are no options.
    """

    def __init__(
        self, loaded: LoadedDeck, own: Collection[str] = (), called: Mapping[str, str] | None = None
    ) -> None:
        self._loaded, self._own, self._called = loaded, own, called or {}
        self._problems: list[DeckProblem] = []
        self._texts: dict[str, str] = {}

    @contextmanager
    def gathered(self) -> Iterator[None]:
        """Gather what the block refuses."""
        try:
            yield
        except DeckError as error:
            self._problems += map(self._placed, error.problems)
            self._texts |= error.others

    def _placed(self, problem: DeckProblem) -> DeckProblem:
        if problem.file not in self._own:
            hint = problem.hint
            for option, name in self._called.items():
                hint = hint.replace(option, name)
            return replace(problem, hint=hint, file=self._called.get(problem.file, problem.file))
        vary = self._loaded.deck.sweep.vary
        option = problem.file if vary or problem.file == COLLECT else TABLE
        path: tuple[str, ...] = ("sweep", _ENTRIES[option])
        message = problem.message
        if problem.path in vary:
            path += (problem.path,)
        elif problem.path:
            message = f"{problem.path}: {message}"
        return self._loaded.source.problem(path, message, problem.hint, on_key=True)

    def tell(self) -> None:
        """Raise all of it as one `DeckError`; do nothing where there is none."""
        if self._problems:
            source = self._loaded.source
            raise DeckError(source.file, self._problems, source.text, self._texts)


def refuse_entries(loaded: LoadedDeck, paths: Iterable[str]) -> None:
    """Refuse entries that a deck has no place for.

    Raises
    ------
    DeckError
        With all of them.
    """
    why = {path: why_unset(loaded.source.data, path, Deck) for path in paths}
    if wrong := [DeckProblem(path, *one, file=VARY) for path, one in why.items() if one]:
        raise DeckError(VARY, wrong)


def refuse_values(setting: Setting, vary: Mapping[str, Values], note: Callable[[str], None]) -> None:
    """Refuse entries that refuse all their values.

    Values that alone are refused, among others that are not, are told to `note`: their runs will say so.

    Raises
    ------
    DeckError
        With all of them.
    """
    unfit, data = list[DeckProblem](), setting.load(()).source.data
    for path, values in vary.items():
        if why_unset(data, path, Deck):  # that is told
            continue
        problems = {one: refused(setting, path, one) for one in _tried(values)}
        wrong = {one: problem for one, problem in problems.items() if problem is not None}
        if wrong and len(wrong) == len(problems):
            first = next(iter(wrong.values()))
            unfit.append(DeckProblem(first.path, first.message, first.hint, file=VARY))
            continue
        for one, problem in wrong.items():
            note(f"{path}={written(one)} is refused: {problem.message}; its runs will say so")
    if unfit:
        raise DeckError(VARY, unfit)


def _tried(values: Values) -> dict[Value, None]:
    """Return some values that are tried before anything runs, the first and the last of a list among them."""
    if values.kind:
        return dict.fromkeys(values.at((k + 0.5) / _TRIED) for k in range(_TRIED))
    return dict.fromkeys(values.listed[round(k)] for k in _spread(len(values.listed)))


def _spread(count: int) -> list[float]:
    most = min(count, _TRIED)
    return [k * (count - 1) / max(1, most - 1) for k in range(most)]


def refused(setting: Setting, path: str, value: Value) -> DeckProblem | None:
    """Return why a deck is refused with a value of an entry; None if it is not."""
    try:
        setting.load((f"{path}={written(value)}",))
    except DeckError as error:
        return error.problems[0]
    return None


def refuse_unbuilt(setting: Setting, plan: Plan) -> None:
    """Raise what is wrong with some runs, spread over the plan, if none of them can be put together.

    Raises
    ------
    DeckError
        With all that is wrong with them, each entry once.
    """
    wrong, errors = dict[str, DeckProblem](), list[DeckError]()
    for number in dict.fromkeys(map(round, _spread(plan.count))):
        try:
            build(setting.of_run(plan.overrides(number))[0])
            return
        except DeckError as error:
            errors.append(error)
            for one in error.problems:
                wrong.setdefault(one.path, replace(one, file=VARY) if one.path in plan.paths else one)
    raise DeckError(errors[0].file, list(wrong.values()), errors[0].text, errors[0].others)


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
    missing : callable
        Whether a run is to be done, by its number.
    take : callable
        Gets the number of each run, its row and the files kept of it, as they come in.
    """
    limit = _PATIENCE * setting.limit if math.isfinite(setting.limit) else math.inf

    work = partial(solve_row, setting, keep)

    def tasks() -> Iterator[Task]:
        for number in range(plan.count):
            if missing(number):
                yield Task(number, work, plan.overrides(number), limit, _TRIES)

    def done(outcome: Outcome) -> None:
        row, files = outcome.value or (row_without(LOST, outcome.lost, setting), {})
        take(outcome.key, row, files)

    executor.feed(tasks())
    executor.serve(done)
    return executor.interrupted
