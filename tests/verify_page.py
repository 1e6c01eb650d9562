"""Write the tables of the manual's page on verification: ``python tests/verify_page.py`` (some minutes)."""

import math
import sys
from collections.abc import Iterable, Iterator
from itertools import groupby

from hfsim.output.manual import FOLDER
from hfsim.output.verify import as_markdown
from hfsim.scene.loading import load_deck
from hfsim.studies.farm import Farm
from hfsim.studies.verify.result import Row
from hfsim.studies.verify.study import entry_of, published_decks, verify

PAGE = FOLDER / "verify.md"
MARK = "\n## What is met\n"
"""Heading from which on the page is written by this script."""
OVERVIEW = """
{decks} decks with {values} values. Digits are those that all values of a deck have, of the largest one with
the same unit; what was measured (grade D) is left out of them.

| `hfsim verify` | published in | grade | values | digits |
| --- | --- | --- | --- | --- |
"""


def digits(rows: list[Row]) -> str:
    """Return to how many digits all values are met, 12 at most."""
    largest = {row.unit: max(abs(one.published) for one in rows if one.unit == row.unit) for row in rows}
    computed = [row for row in rows if row.grade != "D" and row.difference is not None]
    off = [abs(row.difference or 0.0) / largest[row.unit] for row in computed]
    return str(min(12, math.floor(-math.log10(max(*off, 1e-13))))) if off else "10 %"


def overview(rows: Iterable[Row]) -> Iterator[str]:
    """Yield a line of the first table for each deck."""
    for deck, own in groupby(rows, lambda row: row.deck):
        mine = list(own)
        grades = ", ".join(sorted({row.grade for row in mine}))
        yield f"| `{deck}` | {mine[0].source} | {grades} | {len(mine)} | {digits(mine)} |"


def main() -> None:
    """Run everything and write the page."""
    result = verify([entry_of(load_deck(path)) for path in published_decks().values()], Farm(2))
    head = PAGE.read_text(encoding="utf-8").partition(MARK)[0].rstrip()
    lines = [*overview(result.rows)]
    first = OVERVIEW.format(decks=len(lines), values=len(result.rows)) + "\n".join(lines)
    text = f"{head}\n{MARK}{first}\n\n## What is found\n\n{as_markdown(result)}\n"
    PAGE.write_text(text, encoding="utf-8")
    sys.exit(result.exit_code)


if __name__ == "__main__":
    main()
