"""Which method reaches an error in time soonest: methods raced on the scene itself, as cheaply as possible.

A race is an integration of the whole span, on a mesh on which one method, the mark, has been run and its
error in time measured.  It ends as soon as it has taken more CPU time than the best so far had taken up to
the same point of the motion, over a margin, so that what loses costs little.  A method that gets through
with too large an error is raced again at a tighter tolerance: methods are compared at equal error, not at
equal tolerance.  Times are noisy, hence the margin: what is about as good does not change the choice.

Nothing is printed or written here.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from hfsim.errors import DeckError, LimitReached, SolverFailure
from hfsim.integrators import METHODS, integrator
from hfsim.marching.integration import Integration
from hfsim.marching.stop import Halted, Progress
from hfsim.scene.build import Scene
from hfsim.studies.timing import solved

MARGIN = 1.5
"""Factor by which another method must be sooner to be taken."""
SURE = 3.0
"""Factor from which one measurement is enough; below it both are timed again, and the shorter times count."""
ONCE = 1.0
"""CPU time of the mark up to which they are in any case: imports and recordings may be most of it [s]."""
SLACK = 0.1
"""Part of the time allowed for a race by which it may be behind."""
TRIES = 4
"""Tolerances of one method in a contest."""
_ORDER = 0.7
"""Power of the tolerance that the error of a method is expected to follow, until it has been seen."""
_COST_ORDER = 0.2
"""Power of the tolerance that the time of a method is expected to grow with."""
_STRONGEST = 1e-4
"""Factor by which a tolerance is tightened at most."""
_TIGHTEST = 1e-13


def candidates(but: str) -> list[str]:
    """Return all methods but one, the likeliest first."""
    return [name for name in sorted(METHODS, key=lambda name: integrator(name).rank) if name != but]


@dataclass(frozen=True)
class Probe:
    """One race.

    Attributes
    ----------
    outcome : str
        ``reached`` the error asked for; ``inaccurate``; ``outrun`` (stopped: slower than the best so far over
        the margin), ``put off`` (the time for races was used up), ``failed``, ``refused`` (by the scene).
    against : str
        Method of the mark.
    cpu : float
        CPU time of the integration, as far as it came [s].
    to_beat : float
        CPU time of the mark [s].
    share : float
        Part of the duration that was done.
    error : float or None
        In time, the reference's own included, relative to the channel's range [-].
    """

    method: str
    tolerance: float
    outcome: str
    reason: str
    against: str
    unknowns: int
    cpu: float
    to_beat: float
    share: float
    error: float | None = None

    def facts(self) -> dict[str, Any]:
        """Return JSON-ready facts."""
        facts = asdict(self)
        head = {"method": self.method, "cpu_s": facts.pop("cpu"), "to_beat_s": facts.pop("to_beat")}
        return head | facts


@dataclass(frozen=True)
class Entry:
    """A method that went through the whole span.

    Attributes
    ----------
    cpu : float
        CPU time of the integration [s].
    error : float
        In time; of a method that was raced [-].
    to_beat : float
        CPU time of the mark it was raced against [s].
    """

    method: str
    tolerance: float
    scene: Scene
    done: Integration
    cpu: float
    error: float = math.nan
    to_beat: float = math.nan

    def pace(self, share: float) -> float:
        """Return the part of its time that it had taken when a share of the duration was done."""
        if self.scene.parts:
            return share
        ends = self.done.trajectory.step_ends()
        return float(np.interp(share * ends[-1], ends, np.linspace(0.0, 1.0, len(ends))))


@dataclass(frozen=True)
class Turn:
    """What a method that is not judged yet is to do next.

    Attributes
    ----------
    needs : float
        CPU time without which it need not begin [s].
    """

    tolerance: float
    needs: float = 0.0


class _LostError(Halted):
    """Ends a race that is lost, or that there is no time for."""

    def __init__(self, reason: str, share: float, outcome: str) -> None:
        super().__init__(reason, share)
        self.outcome = outcome


@dataclass
class Contest:
    """Races against one mark.

    Attributes
    ----------
    mark : Entry
        Method to beat.
    goal : float
        Error in time to be reached [-].
    scene_for : callable
        (method, tolerance) -> the same scene with another method.
    error_of : callable
        (scene, integration) -> error in time [-].
    allowance : callable
        Returns the CPU time that races may still take [s].
    guard : callable
        Told at every step; may raise to end everything.
    open : dict of str to Turn
        Methods that are not judged yet.
    probes : list of Probe
        Gets all races.
    """

    mark: Entry
    goal: float
    scene_for: Callable[[str, float], Scene]
    error_of: Callable[[Scene, Integration], float]
    allowance: Callable[[], float]
    guard: Progress
    open: dict[str, Turn]
    probes: list[Probe]

    def hold(self) -> Entry | None:
        """Race the open methods as far as the time allows; return the winner if it is not the mark.

        Raises
        ------
        HfsimError, KeyboardInterrupt
            What `guard` raises.
        """
        best: Entry | None = None
        for name in list(self.open):
            best = self._enter(name, best) or best
        return best

    # One method ---------------------------------------------------------------------------------------

    def _enter(self, name: str, best: Entry | None) -> Entry | None:
        """Race one method at ever tighter tolerances until it reaches the error; None: it is not sooner."""
        limit = self.mark.cpu / MARGIN if best is None else best.cpu
        seen: list[tuple[float, float]] = []
        while len(seen) < TRIES:
            turn = self.open[name]
            if self.allowance() < (turn.needs or 0.5 * limit):
                return None
            probe, entry = self._race(name, turn.tolerance, limit, best or self.mark)
            self.probes.append(probe)
            if probe.outcome == "put off":
                self.open[name] = replace(turn, needs=min(limit, 2.0 * probe.cpu))
                return None
            if entry is None:
                break
            if probe.outcome == "reached":
                both = self.mark.cpu + entry.cpu
                if self.mark.cpu < max(SURE * entry.cpu, ONCE):
                    if self.allowance() < both:
                        self.open[name] = replace(turn, needs=both + entry.cpu)
                        return None
                    entry = self._timed_again(entry)
                del self.open[name]
                return entry if self.mark.cpu >= MARGIN * entry.cpu else None
            seen.append((turn.tolerance, entry.error))
            tighter = _tighter(seen, self.goal)
            if not _TIGHTEST <= tighter < turn.tolerance:
                break
            expected = entry.cpu * (turn.tolerance / tighter) ** _COST_ORDER
            self.open[name] = Turn(tighter, min(limit, expected))
        del self.open[name]
        return None

    def _race(self, name: str, tolerance: float, limit: float, best: Entry) -> tuple[Probe, Entry | None]:
        mark = self.mark
        probe = Probe(name, tolerance, "refused", "", mark.method, mark.scene.system.n, 0.0, mark.cpu, 0.0)

        def ended(outcome: str, reason: str) -> tuple[Probe, None]:
            return replace(probe, outcome=outcome, reason=reason), None

        try:
            scene = self.scene_for(name, tolerance)
        except DeckError as refusal:
            return ended("refused", refusal.problems[0].message)
        solve = scene.deck.solve
        # tables are no part of the method's cost
        first = solved(scene, solve.model_copy(update={"max_steps": 1}))[0].in_time().stop
        if isinstance(first, SolverFailure):
            return ended("refused" if first.kind == "deck" else "failed", str(first))
        done, cpu = solved(scene, solve, self._watch(limit, best))
        probe, stop = replace(probe, cpu=cpu, share=done.trajectory.t_end / solve.duration), done.stop
        if isinstance(stop, _LostError):
            return ended(stop.outcome, stop.reason)
        if isinstance(stop, SolverFailure) or type(stop) is LimitReached:
            return ended("failed", str(stop))
        if stop is not None:
            raise stop
        error = self.error_of(scene, done)
        known, outcome = math.isfinite(error), "reached" if error <= self.goal else "inaccurate"
        probe = replace(probe, outcome=outcome, error=error if known else None)
        return probe, Entry(name, tolerance, scene, done, cpu, error, mark.cpu)

    def _watch(self, limit: float, best: Entry) -> Progress:
        """Return what ends a race that is lost, or when the time for races is used up."""
        allowed, start = self.allowance(), time.process_time()

        def check(share: float) -> None:
            self.guard(share)
            spent = time.process_time() - start
            if spent > limit * (SLACK + best.pace(share)):
                raise _LostError(f"behind {best.method}", share, "outrun")
            if spent > allowed:
                raise _LostError("the time for races is used up", share, "put off")

        return check

    def _timed_again(self, entry: Entry) -> Entry:
        """Time the mark and a method that seems sooner once more; the shorter times count."""
        times = []
        for one in (self.mark, entry):
            done, cpu = solved(one.scene, one.scene.deck.solve, self.guard)
            if done.stop is not None:
                raise done.stop
            times.append(min(one.cpu, cpu))
        mark, mine = times
        self.mark = replace(self.mark, cpu=mark)
        ratio = f"timed again, {mark / mine:.2g} times sooner"
        self.probes[-1] = replace(self.probes[-1], cpu=mine, to_beat=mark, reason=ratio)
        return replace(entry, cpu=mine, to_beat=mark)


def _tighter(seen: Sequence[tuple[float, float]], goal: float) -> float:
    """Return the tolerance at which a method should reach an error, from tolerances and errors so far."""
    (tolerance, error), power = seen[-1], _ORDER
    if not math.isfinite(error):
        return tolerance * 0.01
    if len(seen) > 1 and error > 0.0:
        t0, e0 = seen[-2]
        power = min(max(math.log(e0 / error) / math.log(t0 / tolerance), 0.3), 1.0)
    factor = 0.5 * (goal / error) ** (1.0 / power)
    return float(f"{tolerance * max(factor, _STRONGEST):.1e}")
