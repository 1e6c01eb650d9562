"""Where forces change their form: steps end there, for what lies beyond is not in what came before."""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.mechanics.counting import PLACES, Step
from hfsim.mechanics.system import System

NEAR = 1e-3
"""Share of a step up to which an edge counts as its start."""
ROUNDS = 4
"""Times that the stretch with an edge is looked at more closely."""


class Edges:
    """The edges of a system's forces; without a system there are none."""

    def __init__(self, system: System | None = None) -> None:
        self._system = system
        self._parts = () if system is None else tuple(part for part in system.forces if part.has_edges)

    def first(self, step: Step) -> float:
        """Return after what time a tried step meets its first edge [s]; its length, if none is far inside."""
        if self._system is None or not self._parts:
            return step.h
        shares = np.concatenate([[NEAR], PLACES])
        for _ in range(ROUNDS + 1):
            sides = self._sides(self._system, step, shares)
            changed = np.any(sides[1:] != sides[:-1], axis=1)
            if not changed.any():
                return step.h
            k = int(np.argmax(changed))
            shares = np.linspace(shares[k], shares[k + 1], len(shares))
        return step.h * float(shares[-1])

    def _sides(self, system: System, step: Step, shares: Array) -> Array:
        """Return on which side of each edge a step is, at shares of its length."""
        times = step.t + step.h * shares
        q, v = step.inside(shares)
        x, u = system.absolute(q), system.absolute_velocity(q, v)
        return np.concatenate([part.edges(times, x, u) > 0.0 for part in self._parts], axis=1)
