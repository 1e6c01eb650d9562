"""What a deck says of its sweep: which of its entries have other values in many runs, ``sweep`` in a deck."""

import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Annotated, Any, Literal

from pydantic import Field

from hfsim.deck.complaints import Complaint, refusal, shown
from hfsim.deck.fields import EmptyAllowed, read_text, whole
from hfsim.deck.overrides import why_unset
from hfsim.deck.quantities import Quantity, QuantityError, read_quantity
from hfsim.deck.ranges import RangeError, read_values, written
from hfsim.deck.spec import ReadBy, Spec
from hfsim.scene.quantities import QuantityChecks, quantity_of
from hfsim.scene.schema import Deck

_Text = Annotated[str, ReadBy(read_text, type="string")]

_VALUES = ({"type": "string"}, {"type": "number"}, {"type": "array"})
"""What values are written as."""


def _read_values(value: object) -> str:
    """Return values as text, from text, a number or a list."""
    if isinstance(value, bool) or not isinstance(value, str | int | float | list):
        raise refusal(f"must be values such as lin(1, 2, 5) or a list, not {shown(value)}")
    text = ", ".join(map(_one, value)) if isinstance(value, list) else _one(value)
    try:
        read_values(text)
    except RangeError as error:
        raise refusal(error.message, error.hint) from None
    return text


def _one(value: object) -> str:
    if isinstance(value, str):
        return value
    return written(float(value)) if isinstance(value, int | float) else json.dumps(value)


class SweepSpec(Spec):
    """Many runs of the deck, as `hfsim sweep` does them where its options say nothing else."""

    vary: Annotated[
        dict[_Text, Annotated[str, ReadBy(_read_values, anyOf=_VALUES)]], EmptyAllowed
    ] = Field(default_factory=dict)
    """Values by dotted paths of entries, or by parameters.NAME: a list, lin(1, 2, 5), log(...), or with
    `sample` uniform(...), normal(...) and others."""

    sample: Annotated[int, whole()] | None = None
    """Random runs instead of all combinations."""

    sampler: Literal["lhs", "sobol", "random"] = "lhs"
    """How they are chosen: Latin hypercube, Sobol's sequence, each by itself."""

    seed: Annotated[int, whole(0)] = 1
    """Of the random runs."""

    runs: _Text | None = None
    """CSV file beside the deck that has the runs: paths in its first row."""

    collect: tuple[Annotated[Quantity, ReadBy(quantity_of, type="string")], ...] = ()
    """What is gathered: final(CHANNEL), at(TIME, CHANNEL), max, min, mean or rms(CHANNEL) or (CHANNEL,
    FROM..TO), frequency, damping or critical(NUMBER)."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield what says twice which runs there are, and random values without their number."""
        if self.runs is not None and (self.vary or self.sample is not None):
            yield Complaint(("runs",), "says all: vary and sample go without it", "", True)
        if self.runs is None and not self.vary:
            yield Complaint((), "missing key: nothing is varied", "state vary or runs")
        for path, text in self.vary.items():
            if self.sample is None and read_values(text).kind:
                yield Complaint(("vary", path), "is random", "say how many runs: sample")


def complaints_of_sweep(data: dict[str, Any], entries: Mapping[str, Any]) -> Iterator[Complaint]:
    """Yield entries that a deck does not have, and quantities of what is no channel or come too late.

    Parameters
    ----------
    data : dict
        Plain data of the deck, its parameters included.
    entries : mapping
        Of each top-level key what could be read.
    """
    sweep = data["sweep"] if isinstance(data["sweep"], dict) else {}
    vary, collect = sweep.get("vary"), sweep.get("collect")
    paths = [str(path) for path in vary] if isinstance(vary, dict) else []
    for path in paths:
        if why := why_unset(data, path, Deck):
            yield Complaint(("sweep", "vary", path), why[0], "".join(why[1:]), True)
    checks = QuantityChecks(data, entries)
    moved = "runs" in sweep or any(path.startswith(_ENDS) for path in paths)
    for number, text in enumerate(collect if isinstance(collect, list) else ()):
        with suppress(QuantityError):
            quantity, at = read_quantity(str(text)), ("sweep", "collect", number)
            yield from checks.unknown(at, quantity)
            if not moved:
                yield from checks.too_late(at, quantity)


_ENDS = ("solve", "parameters")
"""Parts of a deck that decide when a run ends."""
