"""Channels that are written besides those that a deck names."""

from collections.abc import Iterable
from dataclasses import replace

from hfsim.deck.complaints import Complaint
from hfsim.scene.channel_names import ChannelNames
from hfsim.scene.declared import Declared
from hfsim.scene.loading import LoadedDeck


def why_no_channel(loaded: LoadedDeck, name: str) -> Complaint | None:
    """Return why a deck has no channel of a name; None if it has."""
    names = ChannelNames(Declared(loaded.source.data), loaded.deck.dimension)
    return next(names.channel_complaint((), name), None)


def with_channels(loaded: LoadedDeck, names: Iterable[str]) -> LoadedDeck:
    """Return a deck that writes those of some channels too that it has."""
    deck = loaded.deck
    more = [name for name in names if name not in deck.channels and why_no_channel(loaded, name) is None]
    if not more:
        return loaded
    output = deck.output.model_copy(update={"channels": (*deck.channels, *more)})
    return replace(loaded, deck=deck.model_copy(update={"output": output}))
