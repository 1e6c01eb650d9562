"""Tables and numbers as people read them."""

from __future__ import annotations

import json
import math
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, NamedTuple

WIDTH = 110
"""Characters of a line where there is no terminal, and of sentences at most."""
_NARROWEST = 50
"""Characters of a line at least."""
_NAME, _SENTENCE = 10, 30
"""Characters that are always shown of a name, and beyond which a text may be cut, too."""
_LONG = 18
"""Characters from which a word is a long name."""
_file = ContextVar("file", default=False)


def digits_left(value: float, error: float, least: int, most: int) -> int:
    """Return how many digits of a value an error leaves, so many at least and at most; these of zero, too.

    Examples
    --------
    >>> digits_left(0.0913, 1e-5, 1, 7), digits_left(2.0, 3.0, 1, 7), digits_left(1.5, 0.0, 1, 7)
    (4, 1, 7)
    """
    if not value or not error:
        return most
    left = math.ceil(math.log10(abs(value)) - math.log10(error)) if error < math.inf else least
    return min(max(left, least), most)


def line_width() -> int:
    """Return how many characters a line may have: those of the terminal, or of ``COLUMNS``; else `WIDTH`."""
    if not at_terminal():
        return WIDTH
    import shutil

    return max(_NARROWEST, shutil.get_terminal_size((WIDTH, 24)).columns)


def at_terminal() -> bool:
    """Return whether text is for a terminal, not for a pipe or a file."""
    return not _file.get() and sys.stdout is not None and sys.stdout.isatty()


@contextmanager
def for_a_file() -> Iterator[None]:
    """Make text inside the block that is the same whatever the terminal."""
    before = _file.set(True)
    try:
        yield
    finally:
        _file.reset(before)


class Column(NamedTuple):
    """One column of a table, in a file or as text.

    Attributes
    ----------
    name : str
        Heading.
    of : str or callable
        How a row gives its value: a path of attributes or keys such as ``verdict.outcome``, or a function of
        the row. Without it, the attribute or key called as the column. Of what is not there None.
    form : str or callable
        How text shows a value: a format such as ``.3g``, or a function from the value to text. None is
        a dash unless a function says otherwise. Files take no notice of it.
    spare : int
        Text leaves it out where lines would not fit, the highest first; 0 for what always stays.

    Examples
    --------
    >>> columns = [Column("model"), Column("CPU [s]", "cost.cpu", ".1f")]
    >>> print(table(columns, [{"model": "exact", "cost": {"cpu": 2}}]))
      model  CPU [s]
      exact      2.0
    """

    name: str
    of: str | Callable[[Any], object] = ""
    form: str | Callable[[Any], str] = ""
    spare: int = 0

    def value(self, row: Any) -> object:
        """Return what a row has in this column."""
        if callable(self.of):
            return self.of(row)
        for key in self.of.split(".") if self.of else (self.name,):
            if row is None:
                break
            row = row.get(key) if isinstance(row, Mapping) else getattr(row, key)
        return row

    def text(self, row: Any) -> str:
        """Return the same as people read it."""
        value = self.value(row)
        if callable(self.form):
            return self.form(value)
        return "-" if value is None else format(value, self.form)


def table(columns: Sequence[Column], rows: Iterable[Any], indent: str = "  ", text_last: bool = False) -> str:
    """Return rows of any kind as lines with aligned columns, of those that fit; see `as_table`."""
    every = list(rows)
    cells = {column: [column.name, *(column.text(row) for row in every)] for column in columns}
    widths = {column: 2 + max(map(len, texts)) for column, texts in cells.items()}
    for column in sorted((one for one in columns if one.spare), key=lambda one: -one.spare):
        if len(indent) - 2 + sum(widths[one] for one in cells) <= line_width():
            break
        del cells[column]
    return as_table(list(zip(*cells.values(), strict=True)), indent, text_last)


def plural(count: int, word: str) -> str:
    """Return a count with its noun.

    Examples
    --------
    >>> plural(1, "body"), plural(2, "body"), plural(3, "joint")
    ('1 body', '2 bodies', '3 joints')
    """
    if count == 1:
        return f"1 {word}"
    return f"{count} {word[:-1]}ies" if word.endswith("y") else f"{count} {word}s"


def as_table(rows: Sequence[Sequence[str]], indent: str = "  ", text_last: bool = False) -> str:
    """Return rows of cells as lines with aligned columns; the first column is left-aligned, the others right.

    With `text_last` the last one is left-aligned too, as sentences are. Where a terminal has no room for
    them, long names are cut in the middle, but no numbers.

    Examples
    --------
    >>> print(as_table([["model", "cpu"], ["ancf", "0.1 s"]]))
      model    cpu
      ancf   0.1 s
    >>> print(as_table([["model", "why"], ["ancf", "it is the reference"]], text_last=True))
      model  why
      ancf   it is the reference
    """
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    if at_terminal():
        whole = [max(map(_uncut, column)) for column in zip(*rows, strict=True)]
        widths = fitting(widths, whole, line_width() - len(indent) - 2 * (len(widths) - 1))
    lines = []
    for row in rows:
        first, *others = (cut(cell, width) for cell, width in zip(row, widths, strict=True))
        cells = [first.ljust(widths[0]), *(c.rjust(w) for c, w in zip(others, widths[1:], strict=True))]
        cells[-1] = others[-1] if text_last else cells[-1]
        lines.append((indent + "  ".join(cells)).rstrip())
    return "\n".join(lines)


def _uncut(cell: str) -> int:
    """Return how much of a cell is always shown."""
    longest = max(map(len, cell.split()), default=0)
    return min(len(cell), _NAME) if longest >= _LONG or len(cell) > _SENTENCE else len(cell)


def fitting(widths: Sequence[int], least: Sequence[int], room: int) -> list[int]:
    """Return widths of columns that fit, none below its least: the widest give way.

    Examples
    --------
    >>> fitting([30, 8, 20], [18, 8, 18], 50), fitting([30, 8, 20], [18, 8, 18], 20)
    ([22, 8, 20], [18, 8, 18])
    """
    found, most = list(widths), max(widths, default=0)
    while most > min(least, default=0) and sum(found) > room:
        most -= 1
        found = [max(low, min(one, most)) for one, low in zip(widths, least, strict=True)]
    return found


def cut(text: str, width: int) -> str:
    """Return a text no longer than stated: where it is, without its middle.

    Examples
    --------
    >>> cut("left_front_upper_arm.tip.deflection", 20), cut("b1.tip.x", 20)
    ('left_fr...deflection', 'b1.tip.x')
    """
    if len(text) <= width:
        return text
    end = (width - 2) * 3 // 5
    return f"{text[: width - 3 - end]}...{text[len(text) - end :]}"


def printable(text: str) -> str:
    r"""Return a text with JSON's escapes for all that would not be seen, or would move the cursor.

    Examples
    --------
    >>> printable("red: \x1b[31m")
    'red: \\u001b[31m'
    """
    if text.isprintable():
        return text
    return "".join(char if char.isprintable() or char == "\n" else json.dumps(char)[1:-1] for char in text)


def brief(value: float | None) -> str:
    """Return a number with two digits for a table; a dash for one that is not known."""
    return "-" if value is None else f"{value:.1e}"


def wrapped(text: str, head: str = "  ", indent: str = "") -> str:
    """Return a remark after a head broken into lines, all but the first indented; no name is broken."""
    return textwrap.fill(
        text, min(line_width(), WIDTH), initial_indent=head, subsequent_indent=indent or head + "  ",
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip


def listed(lines: Mapping[str, str], indent: str = "") -> str:
    """Return what there is with a word on each, the words below one another.

    Examples
    --------
    >>> print(listed({"rod": "swings", "chain": "falls"}))
    rod    swings
    chain  falls
    """
    width = max(map(len, lines), default=0)
    below = " " * (len(indent) + width + 2)
    return "\n".join(wrapped(words, f"{indent}{one.ljust(width)}  ", below) for one, words in lines.items())


def number(value: object) -> str:
    """Return a number, or a group of them, as short text; a dash where there is none.

    Examples
    --------
    >>> number(None), number(40), number(1.23456e-9), number({"b1.tip.x": 1e-9})
    ('-', '40', '1.23e-09', 'b1.tip.x 1e-09')
    """
    if value is None:
        return "-"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {number(part)}" for key, part in value.items()) or "-"
    if isinstance(value, float):
        return f"{value:.3g}"
    return str(value)
