"""When methods are compared in a refinement, and what follows from it."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace

from hfsim.integrators import steps_in_absolute_coordinates
from hfsim.marching.clock import PhaseClock
from hfsim.marching.integration import Integration
from hfsim.scene.build import Scene, build
from hfsim.studies.methods import MARGIN, Contest, Entry, Probe, Turn, candidates
from hfsim.studies.refine.level import Level
from hfsim.studies.refine.search import STALE, WASTE, Search

PROBING = 0.2
"""Part of the CPU time of a search, at any moment, that races between methods may have taken."""
_ANEW = 0.3
"""Fall of the error in time that can be measured from which methods are compared again."""


@dataclass(frozen=True)
class Pair:
    """A level whose error in time is known, and the one that it is known by; both on one mesh."""

    level: Level
    reference: Level
    left: float
    """Error in time of the reference [-]."""
    goal: float
    """Error in time at which methods are compared: what the target asks for, or what can be measured [-]."""


@dataclass
class Races:
    """Races between methods in a search.

    Attributes
    ----------
    start : float
        CPU time at which the search began [s].
    pair : Pair or None
        Levels by which methods are compared.
    open : dict of str to Turn
        Methods that are not judged yet.
    ahead : Entry or None
        A method that won on a mesh that has been refined since.
    taken : list of str
        The methods that were gone on with, in words; `winner` is the last one.
    used : float
        CPU time of the races that have ended [s].
    """

    search: Search
    start: float = field(default_factory=time.process_time)
    pair: Pair | None = None
    open: dict[str, Turn] = field(default_factory=dict)
    ahead: Entry | None = None
    probes: list[Probe] = field(default_factory=list)
    taken: list[str] = field(default_factory=list)
    winner: str = ""
    used: float = 0.0
    _since: float | None = None

    def allowance(self) -> float:
        """Return the CPU time that races may still take [s]."""
        now = time.process_time()
        used = self.used + (0.0 if self._since is None else now - self._since)
        return (PROBING * (now - self.start) - used) / (1.0 - PROBING)

    @property
    def stated(self) -> str:
        """Method that the deck states."""
        return self.search.loaded.deck.solve.method

    def take_pair(self) -> None:
        """Take note of a last level of another tolerance; methods are compared by it if that is due."""
        part, known, finer = self.search.time, self.pair, self.search.levels[-1]
        base = self.search.levels[finer.base]
        assert finer.change is not None
        left = finer.change * part.ratio / (1.0 - part.ratio)
        if self.stated != "auto" or base.unknowns != finer.unknowns or not math.isfinite(left):
            return
        level = base if part.kept else finer
        goal = max(WASTE * self.search.target, 2.0 * left)
        if known is None or level.unknowns > STALE * known.level.unknowns or goal < _ANEW * known.goal:
            self.pair, self.ahead = Pair(level, finer, left, goal), None
            self.open = dict.fromkeys(candidates(level.method), Turn(level.setting.tolerance))

    def hold(self) -> None:
        """Race methods that are still open as far as the time for it goes; go on with one that wins."""
        current, pair = self.search.current, self.pair
        if pair is None or current is None or not (self.open or self.ahead):
            return
        here = current.setting.mesh == pair.level.setting.mesh
        if not here and self.search.time.left > 0.5 * pair.goal:
            return  # nothing on this mesh is accurate enough to measure another method by
        self._since = time.process_time()
        try:
            self.ahead = self.ahead or self._contest(pair, self.open)
            if self.ahead is None:
                return
            winner: Entry | None = self.ahead
            if not here:
                tighter = min(current.setting.tolerance / pair.level.setting.tolerance, 1.0)
                again = {self.ahead.method: Turn(self.ahead.tolerance * tighter)}
                pair = Pair(current, current, self.search.time.left, pair.goal)
                winner = self._contest(pair, again)
                if not again:
                    self.ahead = None
            if winner is not None:
                self._adopt(winner, pair)
        finally:
            self.used += time.process_time() - self._since
            self._since = None

    def _contest(self, pair: Pair, open_methods: dict[str, Turn]) -> Entry | None:
        search, level = self.search, pair.level

        def scene_for(method: str, tolerance: float) -> Scene:
            assert level.scene is not None
            setting = replace(level.setting, method=method, tolerance=tolerance)
            if not steps_in_absolute_coordinates(method):
                return replace(level.scene, loaded=setting.applied(search.loaded))
            if search.loaded.deck.solve.coordinates == "frame":
                why = f"method {method} makes its steps in absolute coordinates"
                raise search.loaded.problem("solve.coordinates", why)
            return build(replace(setting, coordinates="absolute").applied(search.loaded))

        def error_of(scene: Scene, done: Integration) -> float:
            found = Level(-1, "", level.setting, scene=scene, done=done)
            found.read()
            return search.distance(found, pair.reference)[0] + pair.left

        contest = Contest(
            level.entry(), pair.goal, scene_for, error_of, self.allowance, search.guard(), open_methods,
            self.probes,
        )  # fmt: skip
        return contest.hold()

    def _adopt(self, entry: Entry, pair: Pair) -> None:
        """Make the run of a method that won the current level."""
        search, beaten, solve = self.search, pair.level, entry.scene.deck.solve
        setting = replace(
            beaten.setting, method=entry.method, tolerance=entry.tolerance, coordinates=solve.coordinates
        )
        level = Level(len(search.levels), "method", setting, cpu=entry.cpu, wall=entry.cpu)
        level.base, level.scene = pair.reference.number, entry.scene
        level.clock = PhaseClock(*({"build": 0.0, "solve": entry.cpu} for _ in range(2)))
        level.done = entry.done
        level.read()
        level.change, level.channel = search.distance(level, pair.reference)
        search.levels.append(level)
        search.current = level
        search.time.begin_anew(entry.error, level)
        self.pair, self.ahead, self.winner = replace(pair, level=level), None, entry.method
        self.open.pop(entry.method, None)
        self.taken.append(
            f"{entry.method}: {entry.cpu:.2g} s for an error in time of {entry.error:.1e}, "
            f"{entry.to_beat / entry.cpu:.2g} times sooner than {beaten.method}"
        )

    @property
    def words(self) -> str:
        """How the method was chosen."""
        if self.stated != "auto":
            return f"{self.stated}, kept: the deck names it"
        if self.pair is None:
            return "auto, the default: no error in time was measured to compare methods at"
        own = self.pair.level.method.split(", ")
        others = ", ".join(name for name in self.open if name not in own)
        late = f"; not judged for lack of time: {others}" if others else ""
        if (ahead := self.ahead) is not None:
            sooner = f"{ahead.method} was {ahead.to_beat / ahead.cpu:.2g} times sooner"
            here, current = self.pair.level.unknowns, self.search.current
            there = f" with {current.unknowns}" if current is not None else ""
            late = f"; {sooner} with {here} unknowns, and not timed{there}{late}"
        if self.taken:
            return "; then ".join(self.taken) + late
        unjudged = {*own, *self.open, ahead.method if ahead else ""}
        judged = dict.fromkeys(probe.method for probe in self.probes if probe.method not in unjudged)
        if not judged:
            return "auto, the default" + late
        reached = f"reaches an error in time of {self.pair.goal:.1e} {MARGIN:g} times sooner"
        return f"auto, the default: none of {', '.join(judged)} {reached}{late}"
