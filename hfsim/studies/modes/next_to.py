"""States next to one, in few numbers, and what they are a period later.

Numbers are those of displacements along the slowest motions that are there, of unit mass, and those of their
rates, over the rates of motions.  Faster motions follow these.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np

from hfsim.maths.arrays import Array, are_finite
from hfsim.maths.squares import squares_of
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.projection import Projection
from hfsim.mechanics.small_motions import SmallMotions
from hfsim.mechanics.system import System
from hfsim.mechanics.ties import Tie
from hfsim.scene.build import Scene
from hfsim.scene.gauging import lengths_of
from hfsim.studies.modes.state import About, ModesError, linearised, run_until

OFTEN = 50.0
"""Swings in a period of a motion that is as fast as those which follow: runs would have to resolve it."""
_APART = 3e-4
"""How far a state is moved: lengths over the size of the scene, or a metre in larger ones, in which short
things may move; angles, slopes and directions over one."""
_WOUND = 1e-3
"""Part of the force of a spring or servo from which it is other after a period, as motions nearly close."""
_SEEN = 8
"""Times in a period at which it is asked whether what is small stays so."""
_GROWN, _LEAST = 30.0, 1e-9
"""How much more of others a number may make before it is moved by less, and by how much less at most."""
_FADED = 0.05
"""Part of the largest number after a period below which nothing need follow it."""


@dataclass(frozen=True, eq=False)
class NextTo:
    """States next to one of a scene.

    Attributes
    ----------
    about : About
        The state, with its period.
    q, v : ndarray, shape (n,)
        Its coordinates and rates.
    most : int
        Motions along which it is moved.
    following : ndarray, shape (2, n_z, 2 r), or None
        Changes of free coordinates and their rates that faster motions add to those of each number.
    """

    about: About
    q: Array
    v: Array
    most: int
    following: Array | None = None

    @classmethod
    def of(cls, scene: Scene, q: Array, v: Array, t: float, period: float, most: int) -> NextTo:
        """Return those next to a state at a time [s].

        Raises
        ------
        ModesError
            If its equations are singular there.
        """
        state = linearised(scene, q, v, "periodic", t, turns=False)
        return cls(replace(state, period=period), q, v, most)

    @property
    def system(self) -> System:
        """The equations."""
        return self.about.scene.system

    @property
    def period(self) -> float:
        """[s]."""
        assert self.about.period is not None
        return self.about.period

    @property
    def motions(self) -> SmallMotions:
        """What is linear at the state."""
        return self.about.motions

    @cached_property
    def _slowest(self) -> tuple[Array, Array]:
        """Frequencies without velocities (r,) [rad/s], and their motions (n_z, r), of unit mass."""
        pencil = self.motions.pencil
        own = 0.5 * (pencil.stiffness + pencil.stiffness.T)
        resting = replace(pencil, velocity=0.0 * pencil.velocity, stiffness=own)
        squares, motions, _, _ = squares_of(resting, self.most)
        order = np.argsort(np.abs(squares), kind="stable")[: self.most]
        rates = np.sqrt(np.abs(squares[order]))
        slow = max(1, int(np.sum(rates * self.period <= 2.0 * np.pi * OFTEN)))
        kept = motions.real[:, order[:slow]]
        root = np.linalg.cholesky(kept.T @ (pencil.mass @ kept))
        return rates[:slow], np.linalg.solve(root, kept.T).T

    @property
    def number(self) -> int:
        """Of motions, r."""
        return len(self._slowest[0])

    @property
    def all(self) -> bool:
        """Whether these are all that there are."""
        return self.number == self.motions.pencil.free

    @cached_property
    def _rates(self) -> Array:
        """What rates of motions are measured by (r,) [1/s]."""
        return np.maximum(self._slowest[0], 1.0 / self.period)

    @cached_property
    def displacements(self) -> Array:
        """Changes of the absolute coordinates along each motion, (n_x, r)."""
        return np.asarray(self.motions.basis @ self._slowest[1])

    @cached_property
    def _changes(self) -> Array:
        """Changes of the free coordinates and of their rates by each number, (2, n_z, 2 r)."""
        motions, nothing = self._slowest[1], np.zeros_like(self._slowest[1])
        return np.stack([np.hstack([motions, nothing]), np.hstack([nothing, motions * self._rates])])

    @cached_property
    def steps(self) -> Array:
        """How far states are moved by each number, (2 r,): fast motions less, so that all are as quick."""
        units = np.where(lengths_of(self.about.scene), min(self.about.size, 1.0), 1.0)
        largest = (np.abs(self.displacements).T / units).max(axis=1) * self._rates * self.period
        return np.tile(_APART / largest, 2)

    @cached_property
    def _read(self) -> Array:
        """The matrix (r, n_z) that reads displacements along motions off changes."""
        return np.asarray((self.motions.pencil.mass @ self._slowest[1]).T)

    def numbers(self, change: Array) -> Array:
        """Return the numbers (2 r, ...) of changes of free coordinates and rates (2, n_z, ...)."""
        return np.concatenate([self._read @ change[0], ((self._read @ change[1]).T / self._rates).T])

    def moved(self, by: Array, first: Array | None = None) -> tuple[Array, Array]:
        """Return the state (q, v) that is moved by numbers (2 r,); what turns keeps its length.

        Parameters
        ----------
        first : ndarray, shape (2, n_z), optional
            Changes that it is moved by before.
        """
        system, natural = self.system, cast(Any, self.system.natural)
        x, u = self.motions.x[None], self.motions.u[None]
        z, w = system.reduction.free(x), system.reduction.free_rates(u)
        if first is not None:
            z, w = z + first[0], w + first[1]
        changes = self._changes if self.following is None else self._changes + self.following
        dz, dw = (changes @ by)[:, None]
        if natural is not None and not system.charts:
            natural = natural.from_state(z[0])
            at = natural.geometry(z)
            dz = natural.advance(at, natural.to_natural(at, dz))
        x, u = system.reduction.expand(z + dz), system.reduction.expand_rates(w + dw)
        t = np.array([self.about.t])
        q, v = system.project(t, *system.state(x, u, self.q[None]))
        if system.equations.constraints:  # in small scenes what a move does to these may pass for rounding
            q, v = system.state(*Projection(system).steadied(t, q, v), q)
        return q[0], v[0]

    def _path(self, q: Array, v: Array) -> Array:
        """Return where a state leads within a period and after it, coordinates and rates (k, 2, n_x)."""
        system, t = self.system, self.about.t
        trajectory = run_until(self.about.scene, t + self.period, start=(t, q, v))
        times = t + self.period * np.linspace(0.0, 1.0, _SEEN + 1)[1:]
        q, v = trajectory.at(times)
        q[-1], v[-1] = trajectory.q, trajectory.v  # known to more digits than is read
        q, v = system.project(times, q, v)
        return np.stack([system.absolute(q), system.absolute_velocity(q, v)], axis=1)

    def _absolute(self, q: Array, v: Array) -> Array:
        """Return coordinates and their rates (2, n_x) of a state."""
        own = q[None], v[None]
        return np.concatenate([self.system.absolute(own[0]), self.system.absolute_velocity(*own)])

    def _between(self, end: Array, begin: Array) -> Array:
        """Return changes of free coordinates and rates (..., 2, n_z), full turns left out."""
        change, bodies = end - begin, self.about.scene.bodies.values()
        angles = [body.angle_column for body in bodies if body.angle_column is not None]
        change[..., 0, angles] -= 2.0 * np.pi * np.round(change[..., 0, angles] / (2.0 * np.pi))
        free = self.system.reduction.free_rates(change.reshape(-1, change.shape[-1]))
        return free.reshape(*change.shape[:-1], -1)

    @cached_property
    def _after(self) -> Array:
        """Where the state leads, (2, n_x)."""
        return np.asarray(self._path(self.q, self.v)[-1])

    @cached_property
    def _led(self) -> Array:
        """What a period changes, of free coordinates and rates (2, n_z)."""
        return self._between(self._after, np.stack([self.motions.x, self.motions.u]))

    def changed(self, times: Array) -> float:
        """Return what acts a period after some times, less what acts at these, over its size."""
        x, u = (np.repeat(one[None], len(times), axis=0) for one in (self.motions.x, self.motions.u))
        loads = self._forces([one for one in self.system.forces if not isinstance(one, Tie)])
        rate, later = self.system.equations.phi.rate, times + self.period
        pushed = _change(loads.force(times, x, u), loads.force(later, x, u), self._force)
        return max(pushed, _change(rate(times), rate(later), 0.0), self._wound())

    def _wound(self) -> float:
        """Return by how much what follows angles is other where the motion has come to, from `_WOUND` on."""
        t, x, u = np.array([self.about.t]), self.motions.x[None], self.motions.u[None]
        ties = [self._forces([one]) for one in self.system.forces if isinstance(one, Tie)]
        ends = ((one.force(t, x, u), one.force(t + self.period, *self._after[:, None])) for one in ties)
        most = max((_change(*pair, 1e-3 * self._force) for pair in ends), default=0.0)
        return most if most > _WOUND else 0.0

    def _forces(self, parts: list[ForcePart]) -> System:
        """Return the system with some of its forces."""
        return replace(self.system, forces=tuple(parts))

    @cached_property
    def _force(self) -> float:
        """What forces are measured by [N]: the largest, or what moves everything by its size in a period."""
        t, x, u = np.array([self.about.t]), self.motions.x[None], self.motions.u[None]
        largest = float(np.abs(self.system.force(t, x, u)).max(initial=0.0))
        return max(largest, self.about.mass * self.about.size / self.period**2)

    @cached_property
    def gap(self) -> tuple[Array, float]:
        """What a period changes: in numbers (2 r,), and, with faster displacements, over the size."""
        by = self.numbers(self._led)
        rest = self.motions.basis @ (self._led - self._changes @ by)[0]
        size = np.linalg.norm(by) / np.sqrt(self.about.mass) + self.about.mean(rest)
        return by, float(size) / self.about.size

    def at(self, step: Array, settled: bool) -> NextTo:
        """Return those next to the state that is moved by numbers (2 r,).

        Parameters
        ----------
        settled : bool
            Whether fast motions go on from where they have come to in a period.

        Raises
        ------
        numpy.linalg.LinAlgError
            If that is too far for the scene.
        """
        with np.errstate(all="ignore"):
            q, v = self.moved(step, self._settling if settled else None)
        if not are_finite(q, v):
            raise np.linalg.LinAlgError("too far")
        return self.of(self.about.scene, q, v, self.about.t, self.period, self.most)

    @cached_property
    def _settling(self) -> Array:
        """What a period changes of fast motions (2, n_z): all but moving the state by the gap."""
        return self._between(self._after, self._absolute(*self.moved(self.gap[0])))

    def _becomes(self, by: Array) -> Array:
        """Return what comes of moving by small numbers (2 r,) within a period and after it, (k, 2, n_z)."""
        ends = [self._path(*self.moved(one)) for one in (by, -by)]
        return 0.5 * self._between(*ends)

    def become(self, vector: Array, share: float = 1.0) -> Array:
        """Return what becomes of numbers (2 r,) in a period, (2, n_z), by small ones: a share of `steps`.

        Raises
        ------
        ModesError
            If none are so small that they stay so.
        """
        size = share * float((self.steps / np.maximum(np.abs(vector), 1e-300)).min())
        least = _LEAST * size
        while size > least:
            found = self._becomes(size * vector)
            grown = max(float((np.abs(self.numbers(one)) / self.steps).max()) for one in found)
            if grown <= _GROWN:
                return np.asarray(found[-1] / size)
            size /= grown if grown < np.inf else _GROWN
        raise ModesError(
            f"what is small grows by more than {1.0 / _LEAST:.0g} in a period of {self.period:.6g} s from "
            f"{self.about.t:.6g} s on: too much to be followed"
        )

    def followed(self, becoming: Array) -> NextTo:
        """Return the same with fast motions as they follow each number, by what becomes of these."""
        monodromy = self.numbers(becoming)
        rest = becoming - self._changes @ monodromy
        return replace(self, following=rest @ np.linalg.pinv(monodromy, rcond=_FADED))


def _change(before: Array, later: Array, size: float) -> float:
    """Return the largest change, over the largest value of both or a size, if there is any."""
    largest = max(size, *(float(np.abs(one).max(initial=0.0)) for one in (before, later)))
    return float(np.abs(later - before).max(initial=0.0)) / largest if largest else 0.0
