"""Decks by file or by the name of a case that is shipped with hfsim."""

from __future__ import annotations

import os
from pathlib import Path

from hfsim.errors import HfsimError

CASES = Path(__file__).resolve().parent / "cases"
"""Decks shipped with hfsim."""


_EMPTY = "the name of a deck is empty, as that of a variable that is not set"


class DeckNotFoundError(HfsimError):
    """What names a deck is neither a file nor a shipped case."""

    exit_code = 2


def shipped_cases() -> dict[str, Path]:
    """Return the decks shipped with hfsim by name."""
    return {path.stem: path for path in sorted(CASES.glob("*.yaml"))}


_LIKE = 0.75
"""Likeness of names from which a shipped case may be meant by one."""


def find_deck(name: str) -> Path:
    """Return the existing file that a name means: a path, or the bare name of a shipped case.

    Raises
    ------
    DeckNotFoundError
        If there is neither; the message names what comes near.
    """
    from hfsim.deck.overrides import why_no_text

    if not name:
        raise DeckNotFoundError(_EMPTY)
    if why := why_no_text(name):
        raise DeckNotFoundError(f"{name}: the name of this deck {why}")
    path = Path(name)
    # a pipe does too; False where a name is too long for the system
    if os.path.exists(path) and not os.path.isdir(path):
        return path
    cases = shipped_cases()
    if name in cases:
        return cases[name]
    if os.path.isdir(path):
        raise DeckNotFoundError(f"{name} is a folder; name a deck, e.g. {path / 'case.yaml'}")
    raise DeckNotFoundError(f"there is no deck {name}{_near(path, list(cases))}. Nothing was run.")


def _near(path: Path, cases: list[str]) -> str:
    from hfsim.deck.source import near_file, nearest

    if path.stem in cases:
        return f" (a shipped case has that name: use '{path.stem}')"
    beside = path if os.path.isdir(path.parent) else Path(path.name)
    files = sorted(file.name for file in beside.parent.glob("*.y*ml"))
    near = near_file(beside, files) or nearest(path.stem, cases, _LIKE)
    return f" (did you mean '{near}'?)" if near else ""
