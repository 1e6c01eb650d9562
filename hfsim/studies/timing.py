"""How studies time: CPU time, in turns, median and extremes of the repeats."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hfsim.errors import INTERRUPTIONS
from hfsim.marching.integration import Integration, run_integration
from hfsim.marching.solution import Run
from hfsim.marching.stop import Budget, Progress
from hfsim.scene.build import Scene
from hfsim.scene.schema import SolveSpec


@dataclass(frozen=True)
class Spread:
    """CPU times: median and extremes of the repeats [s]."""

    median: float
    least: float
    most: float

    @classmethod
    def of(cls, times: Sequence[float]) -> Spread:
        """Return the spread of some times."""
        return cls(float(np.median(times)), min(times), max(times))

    @property
    def percent(self) -> str:
        """Half the distance of the extremes, relative to the median."""
        half = 50.0 * (self.most - self.least) / self.median if self.median else 0.0
        return f"+-{half:.0f} %"


def clocked(work: Callable[[], object], calls: int = 1) -> float:
    """Return the CPU time of one of some calls [s]."""
    start = time.process_time()
    for _ in range(calls):
        work()
    return (time.process_time() - start) / calls


def solved(scene: Scene, solve: SolveSpec, guard: Progress | None = None) -> tuple[Integration, float]:
    """Integrate a scene; return what came of it, however it ended, and the CPU time [s]."""
    start = time.process_time()
    done = run_integration(scene, solve, guard)
    return done, time.process_time() - start


def uninterrupted(run: Run) -> Run:
    """Return a run, or raise `KeyboardInterrupt` where a signal has ended it: what is timed must be whole."""
    if run.exit_code in INTERRUPTIONS:
        raise KeyboardInterrupt
    return run


def in_turns(
    tasks: Sequence[Callable[[], float]], repeats: int, budget: Budget | None = None
) -> list[list[float]]:
    """Return the times that tasks measure [s], a list for each task.

    They take turns, so that whatever else the machine does falls on all of them.  At least one round is
    made; no other one that would overdraw the budget.

    Examples
    --------
    >>> in_turns([lambda: 1.0, lambda: 2.0], repeats=3)
    [[1.0, 1.0, 1.0], [2.0, 2.0, 2.0]]
    """
    rounds: list[list[float]] = []
    while len(rounds) < repeats:
        start = budget.used if budget else 0.0
        rounds.append([task() for task in tasks])
        if budget and budget.left < budget.used - start:
            break
    return [list(times) for times in zip(*rounds, strict=True)]
