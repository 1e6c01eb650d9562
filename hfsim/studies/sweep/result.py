"""What comes of a sweep: its rows as columns of numbers."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from hfsim.deck.overrides import unit_of
from hfsim.deck.quantities import read_quantity
from hfsim.deck.ranges import Value
from hfsim.deck.source import path_in
from hfsim.marching.columns import Columns
from hfsim.maths.arrays import Array
from hfsim.scene.loading import LoadedDeck
from hfsim.studies.collect import unit_of_quantity
from hfsim.studies.sweep.collected import Collected
from hfsim.studies.sweep.plan import Plan
from hfsim.studies.sweep.work import FACTS, Row

_NUMBERS = ("error_estimate", "energy_drift", "warnings", "cpu_s")
"""Facts that are numbers."""


@dataclass(frozen=True, eq=False)
class Sweep(Columns):
    """The runs of a sweep in the order of its plan; ``sweep["max(b1.tip.x)"]`` are the values of a column.

    Attributes
    ----------
    name : str
        Of the deck.
    status : str
        ``done`` or ``interrupted``.
    columns : dict of str to ndarray, shape (n_runs,)
        What is varied (words as objects), what is collected (NaN where a run gave nothing), ``status``,
        ``class``, ``reason``, and ``error_estimate``, ``energy_drift``, ``warnings``, ``cpu_s`` [s].
    collected : tuple of str
        What is collected.
    missing : int
        Runs that have not been done.
    units : mapping of str to str
        SI units of what is varied and collected, empty where it has none.
    asked : mapping of str to str
        Columns by the texts that ask for one of them each; `sweep[TEXT]` is that column.
    """

    name: str
    status: str
    plan: Plan
    columns: dict[str, Array]
    collected: tuple[str, ...]
    missing: int = 0
    units: Mapping[str, str] = field(default_factory=dict)
    asked: Mapping[str, str] = field(default_factory=dict, repr=False)

    def __repr__(self) -> str:
        """Return what it is in a line: its arrays would fill the screen."""
        return f"<Sweep {self.name}: {self.status}, {len(self)} runs of {', '.join(self.plan.paths)}>"

    def __contains__(self, name: object) -> bool:
        return super().__contains__(self.asked.get(str(name), name))

    def __getitem__(self, name: str) -> Array:
        """Return a column, by its name or by the text that it was asked for with."""
        return super().__getitem__(name if name in self.columns else self.asked.get(name, name))

    def __len__(self) -> int:
        return self.plan.count

    @property
    def paths(self) -> tuple[str, ...]:
        """Entries that are varied."""
        return self.plan.paths

    @property
    def counts(self) -> dict[str, int]:
        """How many runs have each status."""
        return dict(Counter(status or "missing" for status in self.columns["status"].tolist()))


def gathered(
    loaded: LoadedDeck, status: str, plan: Plan, what: Collected, rows: Iterable[Row | None]
) -> Sweep:
    """Return rows as columns; None stands for a run that is missing."""
    collected = tuple(map(str, what.quantities))
    wanted = [*collected, *_NUMBERS]
    numbers = {key: np.full(plan.count, math.nan) for key in wanted}
    words = {key: np.full(plan.count, "", dtype=object) for key in FACTS if key not in _NUMBERS}
    told: dict[str, str] = {}
    missing = 0
    for k, row in enumerate(rows):
        if row is None:
            missing += 1
            continue
        for key, value in zip(collected, row["collected"], strict=True):
            numbers[key][k] = math.nan if value is None else value
        for key in _NUMBERS:
            numbers[key][k] = math.nan if row[key] is None else row[key]
        for key, column in words.items():
            column[k] = told.setdefault(row[key] or "", row[key] or "")  # each text once
    columns = {**_varied(plan), **numbers, **words}
    deck, data = loaded.deck, loaded.source.data
    units = {
        path: unit_of(deck, path_in(data, path)) or values.unit for path, values in plan.by_path.items()
    }
    units |= {name: unit_of_quantity(read_quantity(name)) for name in collected}
    return Sweep(deck.name, status, plan, columns, collected, missing, units, what.columns)


def _varied(plan: Plan) -> dict[str, Array]:
    """Return the values of what is varied, by path."""
    found: dict[str, Array] = {}
    for path, values in zip(plan.paths, plan.values, strict=True):
        found[path] = np.empty(plan.count, dtype=float if values.numeric else object)
    for k in range(plan.count):
        row: tuple[Value, ...] = plan.told(k)
        for path, value in zip(plan.paths, row, strict=True):
            found[path][k] = value
    return found
