"""What each group of beams, and the integration in time, adds to the error."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from hfsim.scene.loading import LoadedDeck
from hfsim.studies.refine.level import Level
from hfsim.studies.refine.setting import Setting, beams_of, fixed_meshes, refined

_SINGLE = 4
"""Number of beams up to which each is refined by itself; more of them are refined together."""
_FIRST_RATIO = {"mesh": 0.5, "time": 0.2}
"""Ratio of successive changes before it has been seen."""
_RATIOS = (1 / 3, 0.9)
"""Ratios that are believed: better ones may be luck, worse ones tell that nothing falls."""
_STALLED = {"mesh": 5, "time": 3}
"""Number of last changes that are looked at for whether they shrink."""
_SHRUNK = 0.7
"""Factor by which one of the last two changes must be smaller than those before to have shrunk."""


@dataclass
class Part:
    """What one group of beams, or the integration in time (no beams), adds to the error.

    Attributes
    ----------
    kinds : tuple of str
        Ways to refine it: ``degree``, ``elements``; ``tolerance``.
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
    def whose(self) -> str:
        """Whose mesh it is, in words to be added to a kind of move; empty for the error in time."""
        bodies = ", ".join(self.bodies) if len(self.bodies) <= _SINGLE else "all beams"
        return f" of {bodies}" if bodies else ""

    @property
    def of(self) -> str:
        """``mesh`` or ``time``."""
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


def parts_of(loaded: LoadedDeck) -> list[Part]:
    """Return the groups of beams to be refined: each by itself, or all together where there are many."""
    fixed = fixed_meshes(loaded)
    beams = {name: spec for name, spec in beams_of(loaded).items() if name not in fixed}
    groups = [(name,) for name in beams] if len(beams) <= _SINGLE else [tuple(beams)]
    cable = [all(beams[name].element == "cable" for name in group) for group in groups]
    kinds = [("degree", "elements") if one else ("elements",) for one in cable]
    return [Part(kind, group) for kind, group in zip(kinds, groups, strict=True)]
