"""The turns of angles along recorded steps, counted in the memory of the recording."""

from __future__ import annotations

from typing import Any

import numpy as np

from hfsim.integrators._iteration import Place
from hfsim.integrators._trajectory import Segment
from hfsim.maths.arrays import Array
from hfsim.maths.tape import Program, Tape
from hfsim.maths.traced import Refused, plain
from hfsim.mechanics.counting import Turns

LOOK, COUNT = "look", "count"
"""Programs, in the order in which they are recorded: look along a step, and go on to its end."""


class Counted:
    """The angles of a system along a step on a tape.

    Parameters
    ----------
    tape : Tape
    turns : Turns
    place : Place
        The step, on the tape.
    series : ndarray
        What is inside it.

    Attributes
    ----------
    outputs : tuple of ndarray
    memory : tuple of ndarray
        Where the step ends, q and v (n,), to be set, and how far angles leave what is known of them, ().
    programs : mapping of str to Program
        To be set when they are there.
    """

    programs: dict[str, Program]

    def __init__(self, tape: Tape, turns: Turns, place: Place, series: Array) -> None:
        t, q, v, h = place
        ends = tape.input(q), tape.input(v)
        seen = turns.looked(Segment, t, h, q, v, series, *ends)
        farthest = seen[:, :2].max()
        tape.cut()
        known = turns.known()
        for last, here in zip(known, seen[:, 2:], strict=True):
            last[...] = np.concatenate([np.reshape(t, 1), here])
        tape.cut()
        self.outputs = (seen, farthest)
        self.memory = (*map(plain, ends), plain(farthest))
        self._seen, self._known = plain(seen), list(map(plain, known))

    @classmethod
    def of(cls, tape: Tape, turns: Any, place: Place, series: Array) -> Counted | None:
        """Return the turns along a step if there are any, and they can be recorded."""
        if not turns:
            return None
        try:
            with tape.attempt():
                return cls(tape, turns, place, series)
        except Refused:
            return None

    def look(self, q: Array, v: Array) -> Array:
        """Return what `Turns.looked` does of the step of now, with this end."""
        self.memory[0][...], self.memory[1][...] = q, v
        self.programs[LOOK]()
        return self._seen.copy()

    def tell(self, turns: Turns) -> None:
        """Let the system know how far its angles have turned."""
        turns.reach(np.array(self._known))
