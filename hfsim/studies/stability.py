"""Stability maps: one scene over one or two axes, with methods and models, every point in a class.

References and points are jobs of a farm (`hfsim.studies.farm`): the references of a cell (one deck) first,
then its points.  Cells are taken in an order that covers the map coarsely first, so that one whose budget
runs out is coarse rather than cut off.  Nothing is printed or written here.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise, product
from typing import Any

from hfsim.errors import DeckError
from hfsim.scene.loading import LoadedDeck
from hfsim.studies.axes import Axis, Value, point_overrides, written
from hfsim.studies.farm import Farm, Outcome, Task
from hfsim.studies.judge import (
    CLASSES,
    REFUSED,
    TRUTH_MODEL,
    Bounds,
    Job,
    Trial,
    Truth,
    Verdict,
    classify,
    solve_point,
    solve_reference,
)

_PATIENCE = 3.0
"""Time limit of a reference over that of a point: it is solved tighter, and with its disturbed run twice."""

Report = Callable[[float], None]


@dataclass(frozen=True)
class Plan:
    """What is mapped.

    Attributes
    ----------
    axes : tuple of Axis
        None to two.
    methods, models : tuple of str
    bounds : Bounds
    seconds : float
        Wall time that all may take [s].
    limit : float
        Wall time that one point may take [s].
    jobs : int
        Processes at a time.
    tolerance : float
        Of the references, at most a tenth of the deck's [-].
    """

    axes: tuple[Axis, ...]
    methods: tuple[str, ...]
    models: tuple[str, ...]
    bounds: Bounds = field(default_factory=Bounds)
    seconds: float = 60.0
    limit: float = 20.0
    jobs: int = 2
    tolerance: float = 1e-8


@dataclass(frozen=True)
class MapPoint:
    """One point of a map.

    Attributes
    ----------
    values : tuple of float or str
        On the axes.
    model, method : str
    verdict : Verdict
    status : str
        How its run ended; empty if there was none.
    end : float
        Where it ended [s].
    steps : int
    cpu : float
        CPU time of the integration [s].
    overrides : tuple of str
        What makes this deck of the one mapped.
    """

    values: tuple[Value, ...]
    model: str
    method: str
    verdict: Verdict
    status: str = ""
    end: float = 0.0
    steps: int = 0
    cpu: float = 0.0
    overrides: tuple[str, ...] = ()

    @property
    def outcome(self) -> str:
        """Its class."""
        return self.verdict.outcome


@dataclass(frozen=True)
class Boundary:
    """Where a class ends along an axis.

    Attributes
    ----------
    model, method : str
    below, above : float
        The last value of one class and the first of the other, as near as was asked for.
    class_below, class_above : str
    reason : str
        What is wrong on the side that is not accurate.
    """

    model: str
    method: str
    below: float
    above: float
    class_below: str
    class_above: str
    reason: str

    @property
    def width(self) -> float:
        """Distance of the two over the larger one [-]."""
        return abs(self.above - self.below) / max(abs(self.above), abs(self.below))


@dataclass(frozen=True)
class StabilityMap:
    """Everything a study found.

    Attributes
    ----------
    name : str
        Name of the deck.
    status : str
        ``done``, ``over budget`` or ``interrupted``.
    axes : tuple of (name, values, whether logarithmic)
    bounds : Bounds
    seconds, used : float
        Wall time allowed and used [s].
    points : tuple of MapPoint
        In the order of models, methods and axes.
    boundaries : tuple of Boundary
    """

    name: str
    status: str
    axes: tuple[tuple[str, tuple[Value, ...], bool], ...]
    bounds: Bounds
    seconds: float
    used: float
    points: tuple[MapPoint, ...]
    boundaries: tuple[Boundary, ...] = ()

    def rows(self) -> list[tuple[str, str]]:
        """Return the pairs (model, method)."""
        return list(dict.fromkeys((p.model, p.method) for p in self.points))

    def points_of(self, model: str, method: str) -> dict[tuple[Value, ...], MapPoint]:
        """Return the points of one model and method by their values."""
        return {p.values: p for p in self.points if (p.model, p.method) == (model, method)}

    def counts(self) -> dict[str, int]:
        """Return how many points each class has."""
        found = [p.outcome for p in self.points]
        return {name: found.count(name) for name in CLASSES if name in found}


@dataclass
class _Cell:
    """One deck of the map while it is worked on: its references and the points that wait for them."""

    overrides: tuple[str, ...]
    waiting: list[tuple[Any, Job]] = field(default_factory=list)
    truths: dict[str, Truth] = field(default_factory=dict)
    missing: int = 0


Wanted = tuple[tuple[Value, ...], str, str]
"""Values on the axes, model, method."""


class Mapper:
    """Computes points of one deck within a budget; references once found are kept."""

    def __init__(self, loaded: LoadedDeck, plan: Plan, report: Report = lambda share: None) -> None:
        self._loaded = loaded
        self._plan = plan
        self._report = report
        self._start = time.perf_counter()
        self._farm = Farm(plan.jobs, self._start + plan.seconds)
        self._cells: dict[tuple[str, ...], _Cell] = {}
        self._expected = 1
        self.interrupted = False
        if "explicit" in plan.methods:
            import scipy.integrate  # noqa: F401 (once here, not in every worker)

    @property
    def used(self) -> float:
        """Wall time used so far [s]."""
        return time.perf_counter() - self._start

    @property
    def over_budget(self) -> bool:
        """Whether the time is used up."""
        return self.used >= self._plan.seconds

    def compute(self, wanted: Iterable[Wanted]) -> dict[Wanted, MapPoint]:
        """Return a point for everything that is wanted, in its order; what is not reached is told so."""
        places: dict[Wanted, tuple[tuple[str, ...], str]] = {}
        for one in wanted:
            places[one] = self._queue(one)
        found: dict[Wanted, MapPoint] = {}
        self._expected = max(1, len(places))
        try:
            for outcome in self._farm.outcomes():
                self._take(outcome, found)
                self._report(len(found) / self._expected)
        except KeyboardInterrupt:
            self.interrupted = True
        for one, (overrides, refusal) in places.items():
            if refusal:
                found[one] = MapPoint(*one, Verdict("deck", refusal, "deck"), overrides=overrides)
            elif one not in found:
                found[one] = MapPoint(
                    *one, Verdict("not computed", "the budget was used up"), overrides=overrides
                )
        return {one: found[one] for one in places}

    def _queue(self, one: Wanted) -> tuple[tuple[str, ...], str]:
        """Queue what a point needs; return its overrides and, if its deck is refused, why."""
        values, model, method = one
        plan, loaded = self._plan, self._loaded
        try:
            overrides = point_overrides(loaded, plan.axes, values)
        except DeckError as error:
            return (), REFUSED + error.problems[0].message
        scene = [(axis, value) for axis, value in zip(plan.axes, values, strict=True) if not axis.solver_only]
        key = tuple(written(value) for _, value in scene)
        cell = self._cells.get(key)
        if cell is None:
            of_scene = point_overrides(loaded, [a for a, _ in scene], [v for _, v in scene])
            cell = self._cells[key] = _Cell(of_scene)
        job = Job(loaded.source.text, loaded.source.file, overrides, model, plan.limit, method=method)
        cell.waiting.append((one, job))
        for name in (TRUTH_MODEL, model):
            self._ask_reference(key, cell, name)
        self._release(cell)
        return overrides, ""

    def _ask_reference(self, key: tuple[str, ...], cell: _Cell, model: str) -> None:
        if model in cell.truths:
            return
        plan, loaded = self._plan, self._loaded
        limit = _PATIENCE * plan.limit
        job = Job(
            loaded.source.text, loaded.source.file, cell.overrides, model, limit, plan.tolerance,
            disturbed=model == TRUTH_MODEL,
        )  # fmt: skip
        cell.truths[model] = _PENDING
        cell.missing += 1
        self._farm.add(Task(("reference", key, model), solve_reference, job, limit))

    def _release(self, cell: _Cell) -> None:
        """Queue the points of a cell whose references are all there, before everything else."""
        if cell.missing:
            return
        for one, job in reversed(cell.waiting):
            truth = cell.truths[job.model]
            ready = replace(job, truth=truth if truth.status == "done" else None)
            key = ("point", one, cell)
            self._farm.add(Task(_Key(key), solve_point, ready, job.limit), first=True)
        cell.waiting.clear()

    def _take(self, outcome: Outcome, found: dict[Wanted, MapPoint]) -> None:
        if isinstance(outcome.key, _Key):
            _, one, cell = outcome.key.parts
            trial = outcome.value or Trial("lost", reason=outcome.lost)
            found[one] = self._judged(one, cell, trial)
            return
        _, key, model = outcome.key
        cell = self._cells[key]
        cell.truths[model] = outcome.value or Truth("lost", reason=outcome.lost)
        cell.missing -= 1
        self._release(cell)

    def _judged(self, one: Wanted, cell: _Cell, trial: Trial) -> MapPoint:
        values, model, method = one
        verdict = classify(trial, cell.truths[model], cell.truths[TRUTH_MODEL], self._plan.bounds)
        overrides = point_overrides(self._loaded, self._plan.axes, values)
        return MapPoint(
            values, model, method, verdict, trial.status, trial.end, trial.steps, trial.cpu, overrides
        )


_PENDING = Truth("lost", reason="not there yet")


@dataclass(frozen=True, eq=False)
class _Key:
    """Key of a point's task."""

    parts: tuple[Any, ...]


def coarse_first(count: int) -> list[int]:
    """Return the places of a row, ends first, then ever finer between them.

    Examples
    --------
    >>> coarse_first(5)
    [0, 4, 2, 1, 3]
    """
    order = [0, count - 1] if count > 1 else [0]
    gaps = [(0, count - 1)]
    while gaps:
        a, b = gaps.pop(0)
        if b - a > 1:
            middle = (a + b) // 2
            order.append(middle)
            gaps += [(a, middle), (middle, b)]
    return order


def stability_map(
    loaded: LoadedDeck,
    plan: Plan,
    bisect: float | None = None,
    report: Report = lambda share: None,
    ending: str = "accurate",
) -> StabilityMap:
    """Map a scene and put every point into a class.

    Parameters
    ----------
    loaded : LoadedDeck
    plan : Plan
    bisect : float, optional
        Relative width to which the end of a class along the one axis is located.
    report : callable
        Told the share of the points that is done, 0 to 1.
    ending : str
        That class.

    Returns
    -------
    StabilityMap
        Failed points are data; points not reached within the budget are told as not computed.

    Raises
    ------
    AxisError
        If an axis changes nothing in this deck.
    DeckError
        If the deck is refused at every point of the map.
    """
    grids = [axis.values for axis in plan.axes]
    _refuse_hopeless(loaded, plan)
    orders = [coarse_first(len(values)) for values in grids]
    places = sorted(
        product(*orders), key=lambda at: sum(order.index(i) for order, i in zip(orders, at, strict=True))
    )
    cells = [tuple(values[i] for values, i in zip(grids, at, strict=True)) for at in places]
    mapper = Mapper(loaded, plan, report)
    found = mapper.compute((values, m, k) for values in cells for m in plan.models for k in plan.methods)
    boundaries: tuple[Boundary, ...] = ()
    if bisect is not None and not mapper.interrupted:
        boundaries = _bisected(mapper, plan, found, bisect, ending)
    status = "interrupted" if mapper.interrupted else "done"
    if any(p.outcome == "not computed" for p in found.values()):
        status = "over budget" if status == "done" else status
    axes = tuple((axis.name, _along(axis, found, i), axis.logarithmic) for i, axis in enumerate(plan.axes))
    return StabilityMap(
        name=loaded.deck.name, status=status, axes=axes, bounds=plan.bounds, seconds=plan.seconds,
        used=mapper.used, points=_in_order(found.values(), plan), boundaries=boundaries,
    )  # fmt: skip


def _along(axis: Axis, found: dict[Wanted, MapPoint], index: int) -> tuple[Value, ...]:
    """Return the values of an axis with those that a bisection has added."""
    if not axis.numeric:
        return axis.values
    return tuple(sorted({values[index] for values, _, _ in found}, key=float))


def _refuse_hopeless(loaded: LoadedDeck, plan: Plan) -> None:
    """Raise what is wrong with the first point if every point of the map is refused."""
    errors: list[DeckError] = []
    for values in product(*(axis.values for axis in plan.axes)):
        try:
            point_overrides(loaded, plan.axes, values)
        except DeckError as error:
            errors.append(error)
        else:
            return
    raise errors[0]


def _in_order(points: Iterable[MapPoint], plan: Plan) -> tuple[MapPoint, ...]:
    def place(p: MapPoint) -> tuple[Any, ...]:
        at = [
            float(v) if axis.numeric else axis.values.index(v)
            for axis, v in zip(plan.axes, p.values, strict=True)
        ]
        return plan.models.index(p.model), plan.methods.index(p.method), *at

    return tuple(sorted(points, key=place))


# --- bisection -----------------------------------------------------------------------------------

_SILENT = ("deck", "no result", "not computed")
"""Classes that say nothing about the point."""
_MOST_ROUNDS = 40


def _bisected(
    mapper: Mapper, plan: Plan, found: dict[Wanted, MapPoint], width: float, ending: str
) -> tuple[Boundary, ...]:
    """Halve the gaps between points of a class and others along the one axis; add the points to `found`."""
    axis = plan.axes[0]
    rows = list(product(plan.models, plan.methods))
    gaps = {row: gap for row in rows if (gap := _gap(row, found, ending)) is not None}
    for _ in range(_MOST_ROUNDS):
        wanted = {}
        for row, (low, high) in gaps.items():
            a, b = float(low.values[0]), float(high.values[0])
            if abs(b - a) > width * max(abs(a), abs(b)):
                wanted[row] = ((axis.middle(a, b),), *row)
        if not wanted or mapper.over_budget or mapper.interrupted:
            break
        points = mapper.compute(wanted.values())
        told = {one: p for one, p in points.items() if p.outcome not in _SILENT}
        found |= told
        if len(told) < len(points):
            gaps = {row: gap for row, gap in gaps.items() if row not in wanted or wanted[row] in told}
        gaps = {row: gap for row in gaps if (gap := _gap(row, found, ending, gaps[row])) is not None}
    return tuple(_boundary(row, *gaps[row]) for row in rows if row in gaps)


def _gap(
    row: tuple[str, str],
    found: dict[Wanted, MapPoint],
    ending: str,
    within: tuple[MapPoint, MapPoint] | None = None,
) -> tuple[MapPoint, MapPoint] | None:
    """Return the first pair of neighbours of which one is of a class and one is not."""
    mine = [p for p in found.values() if (p.model, p.method) == row and p.outcome not in _SILENT]
    if within is not None:
        low, high = (float(p.values[0]) for p in within)
        mine = [p for p in mine if low <= float(p.values[0]) <= high]
    mine.sort(key=lambda p: float(p.values[0]))
    for a, b in pairwise(mine):
        if (a.outcome == ending) != (b.outcome == ending):
            return a, b
    return None


def _boundary(row: tuple[str, str], low: MapPoint, high: MapPoint) -> Boundary:
    bad = high if low.outcome == "accurate" else low
    return Boundary(
        *row, float(low.values[0]), float(high.values[0]), low.outcome, high.outcome, bad.verdict.reason
    )


# --- tables --------------------------------------------------------------------------------------

_FACTS = ("time_error", "model_error", "energy_drift", "growth", "channel", "cause", "item", "reason")


def csv_columns(result: StabilityMap) -> tuple[str, ...]:
    """Return the columns of ``stability.csv``: the axes, then what each point has."""
    names = tuple(name for name, _, _ in result.axes)
    return (*names, "model", "method", "class", "status", "end", "steps", "cpu", *_FACTS, "overrides")


def as_rows(result: StabilityMap) -> list[dict[str, object]]:
    """Return one row for each point, with the keys of `csv_columns`."""
    names = [name for name, _, _ in result.axes]
    rows: list[dict[str, object]] = []
    for p in result.points:
        facts = p.verdict.facts()
        rows.append({
            **dict(zip(names, p.values, strict=True)), "model": p.model, "method": p.method,
            "class": p.outcome, "status": p.status, "end": p.end, "steps": p.steps, "cpu": p.cpu,
            **{key: facts[key] for key in _FACTS}, "overrides": " ".join(p.overrides),
        })  # fmt: skip
    return rows


def as_facts(result: StabilityMap) -> dict[str, Any]:
    """Return the study as JSON-ready facts (``stability.json``)."""
    axes = [
        {"name": name, "values": values, "logarithmic": logarithmic}
        for name, values, logarithmic in result.axes
    ]
    points = []
    for p, row in zip(result.points, as_rows(result), strict=True):
        points.append(
            {"values": p.values, **{k: v for k, v in row.items() if k not in [a["name"] for a in axes]}}
        )
        points[-1]["overrides"] = p.overrides
    return {
        "name": result.name, "status": result.status, "axes": axes, "bounds": asdict(result.bounds),
        "reference_model": TRUTH_MODEL, "seconds": result.seconds, "used": result.used,
        "counts": result.counts(), "classes": CLASSES, "points": points,
        "boundaries": [{**asdict(b), "width": b.width} for b in result.boundaries],
    }  # fmt: skip


def summary(result: StabilityMap, total: Sequence[MapPoint] | None = None) -> str:
    """Return how many points each class has, in words.

    Examples
    --------
    >>> summary(StabilityMap("deck", "done", (), Bounds(), 60.0, 1.0, ()))
    '0 points'
    """
    counts = ", ".join(f"{count} {name}" for name, count in result.counts().items())
    return f"{len(total or result.points)} points" + (f": {counts}" if counts else "")
