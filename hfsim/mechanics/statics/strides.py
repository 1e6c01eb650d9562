"""How far a relaxation goes in a step, and when it has gone so far that nothing will hold it any more.

Steps are as long as what moves most would move as a body that turns a little: a compact one on a long way, as
a ball at the end of an arm, would creep.  So steps get longer as long as forces change on them as foretold,
but never so that anything turns by more than a little, or shifts by more than a part of the scene and of the
way so far.  A way without an end is told by that: of what shifts ever on, by its length over the scene, which
takes few such steps, and of what turns ever on, by that the work of some turns gets no less.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.mechanics.statics.problem import Problem, Solver, State

MOVE = 0.2
"""Largest change of a state in a step [rad]."""
FAR = 1e5
"""Way after which nothing will hold it any more, over the size of the scene."""
TURNS = 6.0 * np.pi
"""Turn between two looks at what has been done on it [rad]: whole turns, over which weight does nothing."""
LESS = 0.025
"""Part by which work must get less from one to the next: then the turns end after forty of them."""
FEW, MANY = 3, 40
"""Looks before which nothing is said, and after which it is in any case."""
DRAWN = 10.0
"""Length of a direction, after so long a way, beyond which a beam is where its model means nothing."""
FITS, MISSES = 0.25, 1.0
"""What forces after a step, beside those foretold, change of it, up to which they get longer or are done."""
COMPACT = 0.4
"""Turn or shift in a scene, over the change of what moves most, below which steps can be much longer."""


@dataclass(eq=False)
class Strides:
    """Steps on the way to rest.

    Attributes
    ----------
    problem : Problem
    longest : float
        Change of a state in a step on which no turn or shift is large, up to which it is tried [rad].
    tries : int
        Steps that were tried since it was looked whether the way has an end.
    """

    problem: Problem
    longest: float = field(default=MOVE, init=False)
    tries: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        self._far, self._turned, self._work, self._before, self._looks = 0.0, np.zeros(1), 0.0, np.inf, 0

    def size(self, dz: Array) -> float:
        """Return how large changes (1, n) are: `MOVE` is the most that a step may have."""
        moved = self.problem.moved(dz)
        return min(moved, max(moved * MOVE / self.longest, self._in_scene(dz)))

    def _in_scene(self, dz: Array) -> float:
        """Return the largest turn in changes (1, n), or shift over the scene and the way so far."""
        dx, gauge = self.problem.expand_rates(dz), self.problem.gauge
        return max(_most(gauge.turns(dx)), gauge.far(dx) / max(1.0, self._far))

    def doubtful(self, dz: Array) -> bool:
        """Return whether it counts how well a step (1, n) foretells forces, as it or the next is long."""
        moved = self.problem.moved(dz)
        return moved > MOVE or (moved > 0.5 * self.longest and self._in_scene(dz) < COMPACT * moved)

    def suits(self, dz: Array, solved: Solver, force: Array, gap: Array) -> bool:
        """Return whether a doubtful step (1, n) is to be done, and learn from it how long the next may be.

        ``solved`` is what the step was found by; forces (1, n) and gaps (1, n_rows) are those after it beside
        those that were foretold.
        """
        moved = self.problem.moved(dz)
        try:
            missed = self.problem.moved(solved(force, gap)[0])
        except np.linalg.LinAlgError:
            missed = np.inf
        suits = moved <= MOVE or missed < MISSES * moved
        if not suits:
            self.longest = max(MOVE, 0.25 * moved)
        elif not missed < FITS * moved:
            self.longest = max(MOVE, 0.5 * self.longest)
        elif moved > 0.5 * self.longest:
            self.longest *= 2.0
        return suits

    def endless(self, state: State, dz: Array, work: float) -> bool:
        """Go on to a state by changes (1, n), with the work on them; return whether the way has no end."""
        dx = self.problem.expand_rates(dz)
        self._far += self.problem.gauge.far(dx)
        self._turned = self._turned + self.problem.gauge.turns(dx)
        self._work += work
        if self._far > FAR or self._drawn(state):
            return True
        if _most(self._turned) < TURNS:
            return False
        done, self._before = self._before, self._work
        self._turned, self._work, self._looks, self.tries = np.zeros(1), 0.0, self._looks + 1, 0
        lasts = self._before > (1.0 - LESS) * done
        return self._looks == MANY or (lasts and self._looks >= FEW)

    def _drawn(self, state: State) -> bool:
        """Return whether what has turned far is no turn: it has a length that no direction has."""
        if not self._looks and _most(self._turned) < DRAWN:
            return False
        return self.problem.gauge.drawn(self.problem.expand(state.z)) > DRAWN


def _most(turns: Array) -> float:
    return float(turns.max(initial=0.0))
