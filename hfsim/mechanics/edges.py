"""Where forces change their form: steps end there, for what lies beyond is not in what came before."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.mechanics.counting import PLACES, AlongSteps, Step
from hfsim.mechanics.projection import Through, directly
from hfsim.mechanics.system import System

NEAR = 1e-3
"""Share of a step up to which an edge counts as its start."""
LOOKED_AT = np.concatenate([[NEAR], PLACES])
"""Shares of a step at which it is held against the edges."""
ROUNDS = 4
"""Times that the stretch with an edge is looked at more closely."""


class Edges(AlongSteps):
    """The edges of a system's forces."""

    def __init__(self, system: System | None = None, through: Through = directly) -> None:
        super().__init__(system, through)
        self._parts = () if system is None else tuple(part for part in system.forces if part.has_edges)

    def __bool__(self) -> bool:
        """Tell whether there are any."""
        return bool(self._parts)

    def first(self, step: Step) -> float:
        """Return after what time a tried step meets its first edge [s]; its length, if none is far inside."""
        if not self._parts:
            return step.h
        shares, beyond = LOOKED_AT, self._look("edges", self.looked, step)
        for closer in range(ROUNDS + 1):
            if closer:
                beyond = self._look("edges at shares", self._closely, step, shares)
            changed = np.any((beyond[1:] > 0.0) != (beyond[:-1] > 0.0), axis=1)
            if not changed.any():
                return step.h
            k = int(np.argmax(changed))
            shares = np.linspace(shares[k], shares[k + 1], len(shares))
        return step.h * float(shares[-1])

    def looked(self, kind: Callable[..., Step], t: Any, h: Any, *start: Array) -> Array:
        """Return by how much a step is beyond each edge where it is looked at first, (n_shares, n_edges)."""
        return self._beyond(t + h * LOOKED_AT, *kind(t, h, *start).inside(LOOKED_AT))

    def _closely(self, kind: Callable[..., Step], t: Array, h: Array, *given: Array) -> Array:
        """Return the same where it is looked at more closely, at shares that are given last."""
        *start, shares = given
        times = t + h * shares
        return self._beyond(times, *kind(t, h, *start).at(times))

    def _beyond(self, times: Array, q: Array, v: Array) -> Array:
        assert self._system is not None
        x, u = self._system.absolute(q), self._system.absolute_velocity(q, v)
        return np.concatenate([part.edges(times, x, u) for part in self._parts], axis=1)
