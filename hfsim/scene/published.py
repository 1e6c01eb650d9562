"""What a deck is checked against: published values of its quantities, ``verify`` in a deck."""

import json
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from typing import Annotated, Any, Literal

from pydantic import Field

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import EmptyAllowed, PositiveTime, measures, read_text
from hfsim.deck.overrides import why_unset
from hfsim.deck.quantities import Quantity, QuantityError, read_quantity
from hfsim.deck.spec import ReadBy, Spec, entry_of
from hfsim.scene.quantities import QuantityChecks, quantity_of
from hfsim.scene.schema import Deck

_Text = Annotated[str, ReadBy(read_text, type="string")]
_Bound = Annotated[float, measures(above=0)]
_Grade = Literal["A", "B", "C", "D", "E"]
_State = Literal["start", "equilibrium", "steady"]
_Study = Literal["run", "static", "modes"]


class RowSpec(Spec):
    """One published value."""

    quantity: Annotated[Quantity, ReadBy(quantity_of, type="string")]
    """What is published: final(CHANNEL), at(TIME, CHANNEL), max, min, mean or rms(CHANNEL) or (CHANNEL,
    FROM..TO), frequency(NUMBER) [Hz], damping(NUMBER), critical(NUMBER)."""

    published: Annotated[float, measures()]
    """Its value, in the SI unit of the quantity."""

    bound: _Bound | None = None
    """Largest difference from it, in the same unit."""

    relative: _Bound | None = None
    """The same as a share of the published value [-]."""

    set: Annotated[dict[_Text, Any], EmptyAllowed] = Field(default_factory=dict)
    """Entries of the deck that this row has otherwise, by dotted paths as of `--set`."""

    study: _Study | None = None
    """What finds it, where that is not as of the others."""

    about: _State | None = None
    """State whose modes these are, where that is not as of the others."""

    grade: _Grade | None = None
    """How far the value can be trusted, where that is not as of the others."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield two bounds, a share of nothing, and a study that has no such quantity."""
        if self.bound is not None and self.relative is not None:
            yield Complaint(("relative",), "bound says this already", "leave one of them out", True)
        if self.relative is not None and self.published == 0.0:
            yield Complaint(("relative",), "a share of a value of 0 allows no difference", "state bound")
        if self.study is not None and self.study not in self.quantity.studies:
            known = " and ".join(self.quantity.studies)
            yield Complaint(("study",), f"{self.study} has no {self.quantity.kind}", f"{known} has it")

    @property
    def variant(self) -> tuple[str, ...]:
        """What is set, as overrides ``KEY=VALUE``."""
        return tuple(f"{path}={json.dumps(value)}" for path, value in self.set.items())


class VerifySpec(Spec):
    """Published values that the deck is checked against by `hfsim verify`."""

    source: _Text
    """Where they are from."""

    grade: _Grade | None = None
    """How far they can be trusted. A: closed form or high precision; B: converged, by an independent code;
    C: of another code, not recomputed; D: measured; E: read off a picture."""

    bound: _Bound | None = None
    """Bound of the rows that have none."""

    relative: _Bound | None = None
    """The same as a share of the published value [-]."""

    about: _State = "start"
    """State whose modes are told: the start, the equilibrium next to it, or the steady rotation, which also
    stands in place of rest."""

    study: _Study | None = None
    """What finds the quantities that it has; others, and all without it, are found by the study that has
    them, those of channels by a run."""

    seconds: PositiveTime | None = None
    """About how long all of it takes [s]: what takes long is begun first."""

    rows: Annotated[
        tuple[Annotated[RowSpec, entry_of("hfsim.scene.published.RowSpec")], ...], Field(min_length=1)
    ]
    """Quantities and their values."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield rows without a bound."""
        if self.bound is not None and self.relative is not None:
            yield Complaint(("relative",), "bound says this already", "leave one of them out", True)
        for number, row in enumerate(self.rows):
            if self.bound is None and self.relative is None and row.bound is None and row.relative is None:
                hint = "state bound or relative, here or for all rows"
                yield Complaint(("rows", number), "missing key: no bound on the difference", hint)
            elif self.relative is not None and row.bound is None and row.published == 0.0:
                why = "a share of a value of 0 allows no difference"
                yield Complaint(("rows", number, "published"), why, "state the bound of this row")

    def study_of(self, row: RowSpec) -> str:
        """Return what finds the quantity of a row."""
        return row.study or usual_study(row.quantity, self.study)

    def place_of(self, row: RowSpec) -> float | str:
        """Return where a study that is no run looks: at loads of a time [s], or at a state."""
        study, state = self.study_of(row), row.about or self.about
        if study == "modes" or (study == "static" and state == "steady"):
            return state
        return (row.quantity.time or 0.0) if study == "static" else 0.0

    def bound_of(self, row: RowSpec) -> float:
        """Return the largest difference that a row allows, in the unit of its quantity."""
        if row.bound is not None:
            return row.bound
        share = row.relative if row.relative is not None else self.relative if self.bound is None else None
        return share * abs(row.published) if share is not None else self.bound or 0.0


def usual_study(quantity: Quantity, wanted: object) -> str:
    """Return what finds a quantity: the study that is wanted, if it has such."""
    return wanted if isinstance(wanted, str) and wanted in quantity.studies else quantity.studies[0]


def complaints_of_rows(
    data: dict[str, Any], entries: Mapping[str, Any], changed: Collection[str], repeated: bool
) -> Iterator[Complaint]:
    """Yield rows that do not fit the rest of a deck: what is no channel, comes too late or cannot be set.

    What follows from entries that are set from outside is no fault of the deck.

    Parameters
    ----------
    data : dict
        Plain data of the deck, its parameters included.
    entries : mapping
        Of each top-level key what could be read.
    changed : collection of str
        Top-level keys of entries that are set from outside.
    repeated : bool
        Whether there are patterns, of which parameters decide how many copies there are.
    """
    deciding = (*_WHAT_THERE_IS, "parameters") if repeated else _WHAT_THERE_IS
    moved = any(key in deciding for key in changed)
    checks, verify = QuantityChecks(data, entries), data["verify"]
    usual = verify.get("study") if isinstance(verify, dict) else None
    for number, row in _rows_in(data):
        at = ("verify", "rows", number)
        own = row["set"] if isinstance(row.get("set"), dict) else {}
        for path in own:
            if not moved and (why := why_unset(data, path, Deck)):
                yield Complaint((*at, "set", path), why[0], why[1], True)
        text = row.get("quantity")
        with suppress(QuantityError):
            quantity = read_quantity(text if isinstance(text, str) else "")
            other = moved or any(path.startswith(deciding) for path in own)
            yield from checks.unknown((*at, "quantity"), quantity, other)
            if not own and not changed and row.get("study", usual_study(quantity, usual)) == "run":
                yield from checks.too_late((*at, "quantity"), quantity)


_WHAT_THERE_IS = ("bodies", "joints", "springs", "sections", "gravity")
"""Parts of a deck that decide which channels there are."""


def _rows_in(data: Mapping[str, Any]) -> Iterator[tuple[int, Mapping[str, Any]]]:
    """Yield those rows of a deck's plain data that are maps, with their numbers."""
    verify = data.get("verify")
    rows = verify.get("rows") if isinstance(verify, dict) else None
    numbered = enumerate(rows if isinstance(rows, list) else ())
    yield from ((number, row) for number, row in numbered if isinstance(row, dict))
