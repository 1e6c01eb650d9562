"""Decks as data or text, parsed and simulated to their end."""

import numpy as np
import yaml

from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate


def parsed(deck):
    """The checked deck of data or of text."""
    return parse_deck(deck if isinstance(deck, str) else yaml.safe_dump(deck))


def solved(deck):
    """Channels over time, (n_times, n_channels), and the run, which must have reached its end."""
    result = simulate(parsed(deck), error_estimate=False)
    assert result.status == "done", result.reason
    return np.stack([c.values for c in result.channels], axis=1), result
