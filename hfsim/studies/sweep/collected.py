"""What is collected in a sweep: texts, whose braces are worked out anew with the parameters of each run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from hfsim.deck.quantities import Quantity, QuantityError, read_quantity
from hfsim.deck.repeating import Key, repeated
from hfsim.errors import DeckError, DeckProblem
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.more_channels import why_no_channel

COLLECT = "--collect"
"""The option that names what is collected, as what is wrong with it is placed."""
_USUAL = ("final", "min", "max")
"""What is collected of every channel where nothing is named."""


class Collected(NamedTuple):
    """What is collected.

    Attributes
    ----------
    quantities : tuple of Quantity
        In the deck as it is: columns are called after them, whatever copies they are of in runs.
    texts : tuple of str
        As they are written.
    keys : tuple of Key
        Of which of them each quantity is, and of which copy.
    """

    quantities: tuple[Quantity, ...] = ()
    texts: tuple[str, ...] = ()
    keys: tuple[Key, ...] = ()

    @property
    def columns(self) -> dict[str, str]:
        """Names of columns by the texts that stand for one each."""
        numbers = [number for number, _ in self.keys]
        pairs = zip(numbers, self.quantities, strict=True)
        return {self.texts[k]: str(quantity) for k, quantity in pairs if numbers.count(k) == 1}

    def of_run(self, loaded: LoadedDeck) -> tuple[Quantity, ...]:
        """Return what it is in the deck of a run; what has no copy there is as in the deck as it is.

        Raises
        ------
        DeckError
            If a text is no quantity with the parameters of the run.
        """
        if not any("{" in text for text in self.texts):
            return self.quantities
        found, wrong = repeated(self.texts, loaded.source.known)
        if wrong:
            raise DeckError(COLLECT, [_placed(self.texts[number], one) for number, one in wrong.items()])
        own = zip(self.keys, self.quantities, strict=True)
        return tuple(_read(found[key]) if key in found else one for key, one in own)


def _placed(text: str, problem: DeckProblem) -> DeckProblem:
    return DeckProblem(text, problem.message, problem.hint, file=COLLECT)


def _read(text: str) -> Quantity:
    try:
        return read_quantity(text)
    except QuantityError as error:
        raise DeckError(COLLECT, [DeckProblem(text, str(error), error.hint, file=COLLECT)]) from None


def read_collected(texts: Sequence[str], loaded: LoadedDeck, end: float, moved: bool) -> Collected:
    """Return what is collected; without any text last values and extremes of all channels of the deck.

    Parameters
    ----------
    end : float
        When runs end at the latest [s].
    moved : bool
        Whether parameters differ from run to run.

    Raises
    ------
    DeckError
        With all texts that name no quantity of a run, and of those that would share a column.
    """
    usual = not texts
    if usual:
        channels = loaded.source.as_written.get(("output", "channels"), loaded.deck.channels)
        texts = [f"{kind}({name})" for name in channels for kind in _USUAL]
    named, refused = repeated(texts, loaded.source.known)
    wrong = [_placed(texts[number], one) for number, one in refused.items()]
    if usual:  # copy by copy
        named = dict(sorted(named.items(), key=lambda one: (one[0][0] // len(_USUAL), *one[0][::-1])))
    found: dict[Quantity, Key] = {}
    for key, text in named.items():
        try:
            quantity = _read(text)
        except DeckError as error:
            wrong += error.problems
            continue
        wrong += [DeckProblem(text, *why, file=COLLECT) for why in _why_not(quantity, loaded, end)]
        if moved and quantity in found and "{" in texts[key[0]] + texts[found[quantity][0]]:
            why = f"is {quantity} in the deck, and a column already which may differ in other runs"
            wrong.append(DeckProblem(texts[key[0]], why, "leave out one of them", file=COLLECT))
        found.setdefault(quantity, key)
    if wrong:
        raise DeckError(COLLECT, wrong)
    return Collected(tuple(found), tuple(texts), tuple(found.values()))


def _why_not(quantity: Quantity, loaded: LoadedDeck, end: float) -> Iterator[tuple[str, str]]:
    """Yield why the runs of a deck do not have a quantity, and what they have."""
    if why := quantity.beyond(end):
        yield why, ""
    unread = quantity.channel if quantity.channel not in loaded.deck.channels else ""
    if unread and (complaint := why_no_channel(loaded, unread)):
        yield complaint.message, complaint.hint
