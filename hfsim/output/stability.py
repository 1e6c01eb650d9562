"""Stability maps as files and as people read them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hfsim.output.pictures import drawn_by
from hfsim.output.text import Column, as_table, brief, plural, table, wrapped

if TYPE_CHECKING:
    from hfsim.output.study import Study
    from hfsim.studies.stability.results import MapPoint, StabilityMap

_LEFT = "not computed"
_WHOSE = (Column("model"), Column("method"))
_LIST = (
    Column("class", "outcome"),
    Column("time error", "verdict.time_error", brief),
    Column("model error", "verdict.model_error", brief),
    Column("drift", "verdict.energy_drift", brief),
    Column("steps", lambda p: p.trial.steps or None),
    Column("CPU [s]", lambda p: p.trial.cpu or None, ".2g"),
)


def _axis_columns(result: StabilityMap, heads: Iterable[str]) -> list[Column]:
    def value_on(axis: int) -> Callable[[MapPoint], object]:
        return lambda point: point.values[axis]

    return [Column(head, value_on(i), _word) for i, head in enumerate(heads)]


def map_facts(result: StabilityMap) -> dict[str, Any]:
    """Return a map as JSON-ready facts (``stability.json``)."""
    from hfsim.studies.stability.verdict import CLASSES, TRUTH_MODEL

    points = [{"values": p.values, **p.facts(), "overrides": p.overrides} for p in result.points]
    return {
        "name": result.name,
        "status": result.status,
        "axes": [asdict(axis) for axis in result.axes],
        "bounds": asdict(result.bounds),
        "reference_model": TRUTH_MODEL,
        "seconds": result.seconds,
        "used": result.used,
        "counts": result.counts(),
        "classes": CLASSES,
        "points": points,
        "boundaries": [{**asdict(b), "width": b.width} for b in result.boundaries],
    }


def publish_map(result: StabilityMap, study: Study, ending: str) -> None:
    """Write a map and tell it; `ending` is the class whose end was located, if any was."""
    rows = result.table()
    study.publish(
        map_facts(result),
        {"stability": (list(rows[0]) if rows else [], rows)},
        map_text(result, study.path, study.talk.verbose, ending),
        drawn_by("stability:draw_stability", result),
    )


def map_text(result: StabilityMap, folder: Path, verbose: bool = False, ending: str = "accurate") -> str:
    """Return a map as people read it: the classes over the axes, the ends of classes, the reasons."""
    head = f"{result.name}: {result.summary}; {result.used:.3g} s used"
    bounds = f"  bounds: error {result.bounds.error:g}, energy drift {result.bounds.drift:g}"
    ends = _boundaries(result, ending) if result.boundaries else ""
    blocks = [f"{head}\n{bounds}", *_tables(result), ends, "\n".join(_reasons(result, verbose))]
    return "\n\n".join([*filter(None, blocks), f"  results: {folder}/"])


def _tables(result: StabilityMap) -> list[str]:
    if len(result.axes) == 2:
        return [_grid(result, model, method) for model, method in result.rows()]
    reached = [p for p in result.points if p.outcome != _LEFT]
    axes = _axis_columns(result, (axis.label for axis in result.axes))
    return [table([*_WHOSE, *axes, *_LIST], reached)] if reached else []


def _word(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:.4g}"


def _grid(result: StabilityMap, model: str, method: str) -> str:
    down, across = result.axes
    rows, columns = down.values, across.values
    points = result.points_of(model, method)
    head = [f"{down.label} \\ {across.label}", *map(_word, columns)]
    lines = [[_word(r), *(points[r, c].outcome for c in columns)] for r in rows]
    return f"{model}, {method}\n" + as_table([head, *lines])


def _boundaries(result: StabilityMap, ending: str) -> str:
    name = result.axes[0].label
    columns = [
        *_WHOSE,
        Column(f"{name}: last", "below", ".5g"),
        Column("first", "above", ".5g"),
        Column("class", "class_below"),
        Column("then", "class_above"),
    ]
    return f"where '{ending}' ends along {name}\n" + table(columns, result.boundaries)


def _reasons(result: StabilityMap, verbose: bool) -> Iterable[str]:
    """Yield why points are not accurate: of each class the first one of every model and method, or all."""
    told = set()
    for reason, count in Counter(p.verdict.reason for p in result.points if p.outcome == _LEFT).items():
        yield wrapped(f"{plural(count, 'point')} {_LEFT}: {reason}")
    for p in result.points:
        key = (p.model, p.method, p.outcome)
        if p.outcome in ("accurate", _LEFT) or (key in told and not verbose):
            continue
        told.add(key)
        places = zip(result.axes, p.values, strict=True)
        at = [f"{axis.name} {_word(value)} {axis.unit}".rstrip(" -") for axis, value in places]
        yield wrapped(f"{', '.join([p.model, p.method, *at])}: {p.outcome}: {p.verdict.reason}")
