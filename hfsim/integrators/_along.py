"""What looks along recorded steps, in the memory of the recording: for turns of angles, and for edges."""

from __future__ import annotations

import numpy as np

from hfsim.integrators._iteration import Place
from hfsim.integrators._problem import Problem
from hfsim.integrators._trajectory import Segment
from hfsim.maths.arrays import Array
from hfsim.maths.tape import Program, Tape
from hfsim.maths.traced import plain
from hfsim.mechanics.counting import Turns

LOOK, COUNT = "look", "count"
"""Programs, in the order in which they are recorded: look along a step, and count turns up to its end."""
BEYOND = 1e3
"""What stands for an edge that is met, beside how far angles may turn [rad]."""


class Along:
    """The angles and edges of a system along a step on a tape.

    Parameters
    ----------
    tape : Tape
    problem : Problem
    place : Place
        The step, on the tape.
    series : ndarray
        What is inside it.

    Attributes
    ----------
    outputs : tuple of ndarray
    memory : tuple of ndarray
        Where the step ends, q and v (n,), to be set, and how far angles leave what is known of them, or
        `BEYOND`, shape ().
    programs : mapping of str to Program
        To be set when they are there.
    """

    programs: dict[str, Program]

    def __init__(self, tape: Tape, problem: Problem, place: Place, series: Array) -> None:
        t, q, v, _ = place
        ends = tape.input(q), tape.input(v)
        seen, farthest = looked(problem, place, series, *ends)
        tape.cut()
        known = problem.turns.known()
        for last, here in zip(known, seen[:, 2:], strict=True):
            last[...] = np.concatenate([np.reshape(t, 1), here])
        tape.cut()
        self.outputs = (seen, farthest)
        self.memory = (*map(plain, ends), plain(farthest))
        self._seen, self._known = plain(seen), list(map(plain, known))

    @classmethod
    def of(cls, tape: Tape, problem: Problem, place: Place, series: Array) -> Along | None:
        """Return what looks along a step if there is anything to see, and it can be recorded."""
        if not problem.turns and not problem.edges:
            return None
        return tape.if_recorded(cls, tape, problem, place, series)

    def look(self, q: Array, v: Array) -> Array:
        """Return what `Turns.looked` does of the step of now, with this end."""
        self.memory[0][...], self.memory[1][...] = q, v
        self.programs[LOOK]()
        return self._seen.copy()

    def tell(self, turns: Turns) -> None:
        """Let the system know how far its angles have turned."""
        turns.reach(np.array(self._known))


def looked(problem: Problem, place: Place, series: Array, *end: Array) -> tuple[Array, Array]:
    """Return what `Turns.looked` does of a step, and the largest number there is of what is not ordinary.

    Parameters
    ----------
    place : Place
        The step.
    series : ndarray
        What is inside it.
    end : ndarray, shape (n,)
        q and v at its end.
    """
    t, q, v, h = place
    turns, edges, step = problem.turns, problem.edges, (Segment, t, h, q, v, series)
    seen: Array = np.zeros((0, 4))
    farthest: Array = np.zeros(())
    if turns:
        seen = turns.looked(*step, *end)
        farthest = np.asarray(seen[:, :2].max())
    if edges:
        farthest = np.maximum(farthest, BEYOND * edges.met(*step))
    return seen, farthest
