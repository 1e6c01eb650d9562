"""Watches for models and elements that run away: energy out of nothing, what is out of all proportion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TypeAlias

import numpy as np

from hfsim.errors import SolverFailure
from hfsim.integrators import Memory
from hfsim.marching.balance import ROUND_OFF, energies_of, rounding_of
from hfsim.maths.arrays import Array
from hfsim.maths.frozen import mutable
from hfsim.mechanics.projection import Through, directly
from hfsim.mechanics.system import System
from hfsim.parts.bodies.vector_beam import VectorBeam

Watch: TypeAlias = Callable[[float, Array, Array], None]
"""Is told every kept state; may raise to end the run."""

APART = 1e-6
"""Gap of redundant joint equations, relative to the largest coordinate (or 1), that ends a run."""
LIMIT = 100.0
"""Energy out of nothing, relative to all that was ever there, at which a model has broken down; large enough
for a mass matrix that turns singular to be seen first."""
ROUNDING = 1e-12
"""Share of the energies at the start below which energy out of nothing is round-off."""
FASTEST = 1e12
"""Rate or coordinate in SI units, over the largest at the start (or 1), from which a motion is none."""


@mutable
class EnergyWatch:
    """Ends a run whose energy grows without a source, as that of truncated models can.

    The work of loads, dampers and drivers is added up by the trapezoidal rule: coarse, but what is
    looked for is an order of magnitude.  At rest there is no energy to compare with, but that which rounding
    makes: of the coordinates, and of terms that cancel where there is no strain.
    """

    system: System
    through: Through = directly

    def __post_init__(self) -> None:
        self._truncated = [body for body in self.system.variable_mass if body.truncated]
        self.needed = bool(self._truncated)
        self._last: tuple[float, float] | None = None
        self._work = self._most = self._start = self._potential = 0.0

    def __call__(self, t: float, q: Array, v: Array) -> None:
        """Look at a kept state; fail if `LIMIT` times the energy that there should be has come of nothing."""
        system, time = self.system, np.array([t])
        x = system.absolute(q[None])
        u = system.absolute_velocity(q[None], v[None])
        energies = self.through("energies", partial(energies_of, system), (time, x, u))
        kinetic, strain, potential = map(float, energies[:, 0])
        moving = kinetic + strain
        power = float(system.power(time, x, u)[0]) if system.exchanges_power else 0.0
        if self._last is None:
            self._start, self._potential = moving + potential, potential
            rounding = ROUND_OFF * float(rounding_of(system, time, x, energies)[0]) / LIMIT
            self._most = max(ROUNDING * (moving + abs(potential)), rounding, _cancelled(system, x))
        else:
            self._work += 0.5 * (power + self._last[1]) * (t - self._last[0])
        self._last = (t, power)
        due = self._start + self._work - potential
        self._most = max(self._most, abs(due), abs(self._work), abs(potential - self._potential))
        if moving - due > LIMIT * self._most:
            raise system.breakdown(t, q) or self._failure(t, u, moving - due)

    def memory(self) -> Array:
        """Return what is known so far."""
        return np.array([*(self._last or ()), self._work, self._most, self._start, self._potential])

    def recall(self, memory: Array) -> None:
        """Go on from a memory."""
        *last, self._work, self._most, self._start, self._potential = map(float, memory)
        self._last = (last[0], last[1]) if last else None

    def _failure(self, t: float, u: Array, gained: float) -> SolverFailure:
        body = max(self._truncated, key=lambda one: float(np.abs(u[:, one.columns]).max()))
        return SolverFailure(
            reason=f"the inertia force of body '{body.name}' in model {body.model} feeds energy that "
            f"nothing supplies at t = {t:.4g} s, {gained:.3g} J where at most {self._most:.3g} J can be",
            cause="the terms the model leaves out are no longer small",
            time=t,
            item=f"bodies.{body.name}",
            kind="model",
            evidence={"energy_gained": gained, "energy_due": self._most},
        )


def _cancelled(system: System, x: Array) -> float:
    """Return the rounding of strain energies whose terms cancel [J], by what twice the length stores."""
    return float(np.finfo(float).eps * system.strain_energy(2.0 * x).max())


@mutable
class PartsWatch:
    """Ends a run in which a part has run away: what follows is neither mechanics nor worth the steps."""

    system: System

    def __post_init__(self) -> None:
        self._parts = [part for part in self.system.forces if part.runs_away]
        self.needed = bool(self._parts)

    def __call__(self, t: float, q: Array, v: Array) -> None:
        """Look at a kept state; fail if a part says so."""
        x = self.system.absolute(q[None])
        for part in self._parts:
            failure = part.runaway(t, x)
            if failure is not None:
                raise failure


@mutable
class RedundantWatch:
    """Ends a run in which joint equations that others make superfluous no longer hold.

    Then these others have come to depend on one another along the way, or joints agreed near the start only.
    """

    system: System

    def __call__(self, t: float, q: Array, v: Array) -> None:
        """Look at a kept state; fail by the joint that has come apart the most."""
        rows = self.system.redundant
        time, x = np.array([t]), self.system.absolute(q[None])
        gaps = [float(np.abs(row.residual(time, x)).max()) for row in rows]
        worst = int(np.argmax(gaps))
        if gaps[worst] > APART * max(1.0, float(np.abs(x).max())):
            joint, unit = rows[worst].item, rows[worst].unit
            raise SolverFailure(
                reason=f"{joint} comes apart by {gaps[worst]:.3g} {unit}: redundant equations are left out",
                time=t,
                item=joint,
                kind="deck",
                evidence={"gap": gaps[worst]},
                remedy="free a motion of a joint of that loop: spherical or cylindrical for revolute",
            )


@mutable
class RateWatch:
    """Ends a run whose steps feed the motion without end, before numbers overflow.

    Attributes
    ----------
    start : ndarray, shape (n,)
        Rates at the start.
    culprit : callable
        (t, q, v) -> the failure that names what is not finite in this state, or None.
    """

    start: Array
    culprit: Callable[[float, Array, Array], SolverFailure | None]

    def __post_init__(self) -> None:
        self._most = FASTEST * max(1.0, float(np.abs(self.start).max(initial=0.0)))

    def __call__(self, t: float, q: Array, v: Array) -> None:
        """Look at a kept state; fail if a rate is `FASTEST`, or not finite."""
        if v.dot(v) < self._most * self._most:  # a quick look
            return
        rate = float(np.abs(v).max())
        if not rate < self._most:
            raise self.culprit(t, q, v) or SolverFailure(
                reason=f"the motion grows beyond all scale at t = {t:.4g} s, up to rates of {rate:.2g}",
                cause="the steps feed it energy that nothing supplies",
                time=t,
                evidence={"largest_rate": rate},
                remedy="take shorter steps, a lower tolerance or method gauss",
            )


@mutable
class SectionsWatch:
    """Ends a run in which an element turns so far from node to node that its shapes mean nothing."""

    system: System
    bodies: Sequence[VectorBeam]

    def __call__(self, t: float, q: Array, v: Array) -> None:
        """Look at a kept state; fail by a body whose mesh cannot follow, see `VectorBeam.beyond_mesh`."""
        x = self.system.absolute(q[None])
        for body in self.bodies:
            if (lost := body.beyond_mesh(t, x)) is not None:
                raise lost


class Watches:
    """All that looks at the kept states of a run.

    Parameters
    ----------
    others : sequence of callable
        Called with every kept state like the watches against models that run away; may raise.
    through : callable
        What may replay functions that are called often.
    """

    def __init__(self, system: System, others: Sequence[Watch] = (), through: Through = directly) -> None:
        self._energy = EnergyWatch(system, through)
        redundant = (RedundantWatch(system),) if system.redundant else ()
        own = [watch for watch in (self._energy, PartsWatch(system)) if watch.needed]
        self._every: tuple[Watch, ...] = (*own, *redundant, *others)

    def __call__(self, t: float, q: Array, v: Array) -> None:
        """Look at a kept state."""
        for look in self._every:
            look(t, q, v)

    def memory(self) -> Memory:
        """Return what the watches know so far."""
        return {"energy": self._energy.memory()}

    def recall(self, memory: Memory) -> None:
        """Go on from a memory."""
        self._energy.recall(memory["energy"])
