"""Moving states onto the constraints, at position and velocity level, in the metric of the mass."""

from __future__ import annotations

from collections.abc import Callable
from types import MethodType
from typing import Any, Protocol
from weakref import ref

import numpy as np

from hfsim.maths.arrays import Array, magnitude
from hfsim.maths.frozen import frozen
from hfsim.mechanics.equations import Equations

CLOSED = 1e-9
"""Violation of joints, relative to the largest coordinate (or 1), that may be left."""
ROUNDING = 1e-13
"""Violation, relative to the largest coordinate or rate (or 1), at which there is nothing to move.

It is also the largest product of two for which what solved for one correction serves for the other.
"""
MOST = 8
"""Corrections of the positions."""

SEEN, CLOSER, STEADIER = "constraints", "projected positions", "projected rates"
"""Names of the functions of a `Projection`, in the order in which they may be called."""

Solve = Callable[[Array, Array], tuple[Array, Array]]
"""Solves the equations in some states for forces and for what the joints ask for."""
Through = Callable[[str, Callable[..., Any], tuple[Any, ...]], Any]
"""Calls a function of arrays, which has a name, and returns what it returns."""


def directly(name: str, function: Callable[..., Any], given: tuple[Any, ...]) -> Any:
    """Call a function."""
    return function(*given)


class Weakly:
    """Calls functions through a method that does so, directly where its object is gone.

    What an object holds, and is called through it, would else hold the object until Python looks for
    circles of references: it sees how many objects there are and not how much memory they hold.
    """

    def __init__(self, method: Through) -> None:
        assert isinstance(method, MethodType)
        # no WeakMethod: an interruption in what that does when the object goes would be lost
        self._owner, self._method = ref(method.__self__), method.__func__

    def __call__(self, name: str, function: Callable[..., Any], given: tuple[Any, ...]) -> Any:
        """Call a function."""
        owner = self._owner()
        return function(*given) if owner is None else self._method(owner, name, function, given)

    def __reduce__(self) -> tuple[Any, ...]:
        owner = self._owner()
        return (_direct, ()) if owner is None else (Weakly, (MethodType(self._method, owner),))


def _direct() -> Through:
    return directly


class Constrained(Protocol):
    """What is needed of a `System`."""

    @property
    def equations(self) -> Equations:
        """Its mass and constraints."""

    def frames(self, q: Array) -> list[Any]:
        """Return what the maps below have in common."""

    def absolute(self, q: Array, frames: list[Any]) -> Array:
        """Return the absolute coordinates of states."""

    def absolute_velocity(self, q: Array, v: Array, frames: list[Any]) -> Array:
        """Return their rates."""

    def state(self, x: Array, u: Array, near: Array) -> tuple[Array, Array]:
        """Return (q, v) of absolute coordinates and rates."""


@frozen
class Projection:
    """Moves states of a system onto its constraints.

    Attributes
    ----------
    through : callable
        What its functions are called through, by their names, for several states with the number of these.
    """

    system: Constrained
    through: Through = directly

    def __call__(self, t: Array, q: Array, v: Array, strict: bool = True) -> tuple[Array, Array]:
        """Return the states (n_batch, n) moved there, themselves if they are there; see `System.project`."""
        try:
            return self._moved(t, q, v, strict)
        except np.linalg.LinAlgError:
            if strict:
                raise
            return q, v

    def _moved(self, t: Array, q: Array, v: Array, strict: bool) -> tuple[Array, Array]:
        many, corrections = "" if len(q) == 1 else f" of {len(q)} states", 0
        x, u, gap, miss, drift, slip = self.through(SEEN + many, self.seen, (t, q, v))
        solve, before = None, np.inf
        while not float(miss) <= ROUNDING and corrections < MOST:
            corrections += 1
            if self.through is directly and not before * float(miss) <= ROUNDING:
                solve, before = self.system.equations.constrained_at(x), float(miss)
            given = (t, x, u, gap, *((solve,) if solve else ()))
            x, gap, miss, drift, slip = self.through(CLOSER + many, self.closer, given)
        if strict and corrections == MOST and not magnitude(gap) <= CLOSED * max(1.0, magnitude(x)):
            raise np.linalg.LinAlgError("the joints cannot be closed")
        if float(slip) > ROUNDING:
            given = (q, x, u, drift, *((solve,) if solve and before * float(slip) <= ROUNDING else ()))
            found: tuple[Array, Array] = self.through(STEADIER + many, self.steadier, given)
            return found
        return self.system.state(x, u, q) if corrections else (q, v)

    def seen(self, t: Array, q: Array, v: Array) -> tuple[Array, ...]:
        """Return absolute coordinates and rates, and what `_gap` and `_drift` do."""
        frames = self.system.frames(q)
        x = self.system.absolute(q, frames)
        u = self.system.absolute_velocity(q, v, frames)
        return x, u, *self._gap(t, x), *self._drift(t, x, u)

    def closer(
        self, t: Array, x: Array, u: Array, gap: Array, solve: Solve | None = None
    ) -> tuple[Array, ...]:
        """Return coordinates with a gap corrected, and what `_gap` and `_drift` do."""
        x = x - self._correction(x, gap, solve)
        return x, *self._gap(t, x), *self._drift(t, x, u)

    def steadier(
        self, q: Array, x: Array, u: Array, drift: Array, solve: Solve | None = None
    ) -> tuple[Array, Array]:
        """Return the state of absolute coordinates near q and of rates with a drift corrected."""
        return self.system.state(x, u - self._correction(x, drift, solve), q)

    def steadied(self, t: Array, q: Array, v: Array) -> tuple[Array, Array]:
        """Return absolute coordinates as they are, and rates moved onto the joints there."""
        x, u, _, _, drift, _ = self.seen(t, q, v)
        return x, u - self._correction(x, drift, None)

    def _gap(self, t: Array, x: Array) -> tuple[Array, Array]:
        """Return Phi, and the largest over the size of what its row compares."""
        phi = self.system.equations.phi
        gap = phi.residual(t, x)
        scales = phi.scales(np.maximum(1.0, np.abs(x).max(initial=0.0)))
        return gap, (np.abs(gap) / scales).max(initial=0.0)

    def _drift(self, t: Array, x: Array, u: Array) -> tuple[Array, Array]:
        """Return Phi', and the largest over the largest rate."""
        drift = self.system.equations.phi.drift(t, x, u)
        return drift, np.abs(drift).max(initial=0.0) / np.maximum(1.0, np.abs(u).max(initial=0.0))

    def _correction(self, x: Array, gap: Array, solve: Solve | None) -> Array:
        """Return the smallest move, measured by the mass matrix, that changes Phi by ``gap``.

        Without what solves the equations near x they are solved there.
        """
        equations, nothing = self.system.equations, np.zeros((len(x), self.system.equations.n))
        moves = (solve(nothing, gap) if solve else equations.constrained(x, nothing, gap))[0]
        return equations.reduction.expand_rates(moves)
