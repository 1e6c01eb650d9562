"""What people read of a bench, and the columns of its table."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from hfsim.marching.distance import group_of
from hfsim.output.pictures import drawn_by
from hfsim.output.text import Column, as_table, brief, table, wrapped
from hfsim.parts.channels import kind_of
from hfsim.studies.agreement import tidy
from hfsim.studies.bench.advice import pareto, recommend
from hfsim.studies.bench.points import Cell, ChannelError, Point, mesh_words, observed_order
from hfsim.studies.bench.result import OF_POINT, Bench, as_facts
from hfsim.studies.timing import Spread

if TYPE_CHECKING:
    from hfsim.output.study import Study

_NO_ORDER = 0.5
"""Order, from the coarsest to the finest mesh, below which a channel does not converge."""

# --- bench.csv -----------------------------------------------------------------------------------


class Row(NamedTuple):
    """One row of ``bench.csv``: a channel of a point; none where a point has no channels."""

    cell: Cell
    point: Point
    error: ChannelError | None


def as_rows(result: Bench) -> Iterator[Row]:
    """Yield the rows of ``bench.csv``, whose columns are `COLUMNS`."""
    for cell in result.cells:
        for point in result.points_of(cell):
            yield from (Row(cell, point, error) for error in point.channels or (None,))


def _of_channel(name: str) -> Callable[[Row], object]:
    return lambda row: row.error and getattr(row.cell, name).get(row.error.channel)


_OF_CELL = ("unknowns", "mesh_error", "model_error", "floor")
_OF_ERROR = ("unit", "max_abs", "max_relative", "rms_relative", "below_floor", "judged")

COLUMNS = (
    *(Column(name, f"point.{name}") for name in OF_POINT),
    *(Column(name, f"cell.{name}") for name in _OF_CELL),
    Column("channel", "error.channel"),
    *(Column(f"channel_{name}", f"error.{name}") for name in _OF_ERROR),
    Column("channel_floor", _of_channel("floors")),
    Column("channel_mesh_error", _of_channel("mesh_errors")),
    Column("channel_group", lambda row: row.error and group_of(row.error.unit)),
)
"""Columns of ``bench.csv``."""


def publish_bench(result: Bench, study: Study) -> None:
    """Write and tell a bench."""
    tables, draw = {"bench": (COLUMNS, as_rows(result))}, drawn_by("bench:draw_bench", result)
    study.publish(as_facts(result), tables, as_text(result, study.path), draw)


# --- text ----------------------------------------------------------------------------------------


def as_text(result: Bench, folder: Path) -> str:
    """Return the study as people read it: a table for each model and mesh, the mesh errors, the advice."""
    blocks = [f"{result.name}: error against CPU time over {result.duration:.6g} s, {result.used:.3g} s used"]
    blocks += [_cell_text(cell, result.points_of(cell)) for cell in result.cells]
    blocks += [_mesh_tables(result)] if any(c.mesh_error is not None for c in result.cells) else []
    advice = (wrapped(one, "", "  ") for one in result.recommendations)
    return "\n\n".join([*blocks, "\n".join([f"  results: {folder}/", *advice])])


def _cell_text(cell: Cell, points: Sequence[Point]) -> str:
    head = f"{cell.model}, {cell.mesh}, {cell.unknowns} unknowns"
    if cell.floor is None:
        lines = [f"{head}: no reference: {cell.reason}"]
    else:
        floors = ", ".join(f"{tidy(floor)} ({group})" for group, floor in cell.group_floors.items())
        cost = f"  error floor {floors or tidy(cell.floor)}, {cell.reference_cpu:.2g} s CPU"
        lines = [wrapped(f"{head}; reference: {cell.reference},", "", "  "), wrapped(cost.lstrip())]
    return "\n".join([*lines, *_point_table(points), *_remarks(points)])


def _spread(point: Point) -> str:
    if point.repeats < 2 or not point.cpu:
        return "-"
    return Spread(point.cpu, point.cpu_min or 0.0, point.cpu_max or 0.0).percent


_COST = (
    Column("at"),
    Column("CPU [s]", "cpu", ".3g"),
    Column("spread", _spread, spare=2),
    Column("error", lambda point: _error(point)),
)
_WITH_MESH = Column("with mesh", "total_error", brief)
_DETAILS = (
    Column("rms", lambda point: None if point.below_floor else point.rms_error, brief, 3),
    Column("worst channel", lambda point: point.worst_channel or point.status),
    Column("drift", "energy_drift", brief, 1),
    Column("steps"),
    Column("rejected", spare=5),
    Column("Newton", "newton_iterations", spare=4),
    Column("evaluations", spare=6),
)


def _point_table(points: Sequence[Point]) -> list[str]:
    shown, front = [p for p in points if p.cpu is not None], pareto(points)
    if not shown:
        return []
    method = Column("method", lambda point: point.method + (" *" if point in front else ""))
    totals = [_WITH_MESH] if any(p.total_error is not None for p in shown) else []
    groups = next((tuple(p.groups) for p in shown if p.groups), ())
    beside = [_of_group(group) for group in groups[1:]]
    columns = [method, *_COST, *totals, *_DETAILS[:2], *beside, *_DETAILS[2:]]
    what = f"  error, worst channel: of {groups[0]}" if beside else ""
    return [table(columns, shown), "  * nothing cheaper comes near its error", *filter(None, [what])]


def _of_group(group: str) -> Column:
    return Column(group, lambda point: _error(point.of_group(group)))


def _error(point: Point) -> str:
    return ("< " if point.below_floor else "") + brief(point.error)


def _remarks(points: Sequence[Point]) -> list[str]:
    """Return lines on what failed, was cut off or was never run."""
    ended = [p for p in points if p.status in ("failed", "limit", "over budget")]
    lines = [wrapped(f"{p.method}, {p.level}: {p.status}: {p.reason}") for p in ended]
    for method in dict.fromkeys(p.method for p in points):
        left = [p for p in points if p.method == method and p.status == "skipped"]
        if left:
            until = "" if len(left) == 1 else f" and {len(left) - 1} tighter"
            lines.append(wrapped(f"{method}, {left[0].level}{until}: skipped: {left[0].reason}"))
    return lines


def _mesh_tables(result: Bench) -> str:
    """Return the mesh errors: the worst of each mesh with what suffices for it, and each channel's."""
    columns = (
        *map(Column, ("model", "elements")),
        Column("degree", spare=3),
        Column("unknowns", spare=2),
        Column("mesh error", "mesh_error", brief),
        Column("in", "mesh_channel"),
        Column("order", "mesh_order", ".1f", 1),
        Column("reached within a tenth by", lambda cell: _enough(cell, result)),
    )
    meshed = [cell for cell in result.cells if cell.mesh_error is not None]
    finest = dict.fromkeys(f"{c.mesh_reference_words} ({c.model})" for c in meshed)
    head = f"mesh errors, against {', '.join(finest)}; tighter tolerances than the last column's"
    blocks = [wrapped(f"{head} are wasted", "", "  "), table(columns, meshed)]
    for model in dict.fromkeys(cell.model for cell in meshed):
        for degree in result.degrees(model):
            cells = result.meshed(model, degree)
            blocks += ["", _channel_table(cells), *_stubborn(cells)] if cells else []
        blocks += _degree_table(result, model)
    return "\n".join(blocks)


def _enough(cell: Cell, result: Bench) -> str:
    best = recommend(result.points_of(cell), 1.1 * cell.mesh_error) if cell.mesh_error else None
    return "-" if best is None else f"{best.method}, {best.level}: {best.cpu:.3g} s"


def _channel_table(cells: Sequence[Cell]) -> str:
    rows = [[f"{cells[0].model}: mesh error (order)", *(cell.mesh for cell in cells)]]
    for name, first in cells[0].mesh_errors.items():
        texts = [brief(first)]
        for coarse, fine in pairwise(cells):
            order = observed_order(coarse, fine, name)
            texts.append(brief(fine.mesh_errors[name]) + (f" ({order:.1f})" if order is not None else ""))
        rows.append([name, *texts])
    return as_table(rows)


def _stubborn(cells: Sequence[Cell]) -> list[str]:
    """Return a remark on channels that finer meshes do not mend: they rule every recommendation out."""
    if len(cells) < 2:
        return []
    orders = {name: observed_order(cells[0], cells[-1], name) for name in cells[0].mesh_errors}
    first = cells[0].groups[:1]
    counted = (name for name in orders if not first or group_of(kind_of(name).unit) == first[0])
    names = [name for name in counted if (order := orders[name]) is not None and order < _NO_ORDER]
    what = f"the mesh error of {', '.join(names)} hardly falls from mesh to mesh"
    return [wrapped(f"{what}; to judge by the others: --set output.channels=[...]")] if names else []


def _degree_table(result: Bench, model: str) -> list[str]:
    """Return the cheapest way to each total error by elements of each degree; nothing with one degree."""
    degrees = result.degrees(model)
    rows = [["total error", *(f"degree {degree}: CPU [s]" for degree in degrees)]]
    for target in (10.0**-exponent for exponent in range(1, 9)) if len(degrees) > 1 else ():
        found = [recommend(result.points_of_degree(model, degree), target) for degree in degrees]
        if not any(found):
            break
        texts = [f"{p.cpu:.3g} ({mesh_words(p.elements, 3)}, {p.level})" if p else "-" for p in found]
        rows.append([f"{target:.0e}", *texts])
    head = f"{model}: cheapest setting of each degree for an error, that of the mesh included"
    return ["", head, as_table(rows)] if len(rows) > 1 else []
