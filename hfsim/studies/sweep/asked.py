"""What is asked of a sweep, by options or by the deck itself."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from hfsim.deck.ranges import Values
from hfsim.scene.loading import LoadedDeck
from hfsim.studies.sweep.collected import COLLECT, Collected, read_collected
from hfsim.studies.sweep.plan import (
    SAMPLE,
    SAMPLER,
    SAMPLERS,
    SEED,
    TABLE,
    VARY,
    Plan,
    grid,
    refusal,
    sample,
    table,
)
from hfsim.studies.sweep.study import latest_end
from hfsim.studies.sweep.work import Setting

MANY = 100_000
"""Runs beyond which one is asked whether they are meant."""
_LEFT_OUT = ("sweep", "verify")
"""Entries of a deck that its runs go without."""


@dataclass(frozen=True)
class Asked:
    """What is asked for; what is None or empty is left to the deck's own entry ``sweep``.

    Attributes
    ----------
    vary : mapping of str to str
        Values by path.
    many : bool
        Whether more than `MANY` runs are meant.
    limit : float or None
        Wall time that a run may take [s].
    sensitivity : bool
        Whether derivatives at the values of the deck, or at one value each, are asked for.
    called : mapping of str to str
        What options are called where they are no options, but arguments of a function.
    """

    vary: Mapping[str, str] = field(default_factory=dict)
    sample: int | None = None
    sampler: str | None = None
    seed: int | None = None
    table: Path | None = None
    collect: Sequence[str] = ()
    many: bool = False
    error_estimate: bool = True
    mesh_error: bool = False
    diagnosis: bool = False
    limit: float | None = None
    sensitivity: bool = False
    called: Mapping[str, str] = field(default_factory=dict)

    def left_to(self, loaded: LoadedDeck) -> tuple[str, ...]:
        """Return the options whose place the deck's own entry ``sweep`` takes."""
        if loaded.deck.sweep is None or self.sensitivity:
            return ()
        runs = () if self.vary or self.table is not None else (VARY, TABLE)
        return runs if self.collect else (*runs, COLLECT)

    def completed(self, loaded: LoadedDeck) -> Asked:
        """Return the same with what the deck says where this says nothing."""
        said, found = loaded.deck.sweep, self
        if said is not None:
            if not self.vary and self.table is None:
                beside = None if said.runs is None else Path(loaded.source.file).parent / said.runs
                sample = said.sample if self.sample is None else self.sample
                found = replace(found, vary=said.vary, table=beside, sample=sample)
            written = loaded.source.as_written.get(("sweep", "collect"), said.collect)
            found = replace(found, collect=self.collect or tuple(map(str, written)))
        if found.sample is None:
            return found
        usual = (SAMPLERS[0], 1) if said is None else (said.sampler, said.seed)
        seed = usual[1] if self.seed is None else self.seed
        return replace(found, sampler=self.sampler or usual[0], seed=seed)

    def plan(self) -> Plan:
        """Return the runs, or raise `DeckError`."""
        for option, said in ((SAMPLER, self.sampler), (SEED, self.seed)):
            if said is not None and self.sample is None:
                raise refusal(option, "only samples have one, and nothing is sampled")
        if self.table is not None:
            if self.vary or self.sample is not None:
                raise refusal(TABLE, "is all: nothing is varied or sampled beside it")
            plan = table(self.table)
        elif self.sample is not None:
            assert self.sampler is not None and self.seed is not None
            if self.sampler not in SAMPLERS:
                known = ", ".join(SAMPLERS)
                raise refusal(SAMPLER, f"there is no sampler '{self.sampler}'; there are {known}")
            if self.seed < 0:
                raise refusal(SEED, f"must not be below 0, and is {self.seed}")
            plan = sample(self.vary, self.sample, self.sampler, self.seed)
        else:
            plan = grid(self.vary)
        if plan.count > MANY and not self.many:
            raise refusal(VARY, f"{plan.count} runs are many: say --yes if you mean it")
        return plan

    def refuse_runs(self) -> None:
        """Refuse runs where derivatives are asked for, which have their own; raise `DeckError`."""
        runs = {TABLE: self.table, SAMPLE: self.sample, SAMPLER: self.sampler, SEED: self.seed}
        for option, said in runs.items():
            if said is not None:
                raise refusal(option, "derivatives have runs of their own")
        if not self.vary:
            raise refusal(VARY, "nothing is varied", "name the entries that derivatives are wanted by")

    def setting(self, loaded: LoadedDeck) -> Setting:
        """Return what all runs of a deck share, but for what is collected."""
        left_out = (f"{key}=null" for key in _LEFT_OUT if loaded.source.data.get(key) is not None)
        return Setting(
            loaded.source.text, loaded.source.file, (*loaded.overrides, *left_out), Collected(),
            self.error_estimate, self.mesh_error, self.diagnosis, self.limit or math.inf,
        )  # fmt: skip

    def collecting(self, setting: Setting, loaded: LoadedDeck, vary: Mapping[str, Values]) -> Setting:
        """Return the same with what is collected while `vary` is varied, or raise `DeckError`."""
        if self.sensitivity and not self.collect:
            raise refusal(COLLECT, "nothing is collected", "name what derivatives are wanted of")
        end, moved = latest_end(setting, vary), any(path.startswith("parameters.") for path in vary)
        return replace(setting, collected=read_collected(self.collect, loaded, end, moved))
