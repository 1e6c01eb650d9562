"""The manual: its pages, the decks in them, and how a page looks in a terminal."""

from __future__ import annotations

import re
import shutil
import textwrap
from collections.abc import Iterator
from pathlib import Path

import click

from hfsim.output.text import WIDTH, fitting

FOLDER = Path(__file__).resolve().parent.parent / "manual"
"""Where the pages are."""
KEYS = "keys"
"""The page that has all keys of decks."""
_NARROWEST = 40
"""Characters of a line at least."""
_ITEM = re.compile(r"(\s*(?:[-*]|\d+\.)\s+)(.*)", re.DOTALL)
_FENCED = re.compile(r"^```\w*\n(.*?)^```\n?", re.DOTALL | re.MULTILINE)
_LINK = re.compile(r"\[([^\]]+)\]\([^)]+\)")


def topics() -> dict[str, Path]:
    """Return the pages by their topics."""
    return {path.stem: path for path in sorted(FOLDER.glob("*.md"))}


def title_of(page: Path) -> str:
    """Return the first heading of a page."""
    with page.open(encoding="utf-8") as lines:
        return next((line.lstrip("# ").strip() for line in lines if line.startswith("#")), page.stem)


def about(word: str) -> str:
    """Return what the manual has on a kind or a key of decks, as pages are written; empty without any.

    These are the sections with the word in their heading, the rows of the keys called so, and the names of
    the pages that have the word elsewhere.
    """
    found, others, known = list[str](), list[str](), False
    row = re.compile(rf"^\| `{re.escape(word)}` \|.*$", re.MULTILINE)
    for name, page in topics().items():
        text = page.read_text(encoding="utf-8")
        there = list[str]()
        for section in re.split(r"(?m)^(?=##+ )", text)[1:]:
            heading, _, inside = section.partition("\n")
            if len(word) > 2 and word.lower() in re.findall(r"\w+", heading.lower()):
                there.append(section.strip())
            elif rows := row.findall(inside) if name == KEYS else []:
                head = re.findall(r"^\|.*$", inside, re.MULTILINE)[:2]
                there.append("\n".join([heading, "", *head, *rows]))
        found, known = [*found, *there], known or (name == KEYS and bool(there))
        if not there and re.search(rf"\b{re.escape(word)}\b", text):
            others.append(name)
    if others:
        others.sort(key=lambda name: name != "deck")
        found.append(f"More on the pages {', '.join(others)}: hfsim help {others[0]}.")
    return "\n\n".join(found) if known else ""


def decks_in(page: Path) -> dict[str, str]:
    """Return the decks in a page by their names: its YAML blocks that begin with the format."""
    blocks = re.findall(r"^```yaml\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    named = ((re.search(r"^name: *(\S+)", block, re.MULTILINE), block) for block in blocks)
    return {name[1]: block for name, block in named if name}


def for_terminal(text: str, width: int | None = None) -> str:
    r"""Return a page as a terminal shows it: tables as wide as there is room, sentences of no longer lines
    than can be read.

    Examples
    --------
    >>> print(for_terminal("See [errors](errors.md)\nand `plan`.\n\n```sh\nhfsim plan\n```", 60))
    See errors and `plan`.
    <BLANKLINE>
        hfsim plan
    """
    width = width or max(shutil.get_terminal_size().columns, _NARROWEST)
    return "\n\n".join(_shown(kind, block, width) for kind, block in _blocks(text))


def _blocks(text: str) -> Iterator[tuple[str, str]]:
    """Yield what a page is made of: kind and text."""
    for number, part in enumerate(_FENCED.split(text + "\n")):
        if number % 2:
            yield "code", part.rstrip("\n")
            continue
        for block in re.split(r"\n\s*\n", part.strip("\n")):
            if block.strip():
                yield _kind_of(block), block


def _kind_of(block: str) -> str:
    if block.startswith("#"):
        return "heading"
    if block.startswith("|"):
        return "table"
    return "items" if _ITEM.match(block) else "paragraph"


def _shown(kind: str, block: str, width: int) -> str:
    if kind == "code":
        return textwrap.indent(block, "    ")
    if kind == "table":
        return _table(block, width)
    width = min(width, WIDTH)
    if kind == "heading":
        return "\n".join(click.style(line, bold=True) for line in textwrap.wrap(block.lstrip("# "), width))
    if kind == "items":
        return "\n".join(_item(item, width) for item in re.split(r"\n(?=\s*(?:[-*]|\d+\.)\s)", block))
    return textwrap.fill(_LINK.sub(r"\1", block), width)


def _item(item: str, width: int) -> str:
    found = _ITEM.match(item)
    mark, text = found.groups() if found else ("", item)
    text = " ".join(_LINK.sub(r"\1", text).split())
    return textwrap.fill(text, width, initial_indent=mark, subsequent_indent=" " * len(mark))


def _table(block: str, width: int) -> str:
    """Return a table whose columns share the width: the narrow ones get what they need."""
    rows = [_cells(line) for line in block.splitlines() if not re.fullmatch(r"[|\s:-]+", line)]
    count = max(map(len, rows))
    rows = [row + [""] * (count - len(row)) for row in rows]
    needed = [max(len(row[k]) for row in rows) for k in range(count)]
    room = width - 2 * (count - 1)
    columns = fitting(needed, [min(one, 3) for one in needed], room)
    told = []
    for number, row in enumerate(rows):
        cells = [textwrap.wrap(cell, size) or [""] for cell, size in zip(row, columns, strict=True)]
        for line in range(max(map(len, cells))):
            parts = [cell[line] if line < len(cell) else "" for cell in cells]
            padded = (part.ljust(size) for part, size in zip(parts, columns, strict=True))
            told.append("  ".join(padded).rstrip())
        if number == 0:
            told.append("  ".join("-" * size for size in columns))
    return "\n".join(told)


def _cells(line: str) -> list[str]:
    """Return the cells of a row; a bar within one is written with a backslash."""
    cells = re.split(r"(?<!\\)\|", line.strip("| "))
    return [_LINK.sub(r"\1", cell.strip()).replace(r"\|", "|") for cell in cells]
