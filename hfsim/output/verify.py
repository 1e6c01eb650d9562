"""How a verification is shown: as text, as a table of Markdown, as columns of a file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

from hfsim.output.text import Column, brief, plural, table, wrapped

if TYPE_CHECKING:
    from hfsim.studies.verify.result import Row, Verification
    from hfsim.studies.verify.study import Entry

_SPOKEN = {"held": "ok", "missed": "MISSED", "failed": "FAILED"}
_DIGITS = 12


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.{_DIGITS}g}"


def _what(row: Row) -> str:
    """Return a quantity, with its study where that is no run."""
    return row.quantity if row.study == "run" else f"{row.study}: {row.quantity}"


def _set(row: Row) -> str:
    """Return what is set for a row."""
    return ", ".join(f"{path}: {_plain(value)}" for path, value in row.variant.items())


def _plain(value: Any) -> str:
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}: {_plain(one)}' for key, one in value.items())}}}"
    if isinstance(value, list):
        return f"[{', '.join(map(_plain, value))}]"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


COLUMNS = (
    Column("deck"), Column("quantity"),
    Column("set", _set),
    *map(Column, ("study", "published", "found", "difference", "bound", "unit", "time_error")),
    *map(Column, ("verdict", "grade", "source", "reason")),
)  # fmt: skip
"""Columns of ``verify.csv``."""

_TEXT = (
    Column("quantity", _what),
    Column("published", "published", _number),
    Column("found", "found", _number),
    Column("difference", "difference", brief),
    Column("bound", "bound", brief),
    Column("unit", lambda row: row.unit or "-"),
    Column("grade", lambda row: row.grade or "-", spare=2),
    Column("in time", "time_error", brief, spare=1),
    Column("", lambda row: _SPOKEN.get(row.verdict, row.verdict)),
)


def as_text(result: Verification) -> str:
    """Return a table for each deck, and how many values hold."""
    blocks = []
    for name, rows in _by_deck(result):
        misses = [wrapped(f"{_what(row)}: {row.reason}") for row in rows if row.reason]
        lines = _indented(table(_TEXT, rows).splitlines(), rows)
        blocks.append("\n".join([_head(name, rows[0]), *lines, *misses]))
    count = plural(len(result.rows), "published value")
    last = f"{result.held} of {count} within their bounds; {result.used:.3g} s used"
    return "\n\n".join([*blocks, last])


def _indented(lines: Sequence[str], rows: Sequence[Row]) -> Iterator[str]:
    """Yield the lines of a table with a line for what is set before the rows that share it."""
    yield lines[0]
    before = ""
    for line, row in zip(lines[1:], rows, strict=True):
        if (changed := _set(row)) != before:
            yield wrapped(f"with {changed}:" if changed else "as it is:")
            before = changed
        yield line


def _by_deck(result: Verification) -> Iterator[tuple[str, list[Row]]]:
    yield from ((name, list(rows)) for name, rows in groupby(result.rows, lambda row: row.deck))


def _head(name: str, row: Row) -> str:
    return f"{name}: {row.source}"


def as_markdown(result: Verification) -> str:
    """Return the same for pages."""
    blocks = [f"### {_head(name, rows[0])}\n\n{_table(rows)}" for name, rows in _by_deck(result)]
    return "\n\n".join(blocks)


def _table(rows: Sequence[Row]) -> str:
    """Return a table of Markdown, with a line for what is set before the rows that share it."""
    columns = [Column("quantity", lambda row: f"`{_what(row)}`"), *_TEXT[1:7], _TEXT[-1]]
    cells = [[one.name for one in columns], ["---"] * len(columns)]
    before = ""
    for row in rows:
        if (changed := _set(row)) != before:
            cells.append([f"with `{changed}`" if changed else "as it is", *[""] * (len(columns) - 1)])
            before = changed
        cells.append([one.text(row) for one in columns])
    return "\n".join(f"| {' | '.join(one)} |" for one in cells)


_LIST = (
    Column("deck", "name"),
    Column("values", lambda entry: len(entry.rows)),
    Column("grade", lambda entry: entry.grades or None),
    Column("about [s]", lambda entry: entry.published.seconds, ".3g"),
    Column("source", lambda entry: entry.published.source),
)


def as_list(entries: Sequence[Entry]) -> str:
    """Return what there is to be verified."""
    return table(_LIST, entries, text_last=True)


def list_facts(entries: Sequence[Entry]) -> list[dict[str, Any]]:
    """Return the same as JSON-ready facts of each."""
    return [
        {"name": one.name, "file": one.file, "source": one.published.source, "grade": one.grades,
         "seconds": one.published.seconds, "quantities": [row.quantity for row in one.rows]}
        for one in entries
    ]  # fmt: skip
