"""Energy balance and constraint drift along a trajectory."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from hfsim.integrators import Trajectory
from hfsim.marching.replaying import Replaying
from hfsim.marching.rounding import ROUNDING
from hfsim.maths.arrays import Array, random_signs, slices
from hfsim.maths.shapes import gauss_legendre
from hfsim.mechanics.projection import Projection
from hfsim.mechanics.system import System
from hfsim.scene.build import Scene

MAX_STATES = 500
"""States looked at in one batch: fewer take longer where joints are closed, more of them more memory."""
INNER_POINTS = 16
"""Gauss points in a step at which power is looked at, at least: as many as the steps have stages."""

LOOKED_INTO = 500
"""Steps, spread over the run, inside which the kinetic energy is looked at for its range."""
ROUND_OFF = 1e5
"""Energy, over what rounding the coordinates does to the energies, from which a motion is more than that."""
AT_REST = 1e4
"""Energy of a motion, over what changes of the coordinates by `ROUNDING` do to the energies, from which the
drift is a share of it alone."""
EXPLAINED = 10.0
"""Drift, over the same, that such changes explain."""

FAR = 1e6
"""Coordinates, over the largest at the start (or 1), beyond which their rounding is no excuse for a drift."""

OUTLYING = 1e3
"""Change by rounding, over that in half the time, from which a state is left out: energies jump there."""

ROUNDINGS, ROUNDED = 4, 64
"""Ways in which the coordinates are rounded up and down, at most, and states that this makes at least: few
may miss the largest change."""


class StepSamples(NamedTuple):
    """States at the ends of the steps, and inside each step where the power is integrated.

    Attributes
    ----------
    t : ndarray, shape (n_steps + 1,)
    q, v : ndarray, shape (n_steps + 1, n)
    shares, weights : ndarray, shape (n_points,)
        Gauss points within each step, 0 to 1, and their weights.
    """

    trajectory: Trajectory
    t: Array
    q: Array
    v: Array
    shares: Array
    weights: Array

    def inside(self, some: slice, shares: Array) -> tuple[Array, Array, Array]:
        """Return t, (n,), q and v, (n, n_coordinates), at shares of some steps, one step after another."""
        begin, end = self.t[:-1][some, None], self.t[1:][some, None]
        t = begin + (end - begin) * shares
        q, v = self.trajectory.inside(some, shares)
        return t.ravel(), q.reshape(t.size, -1), v.reshape(t.size, -1)


def step_samples(trajectory: Trajectory) -> StepSamples:
    """Collect the states at the ends of the steps."""
    segments = trajectory.segments
    shares, weights = gauss_legendre(max([INNER_POINTS, *(len(s.series) for s in segments)]))
    return StepSamples(
        trajectory=trajectory,
        t=trajectory.step_ends(),
        q=np.array([*(s.q for s in segments), trajectory.q]),
        v=np.array([*(s.v for s in segments), trajectory.v]),
        shares=shares,
        weights=weights,
    )


def balance(scene: Scene, steps: StepSamples) -> dict[str, Any]:
    """Return energy drift and constraint violations along a trajectory; see `Balance`."""
    found = Balance(scene)
    found.add(steps)
    return found.facts()


def energies_of(system: System, t: Array, x: Array, u: Array) -> Array:
    """Return kinetic, strain and potential energy [J], shape (3, n_batch)."""
    return np.stack([system.kinetic_energy(x, u), system.strain_energy(x), system.potential_energy(t, x)])


def rounding_of(
    system: System, t: Array, x: Array, energies: Array, share: float = np.finfo(float).eps
) -> Array:
    """Return by how much stored energies change at most when each coordinate does by a share of its size.

    Shape (n_batch,).

    Parameters
    ----------
    t : ndarray, shape (n_batch,)
    x : ndarray, shape (n_batch, n_x)
    energies : ndarray, shape (3, n_batch)
        Kinetic, strain and potential energy there [J].
    share : float
        Of the largest coordinate; without it that of the last digit.
    """
    largest, last_digit = np.zeros(len(x)), _last_digit(x, share)
    for signs in _ways(x):
        rounded = x + last_digit * signs
        stored = np.stack([system.strain_energy(rounded), system.potential_energy(t, rounded)])
        largest = np.maximum(largest, np.abs(stored - energies[1:]).max(axis=0))
    return largest


def _usual(roundings: Array, t: Array) -> float:
    """Return the largest of changes by rounding in states (n,), but for those where energies jump.

    Infinity is that of none; states at which there is none, which are no numbers, do not count.
    """
    step = np.diff(t)
    weights = np.append(step, 0.0) + np.append(0.0, step)
    known = np.isfinite(roundings)
    found, order = roundings[known], np.argsort(roundings[known])
    if not len(found):
        return np.inf
    passed = np.cumsum(weights[known][order])
    half = found[order[np.searchsorted(passed, 0.5 * passed[-1])]]
    return float(found[found <= OUTLYING * half].max())


def _last_digit(x: Array, share: float) -> Array:
    return np.asarray(share * np.maximum(np.abs(x), np.abs(x).max(axis=1, keepdims=True, initial=0.0)))


def _ways(x: Array) -> Array:
    """Return signs by which states (n_batch, n_x) are rounded up and down, of each way."""
    return random_signs((min(ROUNDINGS, 1 + ROUNDED // max(1, len(x))), *x.shape))


class Balance:
    """Energies and constraint violations at the ends of steps, added up stretch by stretch.

    The drift is the largest difference between the total energy and its initial value plus the work
    put in since, over the largest of the energies' ranges, those of the kinetic energy inside the steps
    included: steps may begin and end at rest.  Where nothing moves, what the energies change by and
    the work of loads are those of coordinates that are off by `ROUNDING`, which no tolerance is below: no
    drift up to `EXPLAINED` times that, and beyond it a share of at least `AT_REST` times that.  Where
    energies jump, as half a turn from where angles are zero, single states are off by more: no excuse.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._sums: Array = np.zeros(len(_Sum))
        self._sums[_Sum.INITIAL], self._sums[_Sum.ROUNDING] = np.nan, np.inf
        self._ranges = np.array([[np.inf] * 3, [-np.inf] * 3])
        """Least and most kinetic, strain and potential energy so far [J]."""

    def add(self, steps: StepSamples) -> None:
        """Take the next stretch, which begins where the last one ended."""
        with steps.trajectory.past.recalled():
            self._add(steps)

    def _add(self, steps: StepSamples) -> None:
        system, sums, roundings = self._scene.system, self._sums, np.full(len(steps.t), np.nan)
        work = sums[_Sum.WORK] + _work(self._scene, steps)
        for part in slices(len(steps.t), MAX_STATES):
            t, q, v = steps.t[part], steps.q[part], steps.v[part]
            x, u = _absolute(system, q, v)
            energies = energies_of(system, t, x, u)
            total = energies.sum(axis=0)
            sizes = np.abs(x).max(axis=1)
            if np.isnan(sums[_Sum.INITIAL]):
                sums[_Sum.INITIAL], sums[_Sum.SIZE] = total[0], max(1.0, sizes[0])
            near = sizes < FAR * sums[_Sum.SIZE]
            self._ranges[0] = np.minimum(self._ranges[0], energies.min(axis=1))
            self._ranges[1] = np.maximum(self._ranges[1], energies.max(axis=1))
            sums[_Sum.FINAL] = total[-1]
            self._raise(_Sum.RESIDUAL, np.abs(total - sums[_Sum.INITIAL] - work[part]).max())
            roundings[part][near] = rounding_of(system, t[near], x[near], energies[:, near], ROUNDING)
            self._raise(_Sum.POSITION, np.abs(system.residual(t, x)).max(initial=0.0))
            self._raise(_Sum.VELOCITY, np.abs(system.drift(t, x, u)).max(initial=0.0))
        self._raise(_Sum.MOST_WORK, np.abs(work).max())
        kinetic, rounding = _inside(system, steps, FAR * sums[_Sum.SIZE])
        self._raise(_Sum.INNER, kinetic)
        self._raise(_Sum.WORK_ROUNDING, rounding)
        # where nothing moves it is alike all the time; where energies jump, it is so for a while
        sums[_Sum.ROUNDING] = min(sums[_Sum.ROUNDING], _usual(roundings, steps.t))
        sums[_Sum.WORK] = work[-1]

    def _raise(self, name: _Sum, value: float) -> None:
        # what is not a number is out of all range
        self._sums[name] = np.inf if np.isnan(value) else max(self._sums[name], float(value))

    def facts(self) -> dict[str, Any]:
        """Return the drift, energies [J] and largest violations so far."""
        sums, (least, most) = self._sums, self._ranges
        sizes = np.maximum(np.abs(least), np.abs(most))[:2]
        ranges = (most - least).max(), sizes.max(), sums[_Sum.MOST_WORK]
        stored = sums[_Sum.ROUNDING] if np.isfinite(sums[_Sum.ROUNDING]) else 0.0
        rounding, residual = float(max(stored, sums[_Sum.WORK_ROUNDING])), float(sums[_Sum.RESIDUAL])
        scale, least_scale = float(max(*ranges, sums[_Sum.INNER])), AT_REST * rounding
        if scale < least_scale:
            residual, scale = max(0.0, residual - EXPLAINED * rounding), least_scale
        return {
            "energy_drift": _share(residual, scale),
            "energy_initial": float(sums[_Sum.INITIAL]),
            "energy_final": float(sums[_Sum.FINAL]),
            "work_done": float(sums[_Sum.WORK]),
            "constraint_position": float(sums[_Sum.POSITION]),
            "constraint_velocity": float(sums[_Sum.VELOCITY]),
        }

    def memory(self) -> dict[str, Array]:
        """Return what `recall` takes up again."""
        return {"sums": self._sums.copy(), "ranges": self._ranges.copy()}

    def recall(self, memory: Mapping[str, Array]) -> None:
        """Go on from a memory."""
        self._sums, self._ranges = memory["sums"].copy(), memory["ranges"].copy()


class _Sum(IntEnum):
    """What is added up or kept as the largest so far, by its place; the size is that of the first state."""

    INITIAL = 0
    FINAL = 1
    WORK = 2
    MOST_WORK = 3
    RESIDUAL = 4
    ROUNDING = 5
    INNER = 6
    POSITION = 7
    VELOCITY = 8
    SIZE = 9
    WORK_ROUNDING = 10


def _share(residual: float, scale: float) -> float:
    """Return a drift over the energies; numbers out of all range are a whole, not nothing."""
    if not (np.isfinite(residual) and np.isfinite(scale)):
        return 1.0
    return residual / scale if scale > 0.0 else 0.0


def _inside(system: System, steps: StepSamples, far: float) -> tuple[float, float]:
    """Return the largest kinetic energy in the middle of steps, and work of loads on rounded coordinates [J].

    Strain energies there would not do: in stiff scenes the interpolation stretches what a step does not.
    Coordinates beyond ``far`` are not looked at as rounded.
    """
    count = len(steps.t) - 1
    if not count:
        return 0.0, 0.0
    chosen = slice(None, None, 1 + count // LOOKED_INTO)
    t, q, v = steps.inside(chosen, steps.shares[:: len(steps.shares) // 4].copy())
    x, u = _absolute(system, q, v)
    near = np.abs(x).max(axis=1, initial=0.0) < far
    return float(system.kinetic_energy(x, u).max()), _work_on_rounding(system, t[near], x[near])


def _work_on_rounding(system: System, t: Array, x: Array) -> float:
    """Return the largest work of loads when each coordinate changes by `ROUNDING` [J]."""
    loads, change = [part for part in system.together if part.exchanges_power], _last_digit(x, ROUNDING)

    def power(rates: Array) -> Array:
        return np.asarray(sum(load.power(t, x, rates) for load in loads))

    at_rest = power(0.0 * x) if loads else 0.0
    found = [
        np.abs(power(change * signs) - at_rest).max(initial=0.0) for signs in (_ways(x) if loads else ())
    ]
    return float(max(found, default=0.0))


def _work(scene: Scene, steps: StepSamples) -> Array:
    """Return the work put in by loads, drivers and dampers up to each step end, shape (n_steps + 1,).

    It is not a number where the equations are singular.  Where joints are driven, rates inside steps
    are moved onto them: off by little they falsify the power by as much.  Positions stay where they are:
    moved, they would stretch what is stiff, and the drivers would seem to work on that.
    """
    system = scene.system
    lost = _lost(system, steps.t)
    if not system.exchanges_power:
        return -lost
    mean, points = np.zeros(len(steps.t) - 1), len(steps.shares)
    over = Replaying(scene.recordings, points, len(mean), system.n).over
    solve = partial(over, "reactions", system.equations.solve)
    steadied = partial(over, "rates on joints", Projection(system).steadied)
    for part in slices(len(mean), MAX_STATES // points):
        t, q, v = steps.inside(part, steps.shares)
        try:
            x, u = steadied(t, q, v) if system.driven else _absolute(system, q, v)
            power = system.power(t, x, u, solve)
        except np.linalg.LinAlgError:
            return np.full(len(steps.t), np.nan)
        mean[part] = power.reshape(-1, points) @ steps.weights
    return np.concatenate([[0.0], np.cumsum(mean * np.diff(steps.t))]) - lost


def _absolute(system: System, q: Array, v: Array) -> tuple[Array, Array]:
    return system.absolute(q), system.absolute_velocity(q, v)


def _lost(system: System, t: Array) -> Array:
    """Return the energy that events have taken since the first of some times [J]."""
    if not any(part.events for part in system.forces):
        return np.zeros(len(t))
    from hfsim.mechanics.once import lost

    gone = lost(system.forces, t)
    return np.asarray(gone - gone[0])
