"""How joints get from where a scene starts to where their laws have led them by then."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.system import System

FINE = 1001
"""Times at which laws are looked at ..."""
QUICK = 0.4
"""... and what they may turn joints by between two of them, so that they can be followed [rad]."""
MANY = 20.0 * np.pi
"""Turn up to which they are [rad]."""


@frozen
class Way:
    """Joints on their way to a time.

    Attributes
    ----------
    driven : tuple of Constraint
        Equations that follow laws.
    t : ndarray, shape (1,)
        [s]
    at_once : bool
        Whether they all have to be at their ends from the start.
    """

    driven: tuple[Constraint, ...]
    t: Array
    at_once: bool

    @classmethod
    def of(cls, system: System, t: Array) -> Way:
        """Return that of the joints of a system; redundant equations are of the end alone."""
        driven = tuple(c for c in system.equations.phi.constraints if c.driven)
        return cls(driven, t, any(c.driven for c in system.redundant))

    @cached_property
    def followed(self) -> bool:
        """Whether joints go along their laws, with all full turns; else they go to their ends.

        They do not where that are many turns, or laws too fast to be followed.
        """
        if self.at_once or not self.t[0]:
            return not self.at_once
        times = np.linspace(0.0, self.t[0], FINE)
        turns = [np.diff(c.target(times)) for c in self._turning]
        return all(np.abs(one).max() <= QUICK and abs(one.sum()) <= MANY for one in turns)

    @property
    def moves(self) -> bool:
        """Whether laws move any joint on the way."""
        ends = np.concatenate([self.time(1.0), self.t])
        return any(np.diff(c.target(ends)).any() for c in self.driven)

    @cached_property
    def _turning(self) -> list[Constraint]:
        """Those by which joints are turned, without counting turns."""
        return [c for c in self.driven if c.wraps]

    def time(self, rest: float) -> Array:
        """Return the time of the joints where a share of the way is left, (1,) [s]."""
        return (1.0 - rest) * self.t if self.followed else self.t

    def turned(self, begin: float, end: float) -> float:
        """Return by how much joints turn at most between two such shares [rad], full turns among it."""
        if not self._turning:
            return 0.0
        times = np.concatenate([self.time(begin), self.time(end)])
        return max(float(abs(np.diff(c.target(times))[0])) for c in self._turning)
