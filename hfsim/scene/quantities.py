"""Quantities that a deck names: how they are read, and what is wrong with them in this deck."""

from collections.abc import Iterator, Mapping
from typing import Any

from hfsim.deck.complaints import Complaint, refusal, shown
from hfsim.deck.fields import read_text
from hfsim.deck.quantities import Quantity, QuantityError, read_quantity
from hfsim.deck.reader import Path
from hfsim.scene.channel_names import ChannelNames, no_channel
from hfsim.scene.checks import space_said
from hfsim.scene.declared import Declared


def quantity_of(value: object) -> Quantity:
    """Return the quantity that an entry names."""
    if isinstance(value, Quantity):
        return value
    text = read_text(value)
    try:
        return read_quantity(text)
    except QuantityError as error:
        raise refusal(f"{shown(text)}: {error}", error.hint) from None


class QuantityChecks:
    """What is wrong with quantities in a deck.

    Parameters
    ----------
    data : dict
        Plain data of the deck, its parameters included.
    entries : mapping
        Of each top-level key what could be read.
    """

    def __init__(self, data: dict[str, Any], entries: Mapping[str, Any]) -> None:
        self._names = ChannelNames(Declared(data), space_said(data, entries)[0])
        self._solve = entries["solve"]

    def unknown(self, path: Path, quantity: Quantity, changed: bool = False) -> Iterator[Complaint]:
        """Yield that a quantity is of what is no channel, where the deck is changed of what none has."""
        if quantity.channel and changed:
            yield from no_channel(path, quantity.channel)
        elif quantity.channel:
            yield from self._names.channel_complaint(path, quantity.channel)

    def too_late(self, path: Path, quantity: Quantity) -> Iterator[Complaint]:
        """Yield that a quantity is of times after the end of the run."""
        solve = self._solve
        if solve is not None and (why := quantity.beyond(solve.duration)):
            yield Complaint(path, why)
