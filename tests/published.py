"""Published values as shipped decks state them."""

from pathlib import Path

import numpy as np

from hfsim.scene.loading import load_deck

CASES = Path(__file__).parents[1] / "cases"


def published(case, until=np.inf):
    """Return times, channels and values of a shipped deck, as ``at(TIME, CHANNEL)`` names them."""
    rows = load_deck(CASES / f"{case}.yaml").published.rows
    known = [
        (row.quantity.time, row.quantity.channel, row.published) for row in rows if row.quantity.kind == "at"
    ]
    return [(t, channel, value) for t, channel, value in known if t <= until]


def misses(run, case, until=np.inf):
    """Return how far a run, which has rows at these times, is from each of them."""
    known = published(case, until)
    return np.array([run[channel][np.searchsorted(run.t, t - 1e-9)] - value for t, channel, value in known])
