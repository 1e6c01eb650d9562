"""A comparison of models as one page: verdict, tables, what is doubtful, overlays, deck."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from hfsim.output.comparison import cost_columns, difference_columns, doubts_on, marks_in
from hfsim.output.page import doubts, html_table, origin, page, pictures, section
from hfsim.output.text import Column
from hfsim.output.writers import warnings_of
from hfsim.studies.compare.result import Comparison


def comparison_page(comparison: Comparison, deck: str, facts: Mapping[str, Any], folder: Path) -> str:
    """Return a comparison as a page.

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
