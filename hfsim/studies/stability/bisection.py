"""Where a class ends along the one axis of a map, by halving the gaps between points."""

from __future__ import annotations

from itertools import pairwise, product

from hfsim.studies.stability.asked import Plan
from hfsim.studies.stability.mapper import Mapper
from hfsim.studies.stability.results import Boundary, MapPoint, Wanted

_SILENT = ("deck", "no result", "not computed")
"""Classes that say nothing about the point."""
_MOST_ROUNDS = 40


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
