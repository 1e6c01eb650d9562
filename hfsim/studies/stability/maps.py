"""Stability maps: one scene over one or two axes, with methods and models, every point in a class.

Cells (one deck each) are taken in an order that covers the map coarsely first, so that one whose budget
runs out is coarse rather than cut off.  Nothing is printed or written here.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise, product
from typing import Any

from hfsim.deck.overrides import unit_of
from hfsim.deck.ranges import Value
from hfsim.deck.source import path_in
from hfsim.errors import DeckError
from hfsim.marching.stop import Progress, nobody
from hfsim.scene.loading import LoadedDeck
from hfsim.studies.axes import Axis, point_overrides
from hfsim.studies.farm import Executor
from hfsim.studies.stability.asked import Plan
from hfsim.studies.stability.mapper import Mapper
from hfsim.studies.stability.results import Boundary, MapAxis, MapPoint, StabilityMap, Wanted

_SILENT = ("deck", "no result", "not computed")
"""Classes that say nothing about the point."""
_MOST_ROUNDS = 40


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
    loaded: LoadedDeck, plan: Plan, executor: Executor, report: Progress = nobody
) -> StabilityMap:
    """Map a scene and put every point into a class.

    Parameters
    ----------
    executor : Executor
        What computes the points.
    report : callable
        Told the share of the points that is done, 0 to 1.

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
    _refuse_hopeless(loaded, plan)
    mapper = Mapper(loaded, plan, executor, report)
    rows = [(model, method) for method in plan.methods for model in plan.models]
    found = mapper.compute((values, *row) for values in _coarse_cells(plan.axes) for row in rows)
    boundaries: tuple[Boundary, ...] = ()
    if plan.bisect is not None and not mapper.interrupted:
        boundaries = bisected(mapper, plan, found)
    left = any(p.outcome == "not computed" for p in found.values())
    status = "interrupted" if mapper.interrupted else "over budget" if left else "done"
    axes = []
    for i, axis in enumerate(plan.axes):
        unit = axis.unit or unit_of(loaded.deck, path_in(loaded.source.data, axis.name))
        axes.append(MapAxis(axis.name, _along(axis, found, i), axis.logarithmic, unit))
    return StabilityMap(
        name=loaded.deck.name, status=status, axes=tuple(axes), bounds=plan.bounds, seconds=plan.seconds,
        used=mapper.used, points=_in_order(found.values(), plan), boundaries=boundaries,
    )  # fmt: skip


def _coarse_cells(axes: Sequence[Axis]) -> list[tuple[Value, ...]]:
    """Return the values of all cells, in an order that covers the map coarsely first."""
    ranked = [list(enumerate(axis.values[i] for i in coarse_first(len(axis.values)))) for axis in axes]
    cells = sorted(product(*ranked), key=lambda cell: sum(rank for rank, _ in cell))
    return [tuple(value for _, value in cell) for cell in cells]


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


# --- where a class ends --------------------------------------------------------------------------


def bisected(mapper: Mapper, plan: Plan, found: dict[Wanted, MapPoint]) -> tuple[Boundary, ...]:
    """Halve the gaps between points of a class and others along the one axis; add the points to `found`."""
    axis, width, ending = plan.axes[0], plan.bisect or 0.0, plan.ending
    rows = list(product(plan.models, plan.methods))
    gaps = {row: gap for row in rows if (gap := _gap(row, found, ending)) is not None}
    for _ in range(_MOST_ROUNDS):
        wanted = {}
        for row, (low, high) in gaps.items():
            a, b = float(low.values[0]), float(high.values[0])
            if abs(b - a) > width * max(abs(a), abs(b)):
                wanted[row] = ((axis.middle(a, b),), *row)
        if not wanted or mapper.used >= plan.seconds or mapper.interrupted:
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
