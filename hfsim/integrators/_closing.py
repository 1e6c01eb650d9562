"""The ends of recorded steps moved onto the constraints, in the memory of the recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hfsim.integrators._iteration import End
from hfsim.maths.arrays import Array
from hfsim.maths.tape import Program, Tape
from hfsim.maths.traced import plain
from hfsim.mechanics.projection import CLOSER, SEEN, STEADIER, Projection, Weakly

FUNCTIONS = (SEEN, CLOSER, STEADIER)
"""Programs, in the order in which they are recorded."""
NOTHING = np.zeros(0)
"""Given for times: they are in the recording."""


class Closing:
    """The functions of a projection on a tape, of what steps lead to.

    Parameters
    ----------
    tape : Tape
    project : Projection
    t : ndarray, shape (1,)
        When steps end, on the tape.
    end : End
        On the tape.

    Attributes
    ----------
    outputs : tuple of ndarray
    memory : tuple of ndarray
        By how much positions and rates fail, and the state (1, n) with both corrected.
    programs : mapping of str to Program
        To be set when they are there.
    """

    programs: dict[str, Program]

    def __init__(self, tape: Tape, project: Projection, t: Array, end: End) -> None:
        q, v = end.q[None], end.v[None]
        seen = [one.copy() for one in project.seen(t, q, v)]
        tape.cut()
        x, u, gap, _, drift, _ = seen
        closer = (x, gap, *seen[3:])
        for memory, value in zip(closer, project.closer(t, x, u, gap), strict=True):
            memory[...] = value
        tape.cut()
        steadier = [one.copy() for one in project.steadier(q, x, u, drift)]
        tape.cut()
        self.outputs = (*seen, *steadier)
        found = (list(map(plain, one)) for one in (seen, closer, steadier))
        self._found = dict(zip(FUNCTIONS, found, strict=True))
        self.memory = (*self._found[SEEN][3::2], *self._found[STEADIER])
        self._q, self._v = plain(q), plain(v)
        self._project = Projection(project.system, Weakly(self._called))

    @classmethod
    def of(cls, tape: Tape, project: Any, t: Array, end: End) -> Closing | None:
        """Return the functions of a projection if it is one, and they can be recorded."""
        if not isinstance(project, Projection):
            return None
        return tape.if_recorded(cls, tape, project, t, end)

    def __call__(self) -> tuple[Array, Array]:
        """Return the end of a step (n,) moved there, when `SEEN` was run: until the next step."""
        q, v = self._project(NOTHING, self._q, self._v)
        return q[0], v[0]

    def tried(self, q: Array, v: Array) -> list[Array]:
        """Do as the function below does."""
        self._q[...], self._v[...] = q, v
        self.programs[SEEN]()
        return tried(self._project, NOTHING, q, v)

    def _called(self, name: str, function: Callable[..., Any], given: tuple[Any, ...]) -> Sequence[Array]:
        if name != SEEN:
            self.programs[name]()
        return self._found[name]


def tried(project: Projection, t: Array, q: Array, v: Array) -> list[Array]:
    """Return what all functions of a projection return, each called with what those before it have found."""
    call, q, v = project.through, q[None], v[None]
    x, u, gap, *_ = seen = list(map(np.array, call(SEEN, project.seen, (t, q, v))))
    x, _, _, drift, _ = closer = list(map(np.array, call(CLOSER, project.closer, (t, x, u, gap))))
    return [*seen, *closer, *map(np.array, call(STEADIER, project.steadier, (q, x, u, drift)))]
