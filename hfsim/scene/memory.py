"""Scenes that would not fit into memory are refused before it is asked for, with what they would take.

Large scenes take memory in proportion to their coordinates.  What grows faster are full matrices, which body
frames and the model lowOrder need, and the tables of that model.
"""

from __future__ import annotations

from collections.abc import Mapping

from hfsim.maths.matrices import DENSE_UP_TO
from hfsim.maths.memory import available, in_bytes
from hfsim.mechanics.body import Body
from hfsim.scene.loading import LoadedDeck

FULL_MATRICES = 16
"""Full matrices that a run holds at a time: measured, 13 to 18 with 400 and 800 coordinates."""
LEAST = 3e3
"""Bytes that a coordinate takes in a run at least: measured, 3.1 kB with gear and 9.9 kB with gauss."""
WORTH_A_LOOK = 2e8
"""Bytes from which the system is asked what there is."""


def refuse_too_large(loaded: LoadedDeck, bodies: Mapping[str, Body]) -> None:
    """Refuse a scene whose matrices would not fit.

    Raises
    ------
    DeckError
        Naming the body that takes most, what the scene takes and what there is.
    """
    n = max(body.columns.stop for body in bodies.values())
    full = n > DENSE_UP_TO and not all(body.banded for body in bodies.values())
    needs = LEAST * n + FULL_MATRICES * 8.0 * n * n * full + sum(body.tables(n) for body in bodies.values())
    if needs < WORTH_A_LOOK or needs <= (there := available()):
        return
    largest = max(bodies.values(), key=lambda body: body.columns.stop - body.columns.start)
    raise loaded.problem(
        f"{largest.item}.elements",
        f"a run would take about {in_bytes(needs)} of memory, of which there are {in_bytes(there)}: "
        + (f"its full matrices have {n} rows" if full else f"it has {n} coordinates"),
        "fewer elements" + ", or model exact in absolute coordinates: its memory grows in proportion" * full,
    )
