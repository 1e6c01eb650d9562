"""Tables of a deck that stand in CSV files: laws of time, and springs."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any, NamedTuple, TypeAlias

from hfsim.deck.files import FileRefusedError, Folder, Text
from hfsim.deck.reader import Mark, Path, dotted
from hfsim.deck.source import DeckSource, did_you_mean
from hfsim.deck.units import plain_number
from hfsim.errors import DeckProblem

MOST_POINTS = 20_000
"""Rows of all tables of a deck together: it is written with them, and must be one that can be read."""
_MOST_TOLD = 20
"""Problems of a table that are told."""
_DELIMITERS = ",;\t"
_QUOTED = r"""\"(?:[^"]|"")*"|'[^']*'"""


class _Cell(NamedTuple):
    """A piece of a line: its text without blanks and quotes around it, and where it stands."""

    text: str
    mark: Mark


_Columns: TypeAlias = tuple[list[_Cell], list[_Cell]]


class _Wrong(Exception):  # noqa: N818
    """A table that cannot be read, with all that is wrong with it."""

    def __init__(self, *problems: DeckProblem) -> None:
        super().__init__()
        self.problems = problems


def read_tables(source: DeckSource, folder: Folder) -> None:
    """Put points in place of the files that tables of a deck name; note what is wrong."""
    left = MOST_POINTS
    for path, entry in [*_entries(source.data, ())]:
        try:
            columns = _columns(source, folder, path, entry)
            left -= len(columns[0])
            if left < 0:
                message = f"more than {MOST_POINTS} rows, those of all tables counted"
                raise _Wrong(source.problem((*path, "table"), message))
        except _Wrong as wrong:
            for problem in wrong.problems:
                source.fail(path, problem)
            continue
        _put(source, path, entry, columns)


def _entries(data: Any, path: Path) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Yield the maps that name a file as their table."""
    if path == ("parameters",):
        return
    if isinstance(data, dict):
        if isinstance(data.get("table"), str):
            yield path, data
        for key, value in data.items():
            yield from _entries(value, (*path, key))
    elif isinstance(data, list):
        for index, value in enumerate(data):
            yield from _entries(value, (*path, index))


def _columns(source: DeckSource, folder: Folder, path: Path, entry: dict[str, Any]) -> _Columns:
    """Return the two columns that an entry asks for; their texts are numbers."""
    at, mark = (*path, "table"), source.mark((*path, "table"))
    try:
        file = folder.read(entry["table"], mark.file if mark else "")
    except FileRefusedError as error:
        raise _Wrong(source.problem(at, error.message, error.hint)) from None
    for key in ("times", "values"):
        if key in entry:
            raise _Wrong(source.problem((*path, key), "the file of the table says this", "remove one", True))
    source.others[file.name] = file.text
    rows = _rows(file)
    header = next(rows, [])
    if len(header) < 2 or all(plain_number(cell.text) is not None for cell in header):
        where = Mark(header[0].mark.line if header else 1, 1, 1, file.name)
        message = "a table has at least two columns and begins with their names"
        raise _Wrong(_wrong(at, message, where))
    found = [_place(source, path, entry, header, k) for k in range(2)]
    columns: _Columns = ([], [])
    problems = [*_twice(at, header, found)]
    for row in rows:
        problems += _misfits(at, header, row)
        for k, column in zip(found, columns, strict=True):
            cell = row[k] if k < len(row) else _Cell("", row[-1].mark)
            number = plain_number(cell.text)
            if number is None or not math.isfinite(number):
                message = f"{header[k].text} must be a number, not '{cell.text}'"
                problems.append(_wrong(at, message, cell.mark))
            column.append(cell)
        if len(problems) >= _MOST_TOLD or len(columns[0]) > MOST_POINTS:
            break
    if len(columns[0]) < 2 and not problems:
        problems.append(_wrong(at, "a table has at least two rows of numbers", header[0].mark))
    if problems:
        raise _Wrong(*problems)
    return columns


def _twice(path: Path, header: Sequence[_Cell], found: Sequence[int]) -> Iterator[DeckProblem]:
    """Yield that a name that is asked for is that of two columns."""
    names = [cell.text for cell in header]
    for k in found:
        if names.count(names[k]) > 1:
            yield _wrong(path, f"two columns are called '{names[k]}'", header[k].mark)


def _misfits(path: Path, header: Sequence[_Cell], row: Sequence[_Cell]) -> Iterator[DeckProblem]:
    """Yield that a row says more than it has columns for."""
    beyond = next((cell for cell in row[len(header) :] if cell.text), None)
    if beyond is not None:
        message = f"{len(row)} values for {len(header)} columns"
        yield _wrong(path, message, beyond.mark, "numbers have a point, not a comma")


def _rows(file: Text) -> Iterator[list[_Cell]]:
    """Yield the cells of each line that is neither empty nor a comment."""
    delimiter = ""
    for number, line in enumerate(file.text.splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        delimiter = delimiter or next((one for one in _DELIMITERS if one in re.sub(_QUOTED, "", line)), ",")
        row = []
        for found in _cell_pattern(delimiter).finditer(line):
            piece, start = found[1], found.start(1)
            text = piece.strip()
            start += len(piece) - len(piece.lstrip()) if text else 0
            row.append(_Cell(_unquoted(text), Mark(number, start + 1, max(len(text), 1), file.name)))
        yield row


@cache
def _cell_pattern(delimiter: str) -> re.Pattern[str]:
    """Return what finds the cells of a line; a delimiter in quotes that are a whole cell's is none."""
    blank = rf"[^\S{delimiter}]*"
    quoted = f"{blank}(?:{_QUOTED}){blank}"
    return re.compile(rf"(?:^|{delimiter})({quoted}|[^{delimiter}]*)(?={delimiter}|$)")


def _unquoted(text: str) -> str:
    """Return a cell without the quotes around it; one that stands alone is part of it."""
    quoted = len(text) > 1 and text[0] == text[-1] and text[0] in "\"'"
    return text[1:-1].replace('""', '"') if quoted else text


def _place(source: DeckSource, path: Path, entry: dict[str, Any], header: Sequence[_Cell], k: int) -> int:
    """Return the place of the column of times, or of values, in the rows."""
    key = ("time_column", "column")[k]
    wanted, names = entry.get(key), [cell.text for cell in header]
    if wanted is None or path[:1] == ("springs",):
        return k
    if wanted not in names:
        message = f"the table has no column '{wanted}'"
        raise _Wrong(source.problem((*path, key), message, did_you_mean(str(wanted), names)))
    return names.index(wanted)


def _put(source: DeckSource, path: Path, entry: dict[str, Any], columns: _Columns) -> None:
    """Put the points of a table into an entry, each at home in its line of the file."""
    numbers = [[float(cell.text) for cell in column] for column in columns]
    if path[:1] == ("springs",):
        entry["table"] = [list(pair) for pair in zip(*numbers, strict=True)]
        for k, cells in enumerate(zip(*columns, strict=True)):
            source.value_marks[(*path, "table", k)] = cells[0].mark
            source.value_marks.update({(*path, "table", k, i): cell.mark for i, cell in enumerate(cells)})
        return
    mark = source.mark((*path, "table"))
    for key in ("table", "column", "time_column"):
        entry.pop(key, None)
    entry.setdefault("type", "table")
    for key, column, values in zip(("times", "values"), columns, numbers, strict=True):
        entry[key] = values
        if mark is not None:
            source.value_marks[(*path, key)] = mark
        source.value_marks.update({(*path, key, k): cell.mark for k, cell in enumerate(column)})


def _wrong(path: Path, message: str, mark: Mark, hint: str = "") -> DeckProblem:
    return DeckProblem(dotted(path), message, hint, *mark)
