"""The extreme set: decks at the edge of what can be solved, each held against what is expected of it.

What is expected stands in ``expected.yaml`` beside the decks.  Every deck runs as it states, in a worker
process of its own, and is put into a class (`hfsim.studies.stability.verdict`); closed forms are checked
where there are any.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from hfsim.errors import HfsimError
from hfsim.marching.stop import Progress, nobody
from hfsim.scene.loading import parse_deck
from hfsim.studies.farm import Executor, Outcome, Task
from hfsim.studies.stability.references import check_reference, solve_reference
from hfsim.studies.stability.trials import Job, solve_point
from hfsim.studies.stability.verdict import (
    CLASSES,
    NO_TRIAL,
    TRUTH_MODEL,
    Bounds,
    Trial,
    Truth,
    Verdict,
    classify,
)

EXPECTED = "expected.yaml"
"""File beside the decks that says what is expected of them."""
_TIGHTER = 1.0
"""Bound on the tolerance of references: none but a tenth of the deck's own, which differ by decades."""
_REFERENCE_SHARE = 0.6
"""Part of a deck's time that its references may take."""


class ExpectationError(HfsimError):
    """The file of expectations cannot be used."""

    exit_code = 2


@dataclass(frozen=True)
class Value:
    """A closed form: the value of a channel at a time.

    Attributes
    ----------
    time : float
        [s]; the nearest output time counts.
    value, within : float
        In the unit of the channel.
    source : str
        Where the value is from.
    """

    channel: str
    time: float
    value: float
    within: float
    source: str


@dataclass(frozen=True)
class Expectation:
    """What a deck is expected to do.

    Attributes
    ----------
    name : str
        Of the deck's file without its ending.
    outcome : str
        A key of `hfsim.studies.stability.verdict.CLASSES`.
    error, drift : float or None
        Bounds on the error against a tighter run and on the energy drift [-].
    item : str
        Deck path that must be blamed; empty where none need be.
    sound : bool
        Whether the scene is physically sound and the run meant to complete.
    """

    name: str
    outcome: str
    error: float | None = None
    drift: float | None = None
    values: tuple[Value, ...] = ()
    sound: bool = True
    item: str = ""

    @property
    def bounds(self) -> Bounds:
        """The bounds that references must tell its run from."""
        usual = Bounds()
        return replace(usual, error=min(self.error or usual.error, usual.error))


@dataclass(frozen=True)
class Found:
    """What a value came out as."""

    channel: str
    source: str
    expected: float
    value: float
    within: float

    @property
    def holds(self) -> bool:
        """Whether it is as near as was asked for."""
        return abs(self.value - self.expected) <= self.within


@dataclass(frozen=True)
class Case:
    """One deck of the set with what came of it.

    Attributes
    ----------
    trial : Trial
        How the run ended, without its output.
    """

    expectation: Expectation
    verdict: Verdict
    trial: Trial = NO_TRIAL
    found: tuple[Found, ...] = ()

    @property
    def name(self) -> str:
        """Name of the deck."""
        return self.expectation.name

    @property
    def misses(self) -> list[str]:
        """What is not as expected, in words."""
        wanted, verdict = self.expectation, self.verdict
        if verdict.outcome != wanted.outcome:
            return [f"{verdict.outcome} where {wanted.outcome} is expected: {verdict.reason}"]
        lines = []
        if wanted.item not in ("", verdict.item):
            lines.append(f"{verdict.item or 'nothing'} is blamed where {wanted.item} is to: {verdict.reason}")
        for what, value, bound in (
            ("error", verdict.time_error, wanted.error),
            ("energy drift", verdict.energy_drift, wanted.drift),
        ):
            if bound is not None and (value is None or value > bound):
                lines.append(f"{what} {value if value is None else format(value, '.2g')} above {bound:g}")
                if what == "error" and verdict.time_within[0] <= bound:
                    floor = verdict.reference_floor
                    known = "that nothing bears out" if floor is None else f"itself known to {floor:.2g}"
                    lines[-1] += f" against a reference {known}"
        lines += [
            f"{f.channel} {f.value:.9g}, expected {f.expected:.9g} within {f.within:g} ({f.source})"
            for f in self.found
            if not f.holds
        ]
        return lines


@dataclass(frozen=True)
class Extreme:
    """The whole set.

    Attributes
    ----------
    seconds, used : float
        Wall time allowed and used [s].
    """

    cases: tuple[Case, ...]
    seconds: float
    used: float
    interrupted: bool = False

    @property
    def held(self) -> int:
        """How many cases are as expected."""
        return sum(not case.misses for case in self.cases)

    @property
    def sound(self) -> tuple[int, int]:
        """How many physically sound cases completed, and how many there are."""
        sound = [case for case in self.cases if case.expectation.sound]
        return sum(case.trial.status == "done" for case in sound), len(sound)


def read_expectations(folder: Path) -> tuple[Expectation, ...]:
    """Return what is expected of the decks of a folder, in the order of the file.

    Raises
    ------
    ExpectationError
        If the file cannot be read, or does not fit the decks: each needs one entry.
    """
    path = folder / EXPECTED
    try:
        entries = yaml.safe_load(path.read_text(encoding="utf-8"))
        found = tuple(_expectation(name, entry) for name, entry in entries.items())
    except (OSError, yaml.YAMLError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise ExpectationError(f"{path}: {error}") from error
    decks = {deck.stem for deck in folder.glob("*.yaml")} - {path.stem}
    alone = decks ^ {one.name for one in found}
    if alone:
        raise ExpectationError(f"{path}: decks and expectations differ: {', '.join(sorted(alone))}")
    return found


def _expectation(name: str, entry: dict[str, Any]) -> Expectation:
    if unknown := set(entry) - {"class", "error", "drift", "values", "sound", "item"}:
        raise ValueError(f"{name}: unknown {', '.join(sorted(unknown))}")
    if entry["class"] not in CLASSES:
        raise ValueError(f"{name}: there is no class '{entry['class']}'")
    values = tuple(
        Value(v["channel"], float(v["time"]), float(v["value"]), float(v["within"]), str(v["from"]))
        for v in entry.get("values", ())
    )
    error, drift = (None if entry.get(key) is None else float(entry[key]) for key in ("error", "drift"))
    sound, item = bool(entry.get("sound", True)), str(entry.get("item", ""))
    return Expectation(name, entry["class"], error, drift, values, sound, item)


# --- one deck, in a worker process ----------------------------------------------------------------


def examine(order: tuple[Job, Expectation]) -> Case:
    """Solve a deck as it states and its references; check what is expected."""
    job, expectation = order
    start, solve = time.perf_counter(), parse_deck(job.text, job.file, job.overrides).deck.solve

    def left(model: str) -> Job:
        return replace(job, model=model, limit=max(job.limit - (time.perf_counter() - start), 0.1))

    limit = (1 - _REFERENCE_SHARE) * job.limit
    trial = solve_point(replace(job, model=solve.model, method=solve.method, limit=limit, diagnosed=True))
    truths: dict[str, Truth] = {}
    for model in dict.fromkeys((TRUTH_MODEL, solve.model)):
        truths[model] = solve_reference(replace(left(model), disturbed=model == TRUTH_MODEL))
    truth, exact = truths[solve.model], truths[TRUTH_MODEL]
    first = classify(trial.against(truth), truth, exact, expectation.bounds)
    for model in first.references(solve.model):
        truths[model] = check_reference(
            replace(left(model), truth=truths[model], bound=expectation.bounds.error)
        )
    return judged(expectation, trial, truths[solve.model], truths[TRUTH_MODEL])


def judged(expectation: Expectation, trial: Trial, truth: Truth, exact: Truth) -> Case:
    """Return the case of a deck from its run and its references."""
    verdict = classify(trial.against(truth), truth, exact, Bounds())
    return Case(expectation, verdict, replace(trial, channels=(), times=None), _values(expectation, trial))


def _values(expectation: Expectation, trial: Trial) -> tuple[Found, ...]:
    if trial.times is None:
        return ()
    columns = {channel.name: channel.values for channel in trial.channels}
    found = []
    for wanted in expectation.values:
        at = int(np.abs(trial.times - wanted.time).argmin())
        value = float(columns[wanted.channel][at])
        found.append(Found(wanted.channel, wanted.source, wanted.value, value, wanted.within))
    return tuple(found)


# --- all of them ---------------------------------------------------------------------------------


def extreme_set(
    folder: Path,
    expectations: Sequence[Expectation],
    seconds: float,
    limit: float,
    executor: Executor,
    report: Progress = nobody,
) -> Extreme:
    """Run decks of a folder and hold them against what is expected.

    Parameters
    ----------
    expectations : sequence of Expectation
        Of the decks to run.
    seconds : float
        Wall time that all may take [s].
    limit : float
        Wall time that one deck may take, references included [s].
    executor : Executor
        What runs them.
    report : callable
        Told the share of the decks that is done, 0 to 1.
    """
    start = time.perf_counter()
    cases = {one.name: Case(one, _WAITING) for one in expectations}
    executor.deadline = start + seconds

    def take(outcome: Outcome) -> None:
        one = outcome.key
        cases[one.name] = outcome.value or Case(one, Verdict("no result", outcome.lost))
        report(sum(case.verdict is not _WAITING for case in cases.values()) / len(cases))

    for one in expectations:
        path = folder / f"{one.name}.yaml"
        job = Job(path.read_text(encoding="utf-8"), str(path), (), TRUTH_MODEL, limit, tolerance=_TIGHTER)
        executor.add(Task(one, examine, (job, one), limit))
    executor.serve(take)
    for one in expectations:
        if cases[one.name].verdict is _WAITING:
            cases[one.name] = Case(one, Verdict("not computed", executor.why_unreached))
    return Extreme(tuple(cases.values()), seconds, time.perf_counter() - start, executor.interrupted)


_WAITING = Verdict("not computed")
