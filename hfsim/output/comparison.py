"""What people read of a comparison of models, as text and as one page, and the columns of its table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

from hfsim.marching.distance import ChannelScale
from hfsim.output.page import doubts, html_table, origin, page, pictures, section
from hfsim.output.text import Column, for_a_file, line_width, plural, table, wrapped
from hfsim.output.writers import warnings_of
from hfsim.studies.compare.difference import Difference
from hfsim.studies.compare.result import Comparison, ModelResult, percent
from hfsim.studies.timing import Spread

_PHASES = ("build", "error_estimate", "write", "plots")
"""Phases told beside the solution."""

# --- compare.csv ---------------------------------------------------------------------------------


class Row(NamedTuple):
    """One row of ``compare.csv``: a channel of a model."""

    model: ModelResult
    scale: ChannelScale
    found: Difference | None


def as_rows(comparison: Comparison) -> Iterator[Row]:
    """Yield the rows of ``compare.csv``, whose columns are `COLUMNS`.

    A model that broke down at once shares no time with the reference and still gets its rows.
    """
    for model in comparison.models:
        yield from (Row(model, scale, model.difference(scale.channel)) for scale in comparison.scales)


COLUMNS = (
    Column("model", "model.model"),
    *(Column(name, f"scale.{name}") for name in ("channel", "unit")),
    *(Column(name, f"found.{name}") for name in ("max_abs", "max_relative", "rms", "time_of_max")),
    Column("first_exceeded", "found.first_exceeded"),
    *(Column(name, f"scale.{name}") for name in ("reference_range", "scale", "small", "judged")),
    *(Column(name, f"model.{name}") for name in ("status", "stop_time", "solve_cpu", "adequate")),
    *(Column(name, f"found.{name}") for name in ("time_error", "beyond", "equal")),
    *(Column(name, f"model.{name}") for name in ("solve_cpu_min", "solve_cpu_max", "coordinates")),
    Column("group", "scale.group"),
)
"""Columns of ``compare.csv``."""

# --- text ----------------------------------------------------------------------------------------


def as_text(comparison: Comparison, folder: Path) -> str:
    """Return the comparison as people read it: times, differences, breakdowns, verdict."""
    head = f"{comparison.name}: {plural(len(comparison.models), 'model')} over {comparison.duration:.6g} s, "
    head += f"reference {comparison.reference}"
    costs = table(cost_columns(comparison), comparison.models) + "\n"
    remarks = "".join(f"{wrapped(line)}\n" for line in (*marks_in(comparison), *doubts_on(comparison)))
    blocks = [head, costs, _difference_table(comparison), remarks]
    verdict = wrapped(comparison.sentence, "", "  ")
    return "\n".join([*filter(None, blocks), f"  results: {folder}/", verdict])


def cost_columns(comparison: Comparison) -> tuple[Column, ...]:
    """Return the columns of the table of models: how they ended, cost, error in time, worst difference."""
    marks = {scale.channel: _mark(scale) for scale in comparison.scales}

    def worst(model: ModelResult) -> str:
        if model.model == comparison.reference:
            return "reference"
        if model.worst is None or model.worst.equal:
            return "equal within the time error" if model.worst else "-"
        return f"{percent(model.worst.beyond)} {model.worst.channel}{marks.get(model.worst.channel, '')}"

    def time_of(phase: str) -> Column:
        name, spare = phase.replace("_", " "), 2 + _PHASES.index(phase)
        return Column(name, lambda model: f"{model.cpu_s.get(phase, 0.0):.3f} s", spare=spare)

    return (
        Column("model"),
        Column("method"),
        Column("coordinates", spare=1),
        Column("outcome", lambda model: model.ended if model.broke_down else "done"),
        Column("CPU: solve", _solve),
        *(time_of(phase) for phase in _PHASES if any(phase in m.cpu_s for m in comparison.models)),
        Column("time error", lambda model: None if model.time_error is None else percent(model.time_error)),
        Column("worst beyond time error", worst),
    )


def _solve(model: ModelResult) -> str | None:
    if not model.repeats:
        return None
    spread = Spread(model.solve_cpu, model.solve_cpu_min, model.solve_cpu_max)
    return f"{model.solve_cpu:.4f} s" + (f" {spread.percent}" if model.repeats > 1 else "")


def difference_columns(comparison: Comparison) -> tuple[tuple[Column, ...], list[Column]]:
    """Return the columns of the table of channels, and those with the differences of each model."""

    def difference_of(model: ModelResult) -> Column:
        return Column(model.model, lambda scale: _difference(model, scale))

    head = (
        Column("largest difference", lambda scale: scale.channel + _mark(scale)),
        Column("unit"),
        Column("range", "reference_range", ".4g"),
    )
    return head, [difference_of(m) for m in comparison.models if m.model != comparison.reference]


def _difference_table(comparison: Comparison) -> str:
    head, others = difference_columns(comparison)
    if not others or not comparison.scales:
        return ""
    room = line_width()
    for beside in range(len(others), 0, -1):  # as many models side by side as there is room for
        groups = [others[n : n + beside] for n in range(0, len(others), beside)]
        with for_a_file():  # no name is cut yet
            tables = [table((*head, *group), comparison.scales) for group in groups]
        if max(len(line) for text in tables for line in text.split("\n")) <= room:
            break
    return "\n\n".join(table((*head, *group), comparison.scales) for group in groups) + "\n"


def _mark(scale: ChannelScale) -> str:
    return (" *" if scale.small else "") if scale.judged else " -"


def _difference(model: ModelResult, scale: ChannelScale) -> str:
    found = model.difference(scale.channel)
    if found is None:
        return "-"
    if found.equal:
        return f"{found.max_abs:.3g} ="
    return f"{found.max_abs:.3g}" + (f" ({percent(found.max_relative)})" if scale.judged else "")


def marks_in(comparison: Comparison) -> Iterator[str]:
    """Yield what marks in the table of channels mean."""
    small = dict.fromkeys(f"{s.scale:.2g} {s.unit}" for s in comparison.scales if s.small and s.judged)
    if small:
        instead = f"relative to {', '.join(small)} instead (1/1000 of the scene's scale)"
        yield f"* range too small to judge by: {instead}"
    if any(not scale.judged for scale in comparison.scales):
        yield "- not judged"
    if any(found.equal for model in comparison.models for found in model.differences):
        yield "= equal within the errors in time of both"


def doubts_on(comparison: Comparison) -> Iterator[str]:
    """Yield what the comparison cannot tell, and when and why models left their range, or ended."""
    yield from _blind_spots(comparison)
    for model in comparison.models:
        yield from (f"{model.model} {words}" for words in _departure(model))


def _blind_spots(comparison: Comparison) -> Iterator[str]:
    scales = comparison.scales
    if not any(s.judged and s.group == "motion" for s in scales) and any(s.judged for s in scales):
        judged = ", ".join(s.channel for s in scales if s.judged)
        yield f"no position, angle or deflection is judged; the verdict rests on {judged}"
    alike = {m.model: m.coordinates for m in comparison.models if m.model in ("exact", "ancf")}
    if len(alike) == 2 and len(set(alike.values())) == 1:
        yield "exact and ancf make the same steps in the same coordinates: that they agree checks nothing"


def _departure(model: ModelResult) -> Iterator[str]:
    """Yield when and why a model left its range, passed the bound, or ended."""
    for time, body, why in model.left_range:
        yield f"leaves its range at {time:.4g} s, in {body}: {why}"
    if model.undecided is not None:
        error, channel = percent(model.undecided.time_error_relative or 0.0), model.undecided.channel
        yield f"is not decided: errors in time, {error} in {channel}, are beyond the bound; tighten tolerance"
    first = model.first_exceeded
    if first is not None:
        yield f"first passes the bound at {first.first_exceeded:.4g} s, in {first.channel}"
    if model.broke_down:
        yield model.why_ended


# --- page ----------------------------------------------------------------------------------------


def comparison_page(comparison: Comparison, deck: str, facts: Mapping[str, Any], folder: Path) -> str:
    """Return a comparison as one page of HTML: verdict, tables, what is doubtful, overlays, deck.

    Parameters
    ----------
    deck : str
        The text of the deck.
    facts : mapping
        What ``compare.json`` has, the pictures among its files.
    folder : Path
        Of these.
    """
    runs = comparison.runs.items()
    warnings = [f"{model}: {warning}" for model, run in runs for warning in warnings_of(run)]
    head, others = difference_columns(comparison)
    marks = "".join(f"<p>{escape(mark)}</p>" for mark in marks_in(comparison))
    parts = [
        section("Verdict", f"<p>{escape(comparison.sentence.removeprefix('verdict: '))}</p>"),
        section("Models", _table(cost_columns(comparison), comparison.models)),
        section("Differences", _table((*head, *others), comparison.scales) + marks),
        section("What is doubtful", doubts([*doubts_on(comparison), *warnings, *facts.get("warnings", ())])),
        *pictures(folder, facts["files"]),
        *origin(facts, deck),
    ]
    return page(f"{comparison.name}: models compared", parts, facts["versions"])


def _table(columns: Sequence[Column], rows: Sequence[Any]) -> str:
    return html_table([one.name for one in columns], [[one.text(row) for one in columns] for row in rows])
