"""What comes of a verification: a row for each published value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

HELD, MISSED, FAILED, OPEN = "held", "missed", "failed", "not computed"
"""Verdicts of rows."""


@dataclass(frozen=True)
class Row:
    """One published value and what was found.

    Attributes
    ----------
    deck : str
        Name of the deck, with its file where several are called so.
    quantity : str
        As the deck writes it.
    variant : mapping of str to object
        What the row sets, by dotted paths.
    study : str
        ``run``, ``static`` or ``modes``.
    published, bound : float
        In the SI unit of the quantity.
    verdict : str
        ``held``, ``missed``, ``failed`` or ``not computed``.
    time_error : float or None
        How far the value of a run moved with smaller steps, about its error in time.
    reason : str
        Why there is no value, or why the verdict is not what the difference would be.
    """

    deck: str
    quantity: str
    variant: Mapping[str, Any]
    study: str
    published: float
    bound: float
    unit: str = ""
    grade: str = ""
    source: str = ""
    verdict: str = OPEN
    found: float | None = None
    time_error: float | None = None
    reason: str = ""

    @property
    def difference(self) -> float | None:
        """What was found beside what was published, in the unit."""
        return None if self.found is None else self.found - self.published


@dataclass(frozen=True)
class Verification:
    """All rows.

    Attributes
    ----------
    rows : tuple of Row
        In the order of the decks.
    used : float
        Wall time [s].
    seconds : mapping of str to float
        CPU time of each deck [s].
    """

    rows: tuple[Row, ...]
    used: float
    seconds: Mapping[str, float] = field(default_factory=dict)
    interrupted: bool = False

    def __repr__(self) -> str:
        """Return what it is in a line: its rows would fill the screen."""
        decks = ", ".join(dict.fromkeys(row.deck for row in self.rows))
        return f"<Verification {decks}: {self.held} of {len(self.rows)} held>"

    @property
    def held(self) -> int:
        """How many rows are within their bounds."""
        return sum(row.verdict == HELD for row in self.rows)

    @property
    def exit_code(self) -> int:
        """0: all hold; 3: a run failed; 4: a value is missed; 130: interrupted."""
        verdicts = {row.verdict for row in self.rows}
        if self.interrupted:
            return 130
        return 3 if verdicts & {FAILED, OPEN} else 4 if MISSED in verdicts else 0


def as_facts(result: Verification) -> dict[str, Any]:
    """Return it as JSON-ready facts (``verify.json``)."""
    return {
        "status": "interrupted" if result.interrupted else "done",
        "held": result.held,
        "count": len(result.rows),
        "used": result.used,
        "seconds": dict(result.seconds),
        "rows": [{**asdict(row), "difference": row.difference} for row in result.rows],
    }
