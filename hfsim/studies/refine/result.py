"""What a refinement found: its levels, the one chosen and why, as facts and as a run."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from hfsim.errors import LimitReached, interruption_code
from hfsim.marching.distance import channel_errors
from hfsim.marching.integration import Leg
from hfsim.marching.record import Record
from hfsim.marching.solution import Run
from hfsim.simulate import assess
from hfsim.studies.agreement import tidy
from hfsim.studies.refine.level import Level
from hfsim.studies.refine.races import Races
from hfsim.studies.refine.search import SAFETY, Search
from hfsim.studies.refine.setting import fixed_meshes
from hfsim.trust.after import Wish


@dataclass(frozen=True)
class Refinement:
    """What a refinement found.

    Attributes
    ----------
    search, races : Search, Races
        As they were left.
    status : str
        ``reached``; ``missed`` (more refinement does not help), ``limit`` (the budget is used up),
        ``interrupted``, or ``failed`` (there is no level that reached its end).
    reason : str
        Why it ended so.
    chosen : Level
        The one whose results count.
    why : str
        Why that one.
    cpu, used : float
        CPU and wall time of all levels [s].
    """

    search: Search
    races: Races
    status: str
    reason: str
    chosen: Level
    why: str
    cpu: float
    used: float

    @property
    def exit_code(self) -> int:
        """As documented for the program."""
        interrupted = interruption_code(self.search.signal or KeyboardInterrupt())
        return {"reached": 0, "missed": 4, "limit": 5, "interrupted": interrupted, "failed": 3}[self.status]

    @property
    def method(self) -> str:
        """How the method was chosen, in words."""
        races, chosen = self.races, self.chosen.setting.method
        if races.winner in ("", chosen):
            return races.words
        return f"{races.words}; the level chosen is by {chosen} all the same, on a coarser mesh"

    def facts(self) -> dict[str, Any]:
        """Return JSON-ready facts, the section ``refinement`` of summaries."""
        search = self.search
        return {
            "target": search.target,
            "deck": search.loaded.deck.resolved(),
            "status": self.status,
            "reason": self.reason,
            "estimate": self.chosen.estimate,
            "limiting_channel": self.chosen.channel,
            "chosen": {**self.chosen.facts(), "why": self.why},
            "levels": [level.facts() for level in search.levels],
            "cpu_s": self.cpu,
            "budget_s": search.budget.seconds,
            "used_s": self.used,
            # their error is in no estimate
            "fixed_meshes": list(fixed_meshes(search.loaded)),
            "method_choice": self.method,
            "probes": [probe.facts() for probe in self.races.probes],
            "probing_cpu_s": self.races.used,
        }

    def run(self, wish: Wish) -> Run:
        """Return the run of the chosen level as `simulate` would, with the refinement in its statistics."""
        chosen, current = self.chosen, self.search.current
        if chosen.scene is None or chosen.done is None:
            raise self.search.signal or LimitReached(self.reason)  # before there was anything
        wish = wish._replace(diagnosis=wish.diagnosis and self.search.signal is None)
        clock = chosen.clock
        clock.cpu["refinement"] = self.cpu - sum(clock.cpu.values())
        clock.wall["refinement"] = self.used - sum(clock.wall.values())
        record, done = Record(), chosen.done
        spoiled = record.keep(chosen.scene, done.trajectory, done.problem.counts)
        legs = [Leg(chosen.scene, done._replace(stop=spoiled or done.stop), record.legs[-1])]
        run = assess(legs, record, clock, wish)
        facts: dict[str, Any] = {"refinement": self.facts(), "limiting_channel": chosen.channel or None}
        facts |= {"error_estimate": chosen.estimate, "error_estimate_channel": chosen.channel}
        facts["error_estimate_reason"] = "" if chosen.estimate is not None else self.why
        facts["mesh_error_estimate_reason"] = "the error estimate is that of mesh and time together"
        if current is not None and chosen.estimate is not None:
            other = current if chosen is not current else self.search.levels[chosen.base]
            facts["error_by_channel"] = channel_errors(chosen.channels, other.channels)[0]
            facts["error_estimate_by"] = f"refinement: {self.why}"
        run = replace(run, statistics={**run.statistics, **facts})
        if self.status == "reached" or (current is None and self.reason == run.reason):
            return run
        status = "done" if self.status == "missed" else self.status
        reason = self._verdict() if current else f"{run.reason}; {self.reason}"
        return replace(run, status=status, exit_code=self.exit_code, reason=reason)

    def _verdict(self) -> str:
        """Return in a sentence how far it came without reaching its target."""
        estimate, channel = self.chosen.estimate, self.chosen.channel
        known = "its error is not known"
        if estimate is not None:
            known = f"the error is estimated at {tidy(estimate)}"
        where = f" in {channel}" if channel else ""
        return f"target error {self.search.target:g} not reached, {known}{where}: {self.reason}"


def concluded(search: Search, races: Races, status: str, reason: str, cpu: float) -> Refinement:
    """Give every level its error and choose one."""
    current = search.current
    for level, error in search.estimates():
        level.estimate = error if math.isfinite(error) else None
    chosen = search.answer() if status == "reached" else current
    if chosen is None:
        begun = [level for level in search.levels if level.done] or search.levels
        chosen, why = begun[-1], "no level reached its end"
    elif chosen is current:
        chosen.channel = next((one.channel for one in reversed(search.levels) if one.channel), "")
        finer = any(level.channels and level.number > chosen.number for level in search.levels)
        what = "the level that finer ones were held against" if finer else "the finest level"
        why = f"{what}; {_of_finest(search, chosen)}"
    else:
        assert current is not None
        distance, chosen.channel = search.distance(chosen, current)
        why = (
            f"the cheapest level that keeps the target; its error is measured: {tidy(distance)} from "
            f"level {current.number}, which has {tidy(search.left)} left"
        )
    return Refinement(search, races, status, reason, chosen, why, cpu, search.budget.used)


def _of_finest(search: Search, level: Level) -> str:
    if level.estimate is None:
        return "too little was run to know its error"
    if any(part.stalled for part in (*search.parts, search.time)):
        return f"its error is taken as {SAFETY:g} times the changes that do not shrink"
    return f"its error is extrapolated, with a factor of {SAFETY:g} for safety"
