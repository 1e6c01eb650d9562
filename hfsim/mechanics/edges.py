"""Where forces change their form: steps end there, for what lies beyond is not in what came before."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

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
        shares = LOOKED_AT
        for _ in range(ROUNDS + 1):
            look = partial(self._beyond, shares)
            beyond = self._look("edges", look, step) if shares is LOOKED_AT else look(type(step), *step)
            changed = np.any((beyond[1:] > 0.0) != (beyond[:-1] > 0.0), axis=1)
            if not changed.any():
                return step.h
            k = int(np.argmax(changed))
            shares = np.linspace(shares[k], shares[k + 1], len(shares))
        return step.h * float(shares[-1])

    def _beyond(self, shares: Array, kind: Callable[..., Step], t: Array, h: Array, *start: Array) -> Array:
        """Return by how much a step is beyond each edge, at shares of its length, (n_shares, n_edges)."""
        assert self._system is not None
        q, v = kind(t, h, *start).inside(shares)
        x, u = self._system.absolute(q), self._system.absolute_velocity(q, v)
        return np.concatenate([part.edges(t + h * shares, x, u) for part in self._parts], axis=1)
