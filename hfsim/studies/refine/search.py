"""The state of a refinement: its levels, their errors, and the moves from one to the next."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import replace

from hfsim.errors import DeckError
from hfsim.integrators import steps_in_absolute_coordinates
from hfsim.marching.distance import channel_errors, farthest, scene_sizes
from hfsim.marching.integration import run_integration
from hfsim.marching.stop import Budget, Halted, Progress, TimeUp
from hfsim.maths.memory import available, in_bytes, resident
from hfsim.parts.channels import is_judged
from hfsim.scene.build import build
from hfsim.scene.loading import LoadedDeck
from hfsim.studies.methods import MARGIN
from hfsim.studies.refine.level import Level
from hfsim.studies.refine.part import Part, parts_of
from hfsim.studies.refine.setting import Setting, refined
from hfsim.studies.timing import solved

SAFETY = 2.0
"""Factor on an error that is extrapolated, not measured."""
WASTE = 0.2
"""Part of the target below which an error in time is left alone."""
STALE = 2.5
"""Growth of the unknowns from which on the error in time is measured again."""
_QUIET = 0.25
"""Part of the mesh errors, or of the target, that the error in time must not exceed: or pass for theirs."""
_TRIAL = 0.1
"""Part of the duration that is run to see which coordinates cost less."""
_TRIAL_FROM = 20
"""Nodal and interior vectors of all beams from which this is tried."""
_COST_ORDER = 1.7
"""Power of the unknowns that the time of a run is expected to grow with."""
_MEMORY_SHARE = 0.8
"""Part of the memory there is that a level may take."""


class Search:
    """The state of a refinement."""

    def __init__(self, loaded: LoadedDeck, budget: Budget) -> None:
        solve = loaded.deck.solve
        assert solve.target_error is not None
        self.loaded, self.budget = loaded, budget
        self.target = solve.target_error
        self.counted = solve.target_channels or tuple(filter(is_judged, loaded.deck.channels))
        self.parts = parts_of(loaded)
        self.time = Part(("tolerance",))
        self.levels: list[Level] = []
        self.current: Level | None = None
        self.signal: KeyboardInterrupt | None = None
        self.tried_at: float = _TRIAL_FROM / STALE

    # Levels -------------------------------------------------------------------------------------------

    def solve(self, words: str, setting: Setting) -> Level:
        """Run one level; what it took and whether it failed is noted in it.

        Raises
        ------
        KeyboardInterrupt, Halted, MemoryError
            The level is noted then too.
        """
        level = Level(len(self.levels), words, setting)
        self.levels.append(level)
        cpu, wall, held = time.process_time(), time.perf_counter(), resident()
        try:
            self._integrate(level)
        except MemoryError:
            level.status, level.reason = "failed", "not enough memory"
            raise
        except DeckError as error:  # a mesh that is refused for its size, say
            if level.number == 0:
                raise
            level.status, level.reason = "failed", error.problems[0].message
            raise Halted(level.reason) from error
        finally:
            level.cpu, level.wall = time.process_time() - cpu, time.perf_counter() - wall
            level.held = max(0, resident() - held)
        return level

    def _integrate(self, level: Level) -> None:
        with level.clock.phase("build"):
            level.scene = scene = build(level.setting.applied(self.loaded))
        with level.clock.phase("solve"):
            done = run_integration(scene, scene.deck.solve, self.guard())
        level.done = done
        if done.stop is None:
            level.read()
            return
        level.status = "over budget" if isinstance(done.stop, TimeUp) else "failed"
        level.reason = str(done.stop) or "interrupted"
        done.in_time()

    def guard(self) -> Progress:
        """Return a progress callback that ends an integration, its steps kept, when the budget is used up."""

        def check(share: float) -> None:
            self.budget.report(min(1.0, self.budget.used / self.budget.seconds))
            # a start that is no step yet cannot be kept
            if share > 0.0 and self.budget.left < 0.0:
                raise TimeUp(f"the budget of {self.budget.seconds:g} s is used up", share)

        return check

    def distance(self, level: Level, finer: Level) -> tuple[float, str]:
        """Return how far a level is from a finer one in the worst channel that counts, and that channel."""
        sizes = None if finer.scene is None else scene_sizes(finer.scene)
        relative = channel_errors(level.channels, finer.channels, sizes)[1]
        mine = {name: relative[name] for name in self.counted if name in relative}
        if any(math.isnan(value) for value in mine.values()):
            return math.inf, ""
        worst, error = farthest(mine)
        return error or 0.0, worst

    # Errors -------------------------------------------------------------------------------------------

    @property
    def left(self) -> float:
        """Extrapolated error of the current level [-]."""
        return sum(part.left for part in (*self.parts, self.time))

    def estimates(self) -> Iterator[tuple[Level, float]]:
        """Yield each level that reached the end with its error [-], those with the least work first."""
        current, left = self.current, self.left
        ended = [level for level in self.levels if level.channels]
        for level in sorted(ended, key=lambda one: one.work):
            if level is current:
                yield level, SAFETY * left
            elif current is not None and level.number < current.number:
                yield level, self.distance(level, current)[0] + left

    def answer(self) -> Level | None:
        """Return the cheapest level that keeps the target; None if there is none yet."""
        enough = [level for level, error in self.estimates() if error <= self.target]
        method = self.current.setting.method if self.current else ""
        mine, other = (
            next((level for level in enough if (level.setting.method == method) is same), None)
            for same in (True, False)
        )
        # counts of work tell nothing across methods; times do, with the margin that makes them repeat
        if mine is None or (other is not None and MARGIN * other.entry().cpu < mine.entry().cpu):
            return other
        return mine

    # Moves --------------------------------------------------------------------------------------------

    def stale(self, level: Level) -> bool:
        """Whether the error in time was last measured on a mesh much coarser than that of a level."""
        trusted = STALE if self.time.left > 0.01 * self.target else 4.0 * STALE
        return level.unknowns > trusted * self.time.measured_at

    def next_part(self) -> Part:
        """Return what is to be refined next."""
        assert self.current is not None
        if not self.time.changes or self.stale(self.current):
            return self.time
        unmeasured = [part for part in self.parts if not part.changes]
        if unmeasured:
            return unmeasured[0]
        worst = max(self.parts, key=lambda part: part.left, default=self.time)
        in_time = self.time.choices(self.current.setting)
        loud = self.time.left > _QUIET * max(worst.left if worst is not self.time else 0.0, self.target)
        return self.time if in_time and loud else worst

    def enough(self, part: Part) -> float:
        """Return the change up to which a part does not matter; a single beam always does."""
        if part is self.time:
            return WASTE * self.target
        return WASTE * self.target / len(self.parts) if len(self.parts) > 1 else 0.0

    def move(self, part: Part) -> bool:
        """Refine one part; return whether that went well.

        Raises
        ------
        Halted
            If it would take, or has taken, more time or memory than there is.
        """
        base = self.current
        assert base is not None
        kind = part.choices(base.setting)[0]
        setting = refined(base.setting, kind, part.bodies)
        assert setting is not None
        self.refuse_too_large(base, setting)
        setting = self._in_cheaper_coordinates(setting)
        level = self.solve(f"{kind}{part.whose}", setting)
        if level.status != "done":
            part.blocked.add(kind)
            return False
        level.base = base.number
        level.change, level.channel = self.distance(base, level)
        part.note(level.change, kind, base, level, self.enough(part))
        if not part.kept:
            self.current = level
        return True

    def _in_cheaper_coordinates(self, setting: Setting) -> Setting:
        """Return the setting with those coordinates in which the first part of its motion takes less time."""
        solve = self.loaded.deck.solve
        free = solve.coordinates == "auto" and solve.model in ("exact", "linear")
        free = free and not steps_in_absolute_coordinates(setting.method)
        if not free or setting.vectors < STALE * self.tried_at:
            return replace(setting, coordinates=self.current.setting.coordinates) if self.current else setting
        self.tried_at = setting.vectors
        trials = [replace(setting, coordinates=name) for name in ("frame", "absolute")]
        return min(trials, key=self._cost)

    def _cost(self, trial: Setting) -> float:
        """Return the CPU time that the first part of the motion takes [s]."""
        scene = build(trial.applied(self.loaded))
        span = _TRIAL * scene.deck.solve.duration
        short = scene.deck.solve.model_copy(update={"duration": span, "max_steps": None})
        done, cpu = solved(scene, short, self.guard())
        return cpu if done.stop is None else math.inf

    def refuse_too_large(self, base: Level, setting: Setting) -> None:
        """Raise `Halted` if a setting would not fit into time or memory left, judged by a level that ran."""
        before, after = base.setting.vectors, setting.vectors
        growth = 1.4 if before == after else (after / before) ** _COST_ORDER
        left = max(self.budget.left, 0.0)
        if growth * base.wall > left:
            words = f"the next level would take about {growth * base.wall:.2g} s"
            raise TimeUp(f"{words}, of {self.budget.seconds:g} s are left {left:.2g}")
        needed, there = after / max(before, 1) * base.held, _MEMORY_SHARE * available()
        if needed > there:
            words = f"the next level would take about {in_bytes(needed)} of memory"
            raise Halted(f"{words}, of which there are {in_bytes(there)}")
