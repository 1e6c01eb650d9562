"""Decks with published values: what they ask for, and how it is found."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from hfsim.deck.quantities import Quantity
from hfsim.errors import DeckError
from hfsim.marching.stop import Progress, nobody
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.published import RowSpec, VerifySpec
from hfsim.scene.shipped import CASES, shipped_cases
from hfsim.studies.collect import Answer, channels_of, unit_of_quantity
from hfsim.studies.farm import Executor, Outcome, Task
from hfsim.studies.verify.finders import Order, answer
from hfsim.studies.verify.result import FAILED, HELD, MISSED, Row, Verification

FOLDER = CASES / "verify"
"""Decks that are there for their published values alone."""


def published_decks() -> dict[str, Path]:
    """Return the shipped decks with published values by name: those for nothing else, then cases."""
    cases = {name: path for name, path in shipped_cases().items() if "\nverify:" in path.read_text("utf-8")}
    return {**{path.stem: path for path in sorted(FOLDER.glob("*.yaml"))}, **cases}


@dataclass(frozen=True)
class Entry:
    """A deck and what it is checked against.

    Attributes
    ----------
    name : str
        Of the deck; see `entries_of`.
    file : str
        As the user named it.
    """

    name: str
    file: str
    loaded: LoadedDeck

    @property
    def published(self) -> VerifySpec:
        """What the deck says."""
        assert self.loaded.published is not None
        return self.loaded.published

    @property
    def grades(self) -> str:
        """Grades of its values."""
        return " ".join(sorted({row.grade for row in self.rows if row.grade}))

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """Its values, none of them computed."""
        return tuple(self._row(row) for row in self.published.rows)

    def _row(self, row: RowSpec) -> Row:
        said, quantity = self.published, row.quantity
        unit = unit_of_quantity(quantity)
        grade, bound = row.grade or said.grade or "", said.bound_of(row)
        of = (self.name, str(quantity), row.set, said.study_of(row))
        return Row(*of, row.published, bound, unit, grade, said.source)

    def orders(self) -> dict[tuple[int, ...], Order]:
        """Return what must be solved, each with the numbers of the rows it serves.

        Raises
        ------
        DeckError
            If what a row sets makes no deck, or a law has no value until its time at rest.
        """
        groups: dict[tuple[object, ...], list[int]] = {}
        for number, (spec, row) in enumerate(zip(self.published.rows, self.rows, strict=True)):
            key = (row.study, spec.variant, self.published.place_of(spec))
            groups.setdefault(key, []).append(number)
        return {tuple(numbers): self._order(numbers) for numbers in groups.values()}

    def _order(self, numbers: list[int]) -> Order:
        specs, source = [self.published.rows[k] for k in numbers], self.loaded.source
        quantities = tuple(spec.quantity for spec in specs)
        overrides = (*self.loaded.overrides, *self._plainly(quantities), *specs[0].variant)
        bounds = tuple(self.rows[k].bound for k in numbers)
        study, place = self.rows[numbers[0]].study, self.published.place_of(specs[0])
        order = Order(study, place, source.text, source.file, overrides, quantities, bounds)
        try:
            loaded = order.load()
            if study == "static" and isinstance(place, float) and place:
                loaded.until(place)
        except DeckError as error:
            wrong = error.problems[0]
            what = f"{wrong.path}: {wrong.message}" if wrong.path else wrong.message
            path = f"verify.rows.{numbers[0]}.{'set' if specs[0].set else 'quantity'}"
            raise self.loaded.problem(path, what, wrong.hint) from None
        return order

    def _plainly(self, quantities: Sequence[Quantity]) -> Iterator[str]:
        """Yield overrides that leave of a deck what its values need."""
        data = self.loaded.source.data
        yield "verify=null"
        yield from (f"solve.{key}=null" for key in _SEARCH if key in data["solve"])
        interval = {"interval": self.loaded.deck.interval}
        channels = {"channels": channels_of(quantities)} if channels_of(quantities) else {}
        yield f"output={json.dumps({**interval, **channels})}"


_SEARCH = ("target_error", "target_channels")
"""Entries of ``solve`` that let `hfsim run` look for a mesh."""


def entry_of(loaded: LoadedDeck) -> Entry:
    """Return a deck with its published values.

    Raises
    ------
    DeckError
        If it has none.
    """
    if loaded.published is None:
        raise loaded.problem("verify", "missing key: nothing is published of it", "see 'hfsim help verify'")
    return Entry(loaded.deck.name, loaded.source.file, loaded.with_numbers())


def entries_of(decks: Iterable[LoadedDeck]) -> list[Entry]:
    """Return decks with their published values, each by a name of its own.

    Of those that are called the same the names have their files too, and a number where these are the same.

    Raises
    ------
    DeckError
        If one has none.
    """
    entries = [entry_of(one) for one in decks]
    for more in (lambda entry, number: entry.file, lambda entry, number: str(number)):
        names = [entry.name for entry in entries]
        numbers = [names[: k + 1].count(name) for k, name in enumerate(names)]
        entries = [
            replace(entry, name=f"{entry.name} ({more(entry, k)})") if names.count(entry.name) > 1 else entry
            for entry, k in zip(entries, numbers, strict=True)
        ]
    return entries


def verify(entries: Sequence[Entry], executor: Executor, report: Progress = nobody) -> Verification:
    """Find all published values of some decks.

    Parameters
    ----------
    executor : Executor
        What does it.
    report : callable
        Told the share of the work that is done, 0 to 1.

    Raises
    ------
    DeckError
        If what a row sets makes no deck; nothing is run then.
    """
    start = time.perf_counter()
    rows = [list(entry.rows) for entry in entries]
    seconds = {entry.name: 0.0 for entry in entries}
    orders = {(k, numbers): one for k, entry in enumerate(entries) for numbers, one in entry.orders().items()}
    shares = {key: _expected(entries[key[0]]) for key in orders}
    done = 0.0

    def take(outcome: Outcome) -> None:
        nonlocal done
        k, numbers = outcome.key
        nothing = tuple(Answer(None, reason=outcome.lost) for _ in numbers)
        found, cpu = outcome.value or (nothing, 0.0)
        seconds[entries[k].name] += cpu
        for number, one in zip(numbers, found, strict=True):
            rows[k][number] = judged(rows[k][number], one)
        done += shares[outcome.key]
        report(done / sum(shares.values()))

    for key in sorted(orders, key=lambda one: -shares[one]):
        executor.add(Task(key, answer, orders[key], float("inf")))
    executor.serve(take)
    every = tuple(row for some in rows for row in some)
    return Verification(every, time.perf_counter() - start, seconds, executor.interrupted)


def _expected(entry: Entry) -> float:
    """Return about how long each variant of a deck takes [s], as far as it says so."""
    variants = {spec.variant for spec in entry.published.rows}
    return (entry.published.seconds or 1.0) / len(variants)


def judged(row: Row, found: Answer) -> Row:
    """Return a row with what was found: held if difference and error in time are within the bound."""
    if found.value is None:
        return replace(row, verdict=FAILED, reason=found.reason)
    told = replace(row, found=found.value, time_error=found.time_error)
    if (found.time_error or 0.0) > row.bound:
        why = f"the error in time, {found.time_error:.1e}, is above the bound"
        return replace(told, verdict=MISSED, reason=why)
    return replace(told, verdict=HELD if abs(found.value - row.published) <= row.bound else MISSED)
