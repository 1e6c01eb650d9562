"""Work on the points of a map: references and points are jobs, the references of a deck first."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import partial

from hfsim.deck.ranges import Value, written
from hfsim.errors import DeckError
from hfsim.marching.stop import Progress, nobody
from hfsim.scene.loading import LoadedDeck
from hfsim.studies.axes import point_overrides
from hfsim.studies.farm import Executor, Outcome, Task
from hfsim.studies.stability.asked import Plan
from hfsim.studies.stability.references import check_reference, solve_reference
from hfsim.studies.stability.results import MapPoint, Wanted
from hfsim.studies.stability.trials import Job, solve_point
from hfsim.studies.stability.verdict import REFUSED, TRUTH_MODEL, Trial, Truth, Verdict, classify

_PATIENCE = 3.0
"""Time limit of a reference over that of a point: it is solved tighter, and with its disturbed run twice."""


@dataclass(eq=False)
class _Cell:
    """One deck of the map while it is worked on.

    Attributes
    ----------
    overrides : tuple of str
        What makes it of the deck mapped.
    waiting : list of (point, job)
        What waits for references.
    truths : dict of str to Truth or None
        Reference of each model asked for; None until it is there.
    checks : set of str
        Models whose reference is being checked, or has been.
    tried : list of points
        What has run.
    """

    overrides: tuple[str, ...]
    waiting: list[tuple[Wanted, Job]] = field(default_factory=list)
    truths: dict[str, Truth | None] = field(default_factory=dict)
    checks: set[str] = field(default_factory=set)
    tried: list[Wanted] = field(default_factory=list)

    def truth(self, model: str) -> Truth:
        """Return a reference that is there."""
        found = self.truths[model]
        assert found
        return found


class Mapper:
    """Computes points of one deck within a budget; references once found are kept.

    The key of each task is the function that takes its outcome.
    """

    def __init__(self, loaded: LoadedDeck, plan: Plan, executor: Executor, report: Progress = nobody) -> None:
        self._loaded = loaded
        self._plan = plan
        self._report = report
        self._start = time.perf_counter()
        self._executor = executor
        self._executor.deadline = self._start + plan.seconds
        self._executor.patient = True  # for a first point at least
        self._job = Job(loaded.source.text, loaded.source.file, (), TRUTH_MODEL, plan.limit, plan.tolerance)
        self._cells: dict[tuple[str, ...], _Cell] = {}
        self._found: dict[Wanted, MapPoint] = {}

    @property
    def used(self) -> float:
        """Wall time used so far [s]."""
        return time.perf_counter() - self._start

    @property
    def interrupted(self) -> bool:
        """Whether a signal has ended the work."""
        return self._executor.interrupted

    def compute(self, wanted: Iterable[Wanted]) -> dict[Wanted, MapPoint]:
        """Return a point for everything that is wanted, in its order; what is not reached is told so."""
        asked = list(dict.fromkeys(wanted))
        for one in asked:
            self._queue(one)

        def take(outcome: Outcome) -> None:
            outcome.key(outcome)
            self._report(sum(self._found[one].outcome != "not computed" for one in asked) / len(asked))

        self._executor.serve(take)
        for one in asked:
            if self._found[one].outcome == "not computed":
                unreached = replace(self._found[one].verdict, reason=self._executor.why_unreached)
                self._found[one] = replace(self._found[one], verdict=unreached)
        return {one: self._found[one] for one in asked}

    def _queue(self, one: Wanted) -> None:
        """Queue what a point needs, unless its deck is refused."""
        values, model, method = one
        try:
            overrides = point_overrides(self._loaded, self._plan.axes, values)
        except DeckError as error:
            self._found[one] = MapPoint(*one, Verdict("deck", REFUSED + error.problems[0].message, "deck"))
            return
        self._found[one] = MapPoint(*one, Verdict("not computed"), overrides=overrides)
        cell = self._cell(values)
        cell.waiting.append((one, replace(self._job, overrides=overrides, model=model, method=method)))
        for name in (TRUTH_MODEL, model):
            if name not in cell.truths:
                self._ask_reference(cell, name)
        self._release(cell)

    def _cell(self, values: tuple[Value, ...]) -> _Cell:
        """Return the cell of a point: axes that change the solver alone lead to no other one."""
        scene = [one for one in zip(self._plan.axes, values, strict=True) if not one[0].solver_only]
        key = tuple(written(value) for _, value in scene)
        if key not in self._cells:
            axes, at = zip(*scene, strict=True) if scene else ((), ())
            self._cells[key] = _Cell(point_overrides(self._loaded, axes, at))
        return self._cells[key]

    def _ask_reference(self, cell: _Cell, model: str) -> None:
        job = replace(self._reference_job(cell, model), disturbed=model == TRUTH_MODEL)
        cell.truths[model] = None
        self._executor.add(Task(partial(self._take_reference, cell, model), solve_reference, job, job.limit))

    def _reference_job(self, cell: _Cell, model: str) -> Job:
        return replace(
            self._job, overrides=cell.overrides, model=model, limit=_PATIENCE * self._plan.limit,
            bound=self._plan.bounds.error,
        )  # fmt: skip

    def _take_reference(self, cell: _Cell, model: str, outcome: Outcome) -> None:
        cell.truths[model] = outcome.value or Truth("lost", reason=outcome.lost)
        self._release(cell)

    def _release(self, cell: _Cell) -> None:
        """Queue the points of a cell whose references are all there, before everything else."""
        if None in cell.truths.values():
            return
        for one, job in reversed(cell.waiting):
            truth = cell.truth(job.model)
            ready = replace(job, truth=truth if truth.status == "done" else None)
            take = partial(self._take_point, one, cell)
            self._executor.add(Task(take, solve_point, ready, job.limit), first=True)
        cell.waiting.clear()

    def _take_point(self, one: Wanted, cell: _Cell, outcome: Outcome) -> None:
        trial = outcome.value or Trial("lost", reason=outcome.lost)
        self._found[one] = replace(self._found[one], trial=trial)
        cell.tried.append(one)
        self._judge(one, cell)

    def _judge(self, one: Wanted, cell: _Cell) -> None:
        """Put a point into a class, unless references are to be checked for that."""
        model = one[1]
        truths = cell.truth(model), cell.truth(TRUTH_MODEL)
        trial = self._found[one].trial.against(truths[0])
        verdict = classify(trial, *truths, self._plan.bounds)
        decisive = verdict.references(model) if verdict.outcome != "physical" else ()
        needed = [name for name in decisive if not cell.truth(name).checked]
        for name in needed:
            self._ask_check(cell, name)
        if needed:
            verdict = replace(verdict, outcome="not computed")
        else:
            self._executor.patient = False
        self._found[one] = replace(self._found[one], verdict=verdict, trial=trial)

    def _ask_check(self, cell: _Cell, model: str) -> None:
        """Have a reference checked, once, before everything else."""
        if model not in cell.checks:
            cell.checks.add(model)
            job = replace(self._reference_job(cell, model), truth=cell.truth(model))
            take = partial(self._take_check, cell, model)
            self._executor.add(Task(take, check_reference, job, job.limit), first=True)

    def _take_check(self, cell: _Cell, model: str, outcome: Outcome) -> None:
        cell.truths[model] = outcome.value or replace(cell.truth(model), doubt=outcome.lost)
        for one in cell.tried:
            self._judge(one, cell)
