"""One run of a sweep, in a worker process: from overrides to a row."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hfsim.deck.quantities import Quantity
from hfsim.errors import DeckError
from hfsim.marching.solution import Run
from hfsim.marching.stop import Budget, nobody
from hfsim.scene.loading import LoadedDeck, parse_deck
from hfsim.scene.more_channels import with_channels
from hfsim.simulate import simulate
from hfsim.studies.collect import Answer, Collector, channels_of
from hfsim.studies.sweep.collected import Collected

Row = dict[str, Any]
"""Facts of a run, JSON-ready: the attributes of `FACTS`, and ``collected``, a number or None each."""
FACTS = ("status", "class", "reason", "error_estimate", "energy_drift", "warnings", "cpu_s")
"""What is known of every run beside what is collected."""
REFUSED = "refused"
"""Status of a run whose deck is refused."""
_PLACES: dict[str, float | str] = {"modes": "start", "static": 0.0}
"""Studies beside the run that have quantities of their own: of which state, or of loads at which time [s]."""
LOST = "lost"
"""Status of a run whose workers died; taking a sweep up again repeats it."""


@dataclass(frozen=True)
class Setting:
    """What all runs of a sweep share.

    Attributes
    ----------
    text, file : str
        The deck as written.
    overrides : tuple of str
        Before those of each run.
    collected : Collected
        What is collected.
    error_estimate, mesh_estimate, diagnosis : bool
        As of `hfsim.simulate.simulate`.
    limit : float
        Wall time that a run may take [s].
    """

    text: str
    file: str
    overrides: tuple[str, ...]
    collected: Collected
    error_estimate: bool = True
    mesh_estimate: bool = False
    diagnosis: bool = False
    limit: float = math.inf

    def load(self, overrides: tuple[str, ...]) -> LoadedDeck:
        """Return the deck of a run, or raise `DeckError`."""
        return parse_deck(self.text, self.file, (*self.overrides, *overrides))

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """What is collected, in the deck as it is."""
        return self.collected.quantities

    def of_run(self, overrides: tuple[str, ...]) -> tuple[LoadedDeck, tuple[Quantity, ...]]:
        """Return the deck of a run, with what is collected, and what that is there; raise `DeckError`."""
        loaded = self.load(overrides)
        quantities = self.collected.of_run(loaded)
        return with_channels(loaded, channels_of(quantities)), quantities


Keep = Callable[[LoadedDeck, Run], dict[str, bytes]]
"""Makes the files that are kept of a run, by their names."""


def solve_row(
    setting: Setting, keep: Keep | None, overrides: tuple[str, ...]
) -> tuple[Row, dict[str, bytes]]:
    """Do one run; return its row and the files that are kept of it."""
    start = time.process_time()
    try:
        loaded, quantities = setting.of_run(overrides)
        known = _without_run(setting, quantities, loaded)
        if known and known.keys() == set(quantities):
            row = _row_without_run(setting, quantities, known)
            row["cpu_s"] = round(time.process_time() - start, 6)
            return row, {}
        collector = Collector(dict.fromkeys(quantities))
        run = _run(setting, loaded, collector)
    except DeckError as error:
        wrong = error.problems[0]
        why = f"{wrong.path}: {wrong.message}" if wrong.path else wrong.message
        return row_without(REFUSED, why, setting, "deck"), {}
    collected, why = _collected(quantities, run, known, collector)
    row = {
        "status": run.status,
        "class": (run.failure or {}).get("class", ""),
        "reason": run.reason or why,
        "error_estimate": _finite(run.statistics["error_estimate"]),
        "energy_drift": _finite(run.statistics["energy_drift"]),
        "warnings": len(run.statistics.get("warnings") or ()),
        "cpu_s": 0.0,
        "collected": collected,
    }
    if setting.mesh_estimate:
        row["mesh_error_estimate"] = _finite(run.statistics["mesh_error_estimate"])
    files = keep(loaded, run) if keep else {}
    row["cpu_s"] = round(time.process_time() - start, 6)
    return row, files


def _run(setting: Setting, loaded: LoadedDeck, collector: Collector) -> Run:
    """Return the run; but for diagnosis, what is found out about it does not depend on time."""
    progress = None
    if math.isfinite(setting.limit):
        progress = Budget(setting.limit).limiting(nobody)
    return simulate(
        loaded,
        progress=progress,
        error_estimate=setting.error_estimate,
        mesh_estimate=setting.mesh_estimate,
        diagnosis=setting.diagnosis,
        outlines=False,
        after=None if setting.diagnosis else math.inf,
        reader=collector,
    )


def _without_run(
    setting: Setting, quantities: Sequence[Quantity], loaded: LoadedDeck
) -> dict[Quantity, Answer]:
    """Return what is collected of small motions about the start, and of the equilibrium under its loads."""
    found: dict[Quantity, Answer] = {}
    for study, place in _PLACES.items():
        wanted = tuple(dict.fromkeys(one for one in quantities if one.studies[0] == study))
        if wanted:
            from hfsim.studies.verify.finders import Order as ToFind
            from hfsim.studies.verify.finders import answer

            bounds = (math.inf,) * len(wanted)
            order = ToFind(study, place, setting.text, setting.file, loaded.overrides, wanted, bounds)
            found |= zip(wanted, answer(order)[0], strict=True)
    return found


def _row_without_run(
    setting: Setting, quantities: Sequence[Quantity], found: Mapping[Quantity, Answer]
) -> Row:
    missing = [one for one in found.values() if one.value is None]
    why = next((one.reason for one in sorted(missing, key=lambda one: not one.failed)), "")
    row = row_without("failed" if any(one.failed for one in missing) else "done", why, setting)
    return {**row, "collected": [found[one].value for one in quantities]}


def _collected(
    quantities: Sequence[Quantity], run: Run, known: Mapping[Quantity, Answer], collector: Collector
) -> tuple[list[float | None], str]:
    """Return what is collected, nothing of a run that did not reach its end, and why some is missing."""
    values, why = list[float | None](), ""
    for one in quantities:
        found = known.get(one)
        if found is None:
            found = collector.answer(one, run) if run.status == "done" else Answer(None, reason=run.reason)
        values.append(_finite(found.value))
        why = why or found.reason
    return values, why


def row_without(status: str, reason: str, setting: Setting, kind: str = "") -> Row:
    """Return the row of a run that gave nothing."""
    told = {"status": status, "class": kind, "reason": reason, "warnings": 0, "cpu_s": 0.0}
    return {**dict.fromkeys(FACTS), **told, "collected": [None] * len(setting.quantities)}


def _finite(value: object) -> float | None:
    return float(value) if isinstance(value, (int, float)) and math.isfinite(value) else None
