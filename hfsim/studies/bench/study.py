"""The bench itself: references first, then the cheapest waiting point, until all are done or the time is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from hfsim.marching.balance import balance, step_samples
from hfsim.marching.distance import group_of
from hfsim.marching.integration import Integration
from hfsim.marching.sampling import compute_channels, sample
from hfsim.marching.solution import Channel
from hfsim.marching.stop import Budget, TimeUp
from hfsim.scene.build import Scene
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.schema import SolveSpec
from hfsim.studies.agreement import solve_of
from hfsim.studies.bench.pace import Forecast, Pace
from hfsim.studies.bench.points import ChannelError, GroupError, Point
from hfsim.studies.bench.reference import Work, references
from hfsim.studies.bench.result import Bench
from hfsim.studies.bench.sweep import Sweep
from hfsim.studies.farm import Executor, Outcome, Task
from hfsim.studies.timing import Spread, solved

_TRIAL_SHARE = 0.02
"""Part of the budget after which the first point of a method is stopped, judged by how far it came, and
put back until its turn: one slow method must not starve the others. What seems to take more than is left is
tried for as long before it is given up."""
_LONGER = 4.0
"""Length of a further trial over that of the last one, in which the pace still quickened."""
_WARM_UP = 1e-3
"""Part of the duration that each method runs first, so that no point pays for imports and tables."""
_REPEAT_SHARE = 0.02
"""Part of the budget within which a point is repeated."""
_UNMEASURED = ("over budget", "skipped")
"""Status of points that were cut off or never run."""
_FIRST_GROWTH = 2.0
"""Growth of the cost from one level to the next before it has been seen."""


def bench(
    loaded: LoadedDeck, sweep: Sweep, budget: Budget, executor: Executor, kept: float = 0.0
) -> Bench:
    """Measure error and CPU time of every point of a sweep, within a budget.

    Parameters
    ----------
    budget : Budget
        The first reference is made even if it takes longer.
    executor : Executor
        Does the points; references are made here.
    kept : float
        What was kept back for pictures of the budget that is told [s].

    Returns
    -------
    Bench
        Failures are data; what was not run is told as skipped, what was cut off as over budget.

    Raises
    ------
    DeckError
        If the scene cannot be assembled with one of the models or meshes.
    """
    works: list[Work] = []
    points: list[Point] = []
    status = "done"
    try:
        references(loaded, sweep, works, budget)
        _warm_up(works, sweep, budget)
        waiting = [_Series(w, method, list(sweep.levels)) for w in works for method in sweep.methods]
        _Points(sweep, budget, executor, points, waiting).run()
    except KeyboardInterrupt:
        status = "interrupted"
    if status == "done" and not any(w.truth for w in works):
        status = "failed"
    elif status == "done" and all(point.status in _UNMEASURED for point in points):
        status = "limit"
    return Bench(
        name=loaded.deck.name,
        status=status,
        duration=loaded.deck.solve.duration,
        budget=budget.seconds + kept,
        used=budget.used,
        cells=tuple(work.cell for work in works),
        points=_in_order(points, sweep),
    )


def _in_order(points: Sequence[Point], sweep: Sweep) -> tuple[Point, ...]:
    def place(p: Point) -> tuple[int, int, int, int, float]:
        level = p.step if p.step is not None else p.tolerance or 0.0
        return sweep.models.index(p.model), p.degree, p.elements, sweep.methods.index(p.method), -level

    return tuple(sorted(points, key=place))


@dataclass
class _Series:
    """All levels of one method in one cell, and what the next one is expected to cost in wall time [s].

    Attributes
    ----------
    levels : list of float
        Those still to run.
    costs : list of float
        Wall times of those that ran [s].
    forecast : Forecast or None
        Wall time of the next one as its trial of so many seconds showed, with `trial` in words.
    """

    work: Work
    method: str
    levels: list[float]
    costs: list[float] = field(default_factory=list)
    forecast: Forecast | None = None
    tried: float = 0.0
    trial: str = ""

    @property
    def expected(self) -> float:
        if self.forecast is not None:
            return self.forecast.seconds
        if not self.costs:
            return 0.0
        growth = self.costs[-1] / max(self.costs[-2], 1e-9) if len(self.costs) > 1 else _FIRST_GROWTH
        return self.costs[-1] * float(np.clip(growth, 1.1, 10.0))

    @property
    def why_not(self) -> str:
        return f"about {self.expected:.2g} s expected" if self.expected else "the budget was used up"

    def blank(self, level: float, sweep: Sweep) -> Point:
        """Return the point of a level before it is run."""
        cell = self.work.cell
        tolerance, step = (None, level) if sweep.steps else (level, None)
        return Point(cell.model, cell.elements, self.method, tolerance, step, degree=cell.degree)

    def allowed(self, budget: Budget, left: float) -> float:
        """Return how long the next level may run [s]; 0 where it cannot end in the time that is left.

        A first one, and what seems to take more than is left, is a trial; there is no other one where the
        last one's pace held.
        """
        short = _TRIAL_SHARE * budget.seconds
        if self.expected < left:
            first = not self.costs and self.forecast is None
            return min(short, left) if first else left
        if self.forecast is None:
            return short if short < left else 0.0
        longer = min(max(short, _LONGER * self.tried), left)
        return 0.0 if self.forecast.steady or longer < self.tried else longer

    def job(self, sweep: Sweep, budget: Budget, allowed: float) -> _Job:
        """Return the next level, to be run in the time allowed."""
        blank = self.blank(self.levels[0], sweep)
        solve = solve_of(self.work.scene, self.method, self.levels[0], bool(sweep.steps))
        return _Job(self.work, blank, solve, sweep.repeats, budget, allowed)

    def take(self, tried: _Tried) -> None:
        """Take note of what a level has cost, or of how far it came."""
        self.forecast, self.trial, self.tried = tried.forecast, tried.trial, tried.spent
        if tried.point is not None:
            self.costs.append(tried.spent)
            del self.levels[0]

    def given_up(self, sweep: Sweep, reason: str) -> list[Point]:
        """Return what is left: skipped, or over budget where a trial was cut off."""
        left = [replace(self.blank(level, sweep), reason=reason) for level in self.levels]
        if self.trial and left:
            left[0] = replace(left[0], status="over budget", reason=f"{self.trial}; {reason}")
        self.levels.clear()
        return left


def _warm_up(works: Sequence[Work], sweep: Sweep, budget: Budget) -> None:
    """Let every method make its first steps untimed."""
    scene = next((w.scene for w in works if w.truth is not None), None)
    for method in sweep.methods if scene else ():
        assert scene is not None
        solve = solve_of(scene, method, max(sweep.tolerances), fixed=False)
        short = solve.model_copy(update={"duration": _WARM_UP * solve.duration})
        stop = solved(scene, short, budget.guard(0.1 * budget.left))[0].stop
        if isinstance(stop, KeyboardInterrupt):
            raise stop


class _Job(NamedTuple):
    """A point to be run, and the time that its first solve is allowed [s]."""

    work: Work
    blank: Point
    solve: SolveSpec
    repeats: int
    budget: Budget
    allowed: float


class _Tried(NamedTuple):
    """What has come of it.

    Attributes
    ----------
    point : Point or None
        None where its solve was cut off.
    spent, whole : float
        Time used by its first solve, and by all [s].
    trial : str
        How it was cut off.
    forecast : Forecast or None
        What it would have taken then.
    """

    point: Point | None
    spent: float = 0.0
    whole: float = 0.0
    trial: str = ""
    forecast: Forecast | None = None


@dataclass
class _Points:
    """Has the cheapest waiting points run until all are done or the budget is; appends to `found`."""

    sweep: Sweep
    budget: Budget
    executor: Executor
    found: list[Point]
    waiting: list[_Series]
    under_way: dict[int, _Series] = field(default_factory=dict)

    def run(self) -> None:
        """Run them; raise `KeyboardInterrupt` where a signal ends that."""
        self._hand_out()
        self.executor.serve(self._take)
        if self.executor.interrupted:
            for series in (*self.waiting, *self.under_way.values()):
                self.found += series.given_up(self.sweep, "interrupted")
            raise KeyboardInterrupt

    def _hand_out(self) -> None:
        while self.waiting and len(self.under_way) < self.executor.jobs:
            series = min(self.waiting, key=lambda s: s.expected)
            self.waiting.remove(series)
            left = self.budget.left - sum(one.expected for one in self.under_way.values())
            if series.work.cell.status == "over budget":
                self.found += series.given_up(self.sweep, series.work.cell.reason)
            elif (allowed := series.allowed(self.budget, left)) <= 0.0:
                self.found += series.given_up(self.sweep, series.why_not)
            else:
                self.under_way[id(series)] = series
                self.executor.add(Task(id(series), _try, series.job(self.sweep, self.budget, allowed)))

    def _take(self, outcome: Outcome) -> None:
        series = self.under_way.pop(outcome.key)
        blank = series.blank(series.levels[0], self.sweep)
        tried = outcome.value or _Tried(replace(blank, status="failed", reason=outcome.lost))
        if self.executor.elsewhere:
            self.budget.charge(tried.whole)
        series.take(tried)
        if tried.point is not None:
            self.found.append(tried.point)
        if series.levels:
            self.waiting.append(series)
        self._hand_out()


def _try(job: _Job) -> _Tried:
    """Run a point, repeatedly if it is short."""
    work, blank, solve, repeats, budget, allowed = job
    start, pace = budget.used, Pace(budget, allowed)
    done, cpu = solved(work.scene, solve, pace)
    spent = budget.used - start
    if isinstance(done.stop, KeyboardInterrupt):
        raise done.stop
    if isinstance(done.stop, TimeUp):
        forecast = pace.forecast(done.stop, spent)
        return _Tried(None, spent, spent, f"{done.stop} after {spent:.2g} s", forecast)
    times = [cpu] if done.stop else _repeated(work.scene, solve, repeats, budget, cpu)
    spread, counts = Spread.of(times), done.problem.counts
    point = replace(
        blank, cpu=spread.median, cpu_min=spread.least, cpu_max=spread.most,
        repeats=len(times), steps=counts.steps, rejected=counts.rejected,
        newton_iterations=counts.iterations, evaluations=counts.evaluations,
        factorisations=counts.factorisations,
    )  # fmt: skip
    point = _judged(point, done, work)
    return _Tried(point, spent, budget.used - start)


def _repeated(scene: Scene, solve: SolveSpec, repeats: int, budget: Budget, cpu: float) -> list[float]:
    """Return the times of a short point, repeated as often as asked for and the budget allows."""
    times = [cpu]
    while len(times) < repeats and len(times) * cpu < _REPEAT_SHARE * budget.seconds:
        again, seconds = solved(scene, solve, budget.guard(budget.left))
        try:
            again.in_time()
        except TimeUp:
            break
        times.append(seconds)
    return times


def _judged(point: Point, done: Integration, work: Work) -> Point:
    """Return the point with its status and, if it reached the end, its errors."""
    if done.stop is not None:
        assert not isinstance(done.stop, KeyboardInterrupt)
        status = "limit" if done.stop.exit_code == 5 else "failed"
        return replace(point, status=status, reason=f"{done.stop} (t = {done.trajectory.t_end:.4g} s)")
    drift = float(balance(work.scene, step_samples(done.trajectory))["energy_drift"])
    point = replace(point, status="done", energy_drift=drift)
    truth = work.truth
    if truth is None:
        return replace(point, reason="there is no reference")
    channels = compute_channels(sample(work.scene, done.trajectory))
    if not all(np.isfinite(channel.values).all() for channel in channels):
        return replace(point, status="failed", energy_drift=None, reason="the result is not finite")
    errors = truth.errors(channels)
    groups = {group: _group_error(group, errors, channels, work) for group in truth.group_floors}
    point = replace(point, channels=errors, groups=groups)
    return point.of_group(next(iter(groups))) if groups else point


def _group_error(
    group: str, errors: Sequence[ChannelError], channels: Sequence[Channel], work: Work
) -> GroupError:
    """Return the error of a group of channels: in time, with the mesh's, and against the exact model."""
    assert work.truth is not None
    judged = [e for e in errors if e.judged and group_of(e.unit) == group]
    found = GroupError.of(judged, work.truth.group_floors[group])
    total, exact = (one.worst(channels)[group][1] if one else None for one in (work.fine, work.exact))
    return replace(found, total_error=total, exact_error=exact)
