"""The published benchmarks that are shipped with hfsim."""

from __future__ import annotations

from pathlib import Path

from hfsim.scene.shipped import CASES, shipped_cases

FOLDER = CASES / "verify"
"""Decks that are there for their published values alone."""


def published_decks() -> dict[str, Path]:
    """Return the shipped decks with published values by name: those for nothing else, then cases."""
    cases = {name: path for name, path in shipped_cases().items() if "\nverify:" in path.read_text("utf-8")}
    return {**{path.stem: path for path in sorted(FOLDER.glob("*.yaml"))}, **cases}
