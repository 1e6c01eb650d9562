"""Refinement to a target: elements, degrees, method and tolerance for a stated total error of one scene.

The error of a run is that of its mesh and that in time.  Each is found by refining one thing at a time (the
elements or the degree of a beam, the tolerance) and looking at how far the channels move: the `change` of a
move is the error it took away, and what is left of a falling series of changes is that of a geometric one
(Richardson's argument, with the ratio that was observed).  The part with the most left is refined next, by
the way that took away most for its work so far.  An earlier level is the answer if its distance to the finest
one, plus what that one has left, keeps the target: its error is measured then, save for the small rest.  The
finest level itself is taken only with a factor of safety, as its error is extrapolated.

Where the deck leaves the method open, others are raced against the default one (`hfsim.studies.methods`) as
soon as an error in time has been measured, and again when the mesh has become much finer or the error much
smaller; whatever the search comes to, races have taken no more than a stated part of its time.  A method that
wins is raced on the current mesh too before it is gone on with.

Choices rest on counts of work (evaluations times unknowns), not on times, so that they repeat; that of the
method cannot, and has a margin instead.
Nothing is printed or written here.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from hfsim.integrators import METHODS
from hfsim.parts.bodies import BeamSpec
from hfsim.run.clock import PhaseClock
from hfsim.run.distance import channel_errors, farthest
from hfsim.run.integration import Integration, run_integration
from hfsim.run.solution import Channel, Run
from hfsim.run.stop import Budget, Progress, TimeUp
from hfsim.scene.build import Scene, build
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.schema import is_judged
from hfsim.simulate import assess, compute_channels, sample
from hfsim.studies.bench import mesh_words, tidy
from hfsim.studies.methods import MARGIN, Contest, Entry, Probe, Turn, candidates
from hfsim.trust.adaptive import Leg

DEFAULT_BUDGET = 60.0
"""Time that a refinement may take unless the deck says otherwise [s]."""

SAFETY = 2.0
"""Factor on an error that is extrapolated, not measured."""

_LOOSEST = 1e-3
"""Tolerance to start with, or a tenth of the target."""
_TIGHTEST = 1e-13
_TIGHTER = 30.0
"""Factor by which a move tightens the tolerance."""
_COARSE = 2
"""Elements of each beam to start with, if the deck has more."""
_MAX_DEGREE = 9
"""Highest degree that is chosen: beyond it little is gained, and a change tells little of what is left."""
_SINGLE = 4
"""Number of beams up to which each is refined by itself; more of them are refined together."""
_FIRST_RATIO = {"mesh": 0.5, "time": 0.2}
"""Ratio of successive changes before it has been seen."""
_RATIOS = (1 / 3, 0.9)
"""Ratios that are believed: better ones may be luck, worse ones tell that nothing falls."""
_WASTE = 0.2
"""Part of the target below which an error in time is left alone."""
_QUIET = 0.25
"""Part of the mesh errors, or of the target, that the error in time must not exceed: or pass for theirs."""
_STALE = 2.5
"""Growth of the unknowns from which on the error in time is measured again."""
_STALLED = {"mesh": 5, "time": 3}
"""Number of last changes that are looked at for whether they shrink."""
_SHRUNK = 0.7
"""Factor by which one of the last two changes must be smaller than those before to have shrunk."""
_TRIAL = 0.1
"""Part of the duration that is run to see which coordinates cost less."""
_TRIAL_FROM = 20
"""Nodal and interior vectors of all beams from which this is tried."""
_FAILURES = 2
"""Moves that may fail in a row."""
_COST_ORDER = 1.7
"""Power of the unknowns that the time of a run is expected to grow with."""
PROBING = 0.2
"""Part of the CPU time of a search, at any moment, that races between methods may have taken."""
_ANEW = 0.3
"""Fall of the error in time that can be measured from which methods are compared again."""


@dataclass(frozen=True)
class Setting:
    """What the refinement chooses.

    Attributes
    ----------
    mesh : tuple of (body, elements, degree)
        Every beam.
    tolerance : float
    coordinates, method : str
        As in decks.
    """

    mesh: tuple[tuple[str, int, int], ...]
    tolerance: float
    coordinates: str = "auto"
    method: str = "auto"

    def applied(self, loaded: LoadedDeck) -> LoadedDeck:
        """Return the deck with this setting, and without a target or elements left open."""
        bodies = dict(loaded.deck.bodies)
        for name, elements, degree in self.mesh:
            bodies[name] = bodies[name].model_copy(update={"elements": elements, "degree": degree})
        none = dict.fromkeys(("target_error", "target_channels", "budget"))
        mine = {"tolerance": self.tolerance, "coordinates": self.coordinates, "method": self.method}
        solve = loaded.deck.solve.model_copy(update={**none, **mine})
        deck = loaded.deck.model_copy(update={"bodies": bodies, "solve": solve})
        return replace(loaded, deck=deck, auto_elements=())

    @property
    def words(self) -> str:
        """The mesh in words, the same for all beams or beam by beam."""
        kinds = {mesh_words(n, p) for _, n, p in self.mesh}
        if len(kinds) < 2:
            return f"{kinds.pop()}{' each' if len(self.mesh) > 1 else ''}" if kinds else "no beams"
        return ", ".join(f"{name}: {mesh_words(n, p)}" for name, n, p in self.mesh)


@dataclass
class Level:
    """One run of a refinement.

    Attributes
    ----------
    number : int
    refined : str
        What was refined to get here; empty for the first.
    setting : Setting
    status, reason : str
        ``done``, ``failed`` or ``over budget``; why.
    unknowns, steps : int
    cpu : float
        CPU time, building and sampling included [s].
    wall : float
        The same on the clock [s].
    work : float
        Evaluations times unknowns.
    change : float or None
        Largest difference to the level that was refined, relative to the channel's range [-].
    channel : str
        The channel with it.
    estimate : float or None
        Error as it is known in the end [-].
    base : int
        Number of the level that was refined.
    """

    number: int
    refined: str
    setting: Setting
    status: str = "done"
    reason: str = ""
    unknowns: int = 0
    steps: int = 0
    cpu: float = 0.0
    wall: float = 0.0
    work: float = 0.0
    change: float | None = None
    channel: str = ""
    estimate: float | None = None
    base: int = 0
    scene: Scene | None = field(default=None, repr=False)
    done: Integration | None = field(default=None, repr=False)
    clock: PhaseClock = field(default_factory=PhaseClock, repr=False)
    channels: tuple[Channel, ...] = field(default=(), repr=False)

    def facts(self) -> dict[str, Any]:
        """Return JSON-ready facts."""
        names = (
            "number", "refined", "status", "reason", "unknowns", "steps", "change", "channel", "estimate",
        )  # fmt: skip
        mesh = {body: {"elements": n, "degree": p} for body, n, p in self.setting.mesh}
        facts = {name: getattr(self, name) for name in names}
        return {**facts, "cpu_s": self.cpu, "tolerance": self.setting.tolerance,
                "method": self.setting.method if self.done is None else self.done.method,
                "coordinates": self.setting.coordinates, "bodies": mesh}  # fmt: skip

    def entry(self) -> Entry:
        """Return the level as one to be raced against."""
        assert self.scene is not None and self.done is not None
        seconds = self.clock.cpu["solve"]
        return Entry(self.done.method, self.setting.tolerance, self.scene, self.done, seconds)


@dataclass
class _Part:
    """What one group of beams, or the integration in time (no beams), adds to the error.

    Attributes
    ----------
    kinds : tuple of str
        Ways to refine it: ``degree``, ``elements``; ``tolerance``.
    bodies : tuple of str
    changes : list of float
        What each move changed [-]: about the error before it.
    moves : list of (kind, work before, work after)
    blocked : set of str
        Kinds that failed.
    measured_at : int
        Unknowns of the level of the last change.
    kept : bool
        Whether all was left as it was after the last change: the finer run was but to find that out.
    begin : int
        Number of the first change on this mesh, of tolerances.
    """

    kinds: tuple[str, ...]
    bodies: tuple[str, ...] = ()
    changes: list[float] = field(default_factory=list)
    moves: list[tuple[str, float, float]] = field(default_factory=list)
    blocked: set[str] = field(default_factory=set)
    measured_at: int = 0
    kept: bool = False
    begin: int = 0

    def note(self, change: float, kind: str, base: Level, level: Level, enough: float) -> None:
        """Take in what a move has changed; if that is little enough, the coarser level is kept."""
        if kind == "tolerance" and (self.kept or level.unknowns != self.measured_at):
            self.begin = len(self.changes)
        self.changes.append(change)
        self.moves.append((kind, base.work, level.work))
        self.measured_at = level.unknowns
        self.kept = change <= enough

    def begin_anew(self, error: float, level: Level) -> None:
        """Take the error in time of a level that another method has made."""
        self.begin = len(self.changes)
        self.changes.append(error)
        self.moves.append(("method", level.work, level.work))
        self.measured_at, self.kept = level.unknowns, True

    @property
    def of(self) -> str:
        return "mesh" if self.bodies else "time"

    @property
    def series(self) -> list[float]:
        """Those changes that follow one another: of tolerances, those on one mesh."""
        return self.changes[self.begin :]

    @property
    def ratio(self) -> float:
        """Ratio of the next change to the last one."""
        if len(self.series) < 2:
            return _FIRST_RATIO[self.of]
        before, last = self.series[-2:]
        return min(max(last / max(before, 1e-300), _RATIOS[0]), _RATIOS[1])

    @property
    def left(self) -> float:
        """Error of the current level that refining this part further would take away [-]."""
        if not self.changes:
            return math.inf
        if self.stalled:
            # nothing to extrapolate: the size of the changes is all that is known
            return max(self.changes[-2:])
        if self.kept:
            return self.changes[-1] * (1.0 + self.ratio)
        return self.changes[-1] * self.ratio / (1.0 - self.ratio)

    @property
    def stalled(self) -> bool:
        """Whether the changes do not shrink."""
        recent = self.series[-_STALLED[self.of] :]
        if len(recent) < _STALLED[self.of]:
            return False
        # against the middle one: on coarse meshes a change may be small, or large, by luck
        return min(recent[-2:]) > _SHRUNK * sorted(recent[:-2])[len(recent[:-2]) // 2]

    def efficiency(self, kind: str) -> float:
        """Order by which this kind of move last made the error fall with work; 1 before it is known."""
        found = 1.0
        for i, (name, before, after) in enumerate(self.moves[:-1]):
            if name == kind:
                fall = math.log(max(self.changes[i], 1e-300) / max(self.changes[i + 1], 1e-300))
                found = fall / max(math.log(after / before), 0.1)
        return found

    def choices(self, setting: Setting) -> list[str]:
        """Return the kinds of move that are possible, the best first."""
        tried = [kind for kind, _, _ in self.moves]
        possible = [k for k in self.kinds if k not in self.blocked and refined(setting, k, self.bodies)]
        return sorted(possible, key=lambda k: (-self.efficiency(k), tried.count(k)))


def refined(setting: Setting, kind: str, bodies: Sequence[str]) -> Setting | None:
    """Return a finer setting; None if there is none.

    Parameters
    ----------
    setting : Setting
    kind : str
        ``elements`` (twice as many), ``degree`` (two more, at most 9) or ``tolerance`` (a 30th).
    bodies : sequence of str
        Beams that are refined.
    """
    if kind == "tolerance":
        tighter = setting.tolerance / _TIGHTER
        return replace(setting, tolerance=float(f"{tighter:.1e}")) if tighter >= _TIGHTEST else None
    finer: list[tuple[str, int, int]] = []
    for name, n, p in setting.mesh:
        more = (name, 2 * n, p) if kind == "elements" else (name, n, max(p, min(p + 2, _MAX_DEGREE)))
        finer.append(more if name in bodies else (name, n, p))
    return replace(setting, mesh=tuple(finer)) if tuple(finer) != setting.mesh else None


def coarse(loaded: LoadedDeck, target: float) -> Setting:
    """Return the setting to begin with: at most two elements a beam to be refined, a loose tolerance."""
    fixed = fixed_meshes(loaded)
    mesh = (
        (name, spec.elements if name in fixed else min(spec.elements, _COARSE), spec.degree)
        for name, spec in _beams(loaded).items()
    )
    solve = loaded.deck.solve
    return Setting(tuple(mesh), min(_LOOSEST, 0.1 * target), solve.coordinates, solve.method)


def _beams(loaded: LoadedDeck) -> dict[str, BeamSpec]:
    return {name: spec for name, spec in loaded.deck.bodies.items() if isinstance(spec, BeamSpec)}


def fixed_meshes(loaded: LoadedDeck) -> tuple[str, ...]:
    """Return the beams whose mesh is kept: those with a number beside others with ``elements: auto``."""
    auto = loaded.auto_elements
    return tuple(name for name in _beams(loaded) if auto and name not in auto)


def _parts(loaded: LoadedDeck) -> list[_Part]:
    fixed = fixed_meshes(loaded)
    beams = {name: spec for name, spec in _beams(loaded).items() if name not in fixed}
    groups = [(name,) for name in beams] if len(beams) <= _SINGLE else [tuple(beams)]
    parts = []
    for group in groups:
        cable = all(beams[name].element == "cable" for name in group)
        parts.append(_Part(("degree", "elements") if cable else ("elements",), group))
    return parts


@dataclass(frozen=True)
class Refinement:
    """What a refinement found.

    Attributes
    ----------
    target : float
    status : str
        ``reached``; ``missed`` (more refinement does not help), ``limit`` (the budget is used up),
        ``interrupted``, or ``failed`` (there is no level that reached its end).
    reason : str
        Why it ended so.
    levels : tuple of Level
    chosen : Level
        The one whose results count.
    why : str
        Why that one.
    cpu, budget, used : float
        CPU time of all levels, time allowed and used [s].
    fixed : tuple of str
        Beams that keep the deck's mesh: its error is in no estimate.
    method : str
        How the method was chosen, in words.
    probes : tuple of Probe
        Races between methods.
    probing : float
        CPU time of all that [s].
    """

    target: float
    status: str
    reason: str
    levels: tuple[Level, ...]
    chosen: Level
    why: str
    cpu: float
    budget: float
    used: float
    fixed: tuple[str, ...] = ()
    method: str = ""
    probes: tuple[Probe, ...] = ()
    probing: float = 0.0

    @property
    def exit_code(self) -> int:
        """As documented for the program."""
        return {"reached": 0, "missed": 4, "limit": 5, "interrupted": 130, "failed": 3}[self.status]

    def facts(self) -> dict[str, Any]:
        """Return JSON-ready facts, the section ``refinement`` of summaries."""
        return {
            "target": self.target,
            "status": self.status,
            "reason": self.reason,
            "estimate": self.chosen.estimate,
            "limiting_channel": self.chosen.channel,
            "chosen": {**self.chosen.facts(), "why": self.why},
            "levels": [level.facts() for level in self.levels],
            "cpu_s": self.cpu,
            "budget_s": self.budget,
            "used_s": self.used,
            "fixed_meshes": list(self.fixed),
            "method_choice": self.method,
            "probes": [probe.facts() for probe in self.probes],
            "probing_cpu_s": self.probing,
        }


@dataclass(frozen=True)
class _Pair:
    """A level whose error in time is known, and the one that it is known by; both on one mesh."""

    level: Level
    reference: Level
    left: float
    """Error in time of the reference [-]."""
    goal: float
    """Error in time at which methods are compared: what the target asks for, or what can be measured [-]."""


class _Search:
    """The state of a refinement."""

    def __init__(self, loaded: LoadedDeck, model: str | None, budget: Budget) -> None:
        solve = loaded.deck.solve
        assert solve.target_error is not None
        self.loaded, self.model, self.budget = loaded, model or solve.model, budget
        self.target = solve.target_error
        self.counted = solve.target_channels or tuple(filter(is_judged, loaded.deck.channels))
        self.parts = _parts(loaded)
        self.time = _Part(("tolerance",))
        self.levels: list[Level] = []
        self.current: Level | None = None
        self.tried_at = _TRIAL_FROM / _STALE
        self.races = _Races(self)

    # Levels -------------------------------------------------------------------------------------------

    def solve(self, words: str, setting: Setting) -> Level:
        """Run one level; what it took and whether it failed is noted in it.

        Raises
        ------
        KeyboardInterrupt, TimeUp
            The level is noted then too.
        """
        level = Level(len(self.levels), words, setting)
        self.levels.append(level)
        cpu, wall = time.process_time(), time.perf_counter()
        try:
            self._integrate(level)
        finally:
            level.cpu, level.wall = time.process_time() - cpu, time.perf_counter() - wall
        return level

    def _integrate(self, level: Level) -> None:
        with level.clock.phase("build"):
            level.scene = scene = build(level.setting.applied(self.loaded), self.model)
        level.unknowns = scene.system.n
        with level.clock.phase("solve"):
            level.done = run_integration(scene, scene.deck.solve, self.guard(scene.deck.solve.duration))
        counts, stop = level.done.problem.counts, level.done.stop
        level.steps, level.work = counts.steps, float(max(counts.evaluations, 1) * level.unknowns)
        if level.done.method in METHODS:
            level.setting = replace(level.setting, method=level.done.method)
        if stop is not None:
            level.status, level.reason = "failed", str(stop) or "interrupted"
            if isinstance(stop, KeyboardInterrupt):
                raise stop
            if isinstance(stop, TimeUp):
                level.status = "over budget"
                raise stop
            return
        level.channels = compute_channels(sample(scene, level.done.trajectory))

    def guard(self, duration: float) -> Progress:
        """Return a progress callback that ends an integration, its steps kept, when the budget is used up."""

        def check(share: float) -> None:
            self.budget.report(min(1.0, self.budget.used / self.budget.seconds))
            # a start that is no step yet cannot be kept
            if share > 0.0 and self.budget.left < 0.0:
                reason = f"the budget of {self.budget.seconds:g} s is used up"
                raise TimeUp(reason, share)

        return check

    def distance(self, level: Level, finer: Level) -> tuple[float, str]:
        """Return how far a level is from a finer one in the worst channel that counts, and that channel."""
        relative = channel_errors(level.channels, finer.channels)[1]
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
        mine = next((level for level in enough if level.setting.method == method), None)
        other = next((level for level in enough if level.setting.method != method), None)
        # counts of work tell nothing across methods; times do, with the margin that makes them repeat
        if mine is None or (other is not None and MARGIN * other.entry().cpu < mine.entry().cpu):
            return other
        return mine

    # Moves --------------------------------------------------------------------------------------------

    def stale(self, level: Level) -> bool:
        """Whether the error in time was last measured on a mesh much coarser than that of a level."""
        trusted = _STALE if self.time.left > 0.01 * self.target else 4.0 * _STALE
        return level.unknowns > trusted * self.time.measured_at

    def next_part(self) -> _Part:
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

    def enough(self, part: _Part) -> float:
        """Return the change up to which a part does not matter; a single beam always does."""
        if part is self.time:
            return _WASTE * self.target
        return _WASTE * self.target / len(self.parts) if len(self.parts) > 1 else 0.0

    def move(self, part: _Part) -> bool:
        """Refine one part; return whether that went well.

        Raises
        ------
        TimeUp
            If it would take, or has taken, more time than there is.
        """
        base = self.current
        assert base is not None
        kind = part.choices(base.setting)[0]
        setting = refined(base.setting, kind, part.bodies)
        assert setting is not None
        self._refuse_too_long(base, setting)
        setting = self._in_cheaper_coordinates(setting)
        whose = ", ".join(part.bodies) if len(part.bodies) <= _SINGLE else "all beams"
        level = self.solve(f"{kind} of {whose}" if part.bodies else kind, setting)
        if level.status != "done":
            part.blocked.add(kind)
            return False
        level.base = base.number
        level.change, level.channel = self.distance(base, level)
        part.note(level.change, kind, base, level, self.enough(part))
        if not part.kept:
            self.current = level
        if part is self.time:
            self.races.take_pair(base, level)
        return True

    def _in_cheaper_coordinates(self, setting: Setting) -> Setting:
        """Return the setting with those coordinates in which the first part of its motion takes less time."""
        size = sum(n * (p - 1) + 2 for _, n, p in setting.mesh)
        free = self.loaded.deck.solve.coordinates == "auto" and self.model in ("exact", "linear")
        free = free and setting.method != "energy"
        if not free or size < _STALE * self.tried_at:
            return replace(setting, coordinates=self.current.setting.coordinates) if self.current else setting
        self.tried_at = size
        costs: dict[str, float] = {}
        for coordinates in ("frame", "absolute"):
            trial = replace(setting, coordinates=coordinates)
            scene = build(trial.applied(self.loaded), self.model)
            span = _TRIAL * scene.deck.solve.duration
            solve = scene.deck.solve.model_copy(update={"duration": span, "max_steps": None})
            start = time.process_time()
            done = run_integration(scene, solve, self.guard(span))
            costs[coordinates] = time.process_time() - start if done.stop is None else math.inf
        return replace(setting, coordinates=min(costs, key=lambda name: costs[name]))

    def _refuse_too_long(self, base: Level, setting: Setting) -> None:
        vectors = [sum(n * (p - 1) + 2 for _, n, p in s.mesh) for s in (base.setting, setting)]
        growth = 1.4 if vectors[0] == vectors[1] else (vectors[1] / vectors[0]) ** _COST_ORDER
        left = max(self.budget.left, 0.0)
        if growth * base.wall > left:
            words = f"the next level would take about {growth * base.wall:.2g} s"
            raise TimeUp(f"{words}, of {self.budget.seconds:g} s are left {left:.2g}")


class _Races:
    """When methods are compared in a search, and what follows from it."""

    def __init__(self, search: _Search) -> None:
        self.search, self.start = search, time.process_time()
        self.stated = search.loaded.deck.solve.method
        self.goal = _WASTE * search.target
        self.pair: _Pair | None = None
        self.open: dict[str, Turn] = {}
        self.ahead: Entry | None = None
        self.probes: list[Probe] = []
        self.taken: list[str] = []
        self.used = 0.0
        self._since: float | None = None

    def allowance(self) -> float:
        """Return the CPU time that races may still take [s]."""
        now = time.process_time()
        used = self.used + (0.0 if self._since is None else now - self._since)
        return (PROBING * (now - self.start) - used) / (1.0 - PROBING)

    def take_pair(self, base: Level, finer: Level) -> None:
        """Take note of levels of two tolerances; methods are compared by them if that is due."""
        part = self.search.time
        assert finer.change is not None
        left = finer.change * part.ratio / (1.0 - part.ratio)
        if self.stated != "auto" or base.unknowns != finer.unknowns or not math.isfinite(left):
            return
        level, known = (base if part.kept else finer), self.pair
        goal = max(self.goal, 2.0 * left)
        if known is None or level.unknowns > _STALE * known.level.unknowns or goal < _ANEW * known.goal:
            self.pair, self.ahead = _Pair(level, finer, left, goal), None
            self.open = dict.fromkeys(candidates(level.setting.method), Turn(level.setting.tolerance))

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
            if self.ahead is None:
                self.ahead = self._contest(pair, self.open)
            if self.ahead is None:
                return
            if here:
                self._adopt(self.ahead, pair)
                return
            tighter = current.setting.tolerance / pair.level.setting.tolerance
            again = {self.ahead.method: Turn(self.ahead.tolerance * min(tighter, 1.0))}
            there = _Pair(current, current, self.search.time.left, pair.goal)
            winner = self._contest(there, again)
            if winner is not None:
                self._adopt(winner, there)
            elif not again:
                self.ahead = None
        finally:
            self.used += time.process_time() - self._since
            self._since = None

    def _contest(self, pair: _Pair, open_methods: dict[str, Turn]) -> Entry | None:
        search, level = self.search, pair.level

        def setting(method: str, tolerance: float) -> Setting:
            where = "absolute" if method == "energy" else level.setting.coordinates
            return replace(level.setting, method=method, tolerance=tolerance, coordinates=where)

        def scene_for(method: str, tolerance: float) -> Scene:
            assert level.scene is not None
            loaded = setting(method, tolerance).applied(search.loaded)
            if method != "energy":
                return replace(level.scene, loaded=loaded)
            if search.loaded.deck.solve.coordinates == "frame":
                why = "method energy makes its steps in absolute coordinates"
                raise search.loaded.problem("solve.coordinates", why)
            return build(loaded, search.model)

        def error_of(scene: Scene, done: Integration) -> float:
            found = Level(-1, "", level.setting, channels=compute_channels(sample(scene, done.trajectory)))
            return search.distance(found, pair.reference)[0] + pair.left

        guard = search.guard(search.loaded.deck.solve.duration)
        mark = level.entry()
        contest = Contest(
            mark, pair.goal, scene_for, error_of, self.allowance, guard, open_methods, self.probes
        )
        return contest.hold()

    def _adopt(self, entry: Entry, pair: _Pair) -> None:
        """Make the run of a method that won the current level."""
        search, beaten = self.search, pair.level
        solve = entry.scene.deck.solve
        setting = replace(
            beaten.setting, method=entry.method, tolerance=entry.tolerance, coordinates=solve.coordinates
        )
        level = Level(len(search.levels), "method", setting, base=pair.reference.number)
        level.scene, level.done, level.unknowns = entry.scene, entry.done, entry.scene.system.n
        level.steps = entry.done.problem.counts.steps
        level.cpu = level.wall = entry.cpu
        for clock in (level.clock.cpu, level.clock.wall):
            clock |= {"build": 0.0, "solve": entry.cpu}
        level.channels = compute_channels(sample(entry.scene, entry.done.trajectory))
        level.change, level.channel = search.distance(level, pair.reference)
        mark = beaten.entry()
        level.work = float(max(entry.done.problem.counts.evaluations, 1) * level.unknowns)
        search.levels.append(level)
        search.current = level
        search.time.begin_anew(entry.error, level)
        self.pair, self.ahead = replace(pair, level=level), None
        self.open.pop(entry.method, None)
        self.taken.append(
            f"{entry.method}: {entry.cpu:.2g} s for an error in time of {entry.error:.1e}, "
            f"{entry.to_beat / entry.cpu:.2g} times sooner than {mark.method}"
        )

    @property
    def words(self) -> str:
        """How the method was chosen."""
        if self.stated != "auto":
            return f"{self.stated}, kept: the deck names it"
        late = f"; not judged for lack of time: {', '.join(self.open)}" if self.open else ""
        if self.taken:
            return "; then ".join(self.taken) + late
        level = self.search.current or self.search.levels[0]
        default = f"{level.setting.method if level.done is None else level.done.method}, the default"
        if self.pair is None:
            return f"{default}: no error in time was measured to compare methods at"
        judged = dict.fromkeys(probe.method for probe in self.probes if probe.method not in self.open)
        if not judged:
            return default + late
        return (
            f"{default}: none of {', '.join(judged)} reaches an error in time of {self.pair.goal:.1e} "
            f"{MARGIN:g} times sooner{late}"
        )


def refine(
    loaded: LoadedDeck,
    model: str | None = None,
    progress: Progress | None = None,
    diagnosis: bool = False,
) -> tuple[Run, LoadedDeck]:
    """Simulate a scene with elements, degrees, method and tolerance that reach its ``solve.target_error``.

    Parameters
    ----------
    loaded : LoadedDeck
        With a target; if it leaves the elements of some beams open, only these are refined.
    model : str, optional
        Instead of the deck's.
    progress : callable, optional
        Called with the share of the budget that is used.
    diagnosis : bool
        Whether to find out by short experiments why the run fails or is suspicious.

    Returns
    -------
    Run
        Of the chosen level; its statistics have the section ``refinement``.  A target that is missed
        (exit code 4) or a budget used up (status ``limit``) is told in it.
    LoadedDeck
        The deck with what was chosen and without the target: a plain run of it gives the same.

    Raises
    ------
    DeckError
        If the scene cannot be assembled.
    """
    budget = Budget(loaded.deck.solve.budget or DEFAULT_BUDGET)
    if progress is not None:
        budget.report = progress
    start = time.process_time()
    search = _Search(loaded, model, budget)
    status, reason = _search(search)
    found = _concluded(search, status, reason, time.process_time() - start)
    return _as_run(search, found, diagnosis), found.chosen.setting.applied(loaded)


def _search(search: _Search) -> tuple[str, str]:
    """Refine until the target is kept or nothing more can be done; return status and reason."""
    try:
        if not _begin(search):
            return "failed", search.levels[-1].reason
        failures = 0
        while True:
            part = search.next_part()
            if search.current and not part.choices(search.current.setting):
                return "missed", f"the {'mesh' if part.bodies else 'tolerance'} cannot be refined further"
            if search.move(part):
                failures = 0
            else:
                failures += 1
                if failures >= _FAILURES:
                    return "missed", f"finer levels fail: {search.levels[-1].reason}"
                continue
            if part.stalled and part.left > search.target:
                return "missed", _stalled_words(search, part)
            search.races.hold()
            answer = search.answer()
            if answer is not None and not search.stale(answer):
                return "reached", ""
    except TimeUp as stop:
        return "limit", str(stop)
    except KeyboardInterrupt:
        return "interrupted", "interrupted from the keyboard"


def _begin(search: _Search) -> bool:
    """Run the first level, or the deck's own setting if the coarse one fails; return whether one ended."""
    first = search.solve("", coarse(search.loaded, search.target))
    if first.status != "done":
        mesh = tuple((name, spec.elements, spec.degree) for name, spec in _beams(search.loaded).items())
        tolerance = min(first.setting.tolerance, search.loaded.deck.solve.tolerance)
        coordinates, method = first.setting.coordinates, first.setting.method
        first = search.solve("as in the deck", Setting(mesh, tolerance, coordinates, method))
    if first.status == "done":
        search.current = first
    return first.status == "done"


def _stalled_words(search: _Search, part: _Part) -> str:
    last = [level for level in search.levels if level.change is not None][-1]
    what = f"finer meshes of {', '.join(part.bodies)}" if part.bodies else "tighter tolerances"
    others = "; without it: --target-channels with the others" if len(search.counted) > 1 else ""
    return (
        f"{what} do not bring {last.channel or 'the channels'} closer: the last changes are "
        f"{', '.join(tidy(change) for change in part.changes[-3:])}{others}"
    )


def _concluded(search: _Search, status: str, reason: str, cpu: float) -> Refinement:
    """Give every level its error and choose one."""
    current, estimates = search.current, list(search.estimates())
    for level, error in estimates:
        level.estimate = error if math.isfinite(error) else None
    chosen = search.answer() if status == "reached" else current
    if chosen is None:
        chosen = search.levels[-1]
        why = "no level reached its end"
    elif chosen is current:
        chosen.channel = next((one.channel for one in reversed(search.levels) if one.channel), "")
        why = f"the finest level; its error is extrapolated, with a factor of {SAFETY:g} for safety"
        if any(part.stalled for part in (*search.parts, search.time)):
            why = f"the finest level; its error is taken as {SAFETY:g} times the changes that do not shrink"
        if chosen.estimate is None:
            why = "the finest level; too little was run to know its error"
    else:
        assert current is not None
        distance, chosen.channel = search.distance(chosen, current)
        why = (
            f"the cheapest level that keeps the target; its error is measured: {tidy(distance)} from "
            f"level {current.number}, which has {tidy(search.left)} left"
        )
    method = search.races.words
    if search.races.taken and chosen.setting.method != search.races.taken[-1].split(":")[0]:
        method += f"; the level chosen is by {chosen.setting.method} all the same, on a coarser mesh"
    return Refinement(
        target=search.target, status=status, reason=reason, levels=tuple(search.levels), chosen=chosen,
        why=why, cpu=cpu, budget=search.budget.seconds, used=search.budget.used,
        fixed=fixed_meshes(search.loaded), method=method, probes=tuple(search.races.probes),
        probing=search.races.used,
    )  # fmt: skip


def _as_run(search: _Search, found: Refinement, diagnosis: bool) -> Run:
    """Return the run of the chosen level as `simulate` would, with the refinement in its statistics."""
    chosen = found.chosen
    if chosen.scene is None or chosen.done is None:
        raise KeyboardInterrupt  # before there was anything
    clock = chosen.clock
    clock.cpu["refinement"] = found.cpu - sum(clock.cpu.values())
    clock.wall["refinement"] = found.used - sum(clock.wall.values())
    run = assess([Leg(chosen.scene, chosen.done)], clock, error_estimate=False, diagnosis=diagnosis)
    facts: dict[str, Any] = {"refinement": found.facts(), "error_estimate": chosen.estimate}
    if search.current is not None and chosen.estimate is not None:
        other = search.current if chosen is not search.current else search.levels[chosen.base]
        facts["error_by_channel"] = channel_errors(chosen.channels, other.channels)[0]
        facts["error_estimate_by"] = f"refinement: {found.why}"
    run = replace(run, statistics={**run.statistics, **facts})
    if found.status == "reached" or search.current is None:
        return run
    status = {"missed": "done"}.get(found.status, found.status)
    return replace(run, status=status, exit_code=found.exit_code, reason=_verdict(found))


def _verdict(found: Refinement) -> str:
    """Return in a sentence how far a refinement came that did not reach its target."""
    estimate = found.chosen.estimate
    known = "its error is not known" if estimate is None else f"the error is estimated at {tidy(estimate)}"
    where = f" in {found.chosen.channel}" if found.chosen.channel else ""
    return f"target error {found.target:g} not reached, {known}{where}: {found.reason}"
