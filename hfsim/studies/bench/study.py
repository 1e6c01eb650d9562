"""The bench itself: references first, then the cheapest waiting point, until all are done or the time is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

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
from hfsim.studies.bench.points import ChannelError, GroupError, Point
from hfsim.studies.bench.reference import Work, references, solve_of
from hfsim.studies.bench.result import Bench
from hfsim.studies.bench.sweep import Sweep
from hfsim.studies.timing import Spread, solved

_TRIAL_SHARE = 0.02
"""Part of the budget after which the first point of a method is stopped, judged by how far it came, and
put back until its turn: one slow method must not starve the others."""
_WARM_UP = 1e-3
"""Part of the duration that each method runs first, so that no point pays for imports and tables."""
_REPEAT_SHARE = 0.02
"""Part of the budget within which a point is repeated."""
_FIRST_GROWTH = 2.0
"""Growth of the cost from one level to the next before it has been seen."""


def bench(loaded: LoadedDeck, sweep: Sweep, budget: Budget) -> Bench:
    """Measure error and CPU time of every point of a sweep, within a budget.

    Parameters
    ----------
    loaded : LoadedDeck
    sweep : Sweep
    budget : Budget
        The first reference is made even if it takes longer.

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
        _run_points(works, sweep, budget, points)
    except KeyboardInterrupt:
        status = "interrupted"
    if status == "done" and not any(w.truth for w in works):
        status = "failed"
    return Bench(
        name=loaded.deck.name,
        status=status,
        duration=loaded.deck.solve.duration,
        budget=budget.seconds,
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
    work : Work
    method : str
    levels : list of float
        Those still to run.
    costs : list of float
        Wall times of those that ran [s].
    forecast : float or None
        Wall time of the next one as its trial showed [s], with `trial` in words.
    """

    work: Work
    method: str
    levels: list[float]
    costs: list[float] = field(default_factory=list)
    forecast: float | None = None
    trial: str = ""

    @property
    def expected(self) -> float:
        if self.forecast is not None:
            return self.forecast
        if not self.costs:
            return 0.0
        growth = self.costs[-1] / max(self.costs[-2], 1e-9) if len(self.costs) > 1 else _FIRST_GROWTH
        return self.costs[-1] * float(np.clip(growth, 1.1, 10.0))

    def blank(self, level: float, sweep: Sweep) -> Point:
        """Return the point of a level before it is run."""
        cell = self.work.cell
        tolerance, step = (None, level) if sweep.steps else (level, None)
        return Point(cell.model, cell.elements, self.method, tolerance, step, degree=cell.degree)

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


def _run_points(works: Sequence[Work], sweep: Sweep, budget: Budget, points: list[Point]) -> None:
    """Run the cheapest waiting point until all are done or the budget is; append to `points`."""
    waiting = [_Series(w, method, list(sweep.levels)) for w in works for method in sweep.methods]
    try:
        while waiting:
            series = min(waiting, key=lambda s: s.expected)
            if series.work.cell.status == "over budget":
                points += series.given_up(sweep, series.work.cell.reason)
            elif budget.left <= series.expected:
                points += series.given_up(sweep, f"about {series.expected:.2g} s expected")
            else:
                points += _next_point(series, sweep, budget)
            waiting = [s for s in waiting if s.levels]
    except KeyboardInterrupt:
        for series in waiting:
            points += series.given_up(sweep, "interrupted")
        raise


def _next_point(series: _Series, sweep: Sweep, budget: Budget) -> list[Point]:
    """Run the next level of a series, repeatedly if it is short; return nothing if it was put back."""
    level, work = series.levels[0], series.work
    solve = solve_of(work.scene, series.method, level, bool(sweep.steps))
    unknown = not series.costs and series.forecast is None
    start = budget.used
    allowed = min(_TRIAL_SHARE * budget.seconds, budget.left) if unknown else budget.left
    done, cpu = solved(work.scene, solve, budget.guard(allowed))
    spent = budget.used - start
    if isinstance(done.stop, KeyboardInterrupt):
        raise done.stop
    if isinstance(done.stop, TimeUp):
        series.trial = f"{done.stop} after {spent:.2g} s"
        series.forecast = max(spent / max(done.stop.share, 1e-6), 1.5 * spent)
        return []
    series.costs.append(spent)
    series.forecast, series.trial = None, ""
    del series.levels[0]
    times = [cpu] if done.stop else _repeated(work.scene, solve, sweep, budget, cpu)
    spread, counts = Spread.of(times), done.problem.counts
    point = replace(
        series.blank(level, sweep), cpu=spread.median, cpu_min=spread.least, cpu_max=spread.most,
        repeats=len(times), steps=counts.steps, rejected=counts.rejected,
        newton_iterations=counts.iterations, evaluations=counts.evaluations,
        factorisations=counts.factorisations,
    )  # fmt: skip
    return [_judged(point, done, work)]


def _repeated(scene: Scene, solve: SolveSpec, sweep: Sweep, budget: Budget, cpu: float) -> list[float]:
    """Return the times of a short point, repeated as often as asked for and the budget allows."""
    times = [cpu]
    while len(times) < sweep.repeats and len(times) * cpu < _REPEAT_SHARE * budget.seconds:
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
    drift = float(balance(work.scene.system, step_samples(done.trajectory))["energy_drift"])
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
