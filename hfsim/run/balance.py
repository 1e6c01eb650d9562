"""Energy balance and constraint drift along a trajectory."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hfsim.integrators import Trajectory
from hfsim.maths.arrays import Array, random_signs
from hfsim.maths.shapes import gauss_legendre
from hfsim.mechanics.system import System

MAX_STATES = 4000
"""States looked at in one batch."""

INNER_POINTS = 16
"""Gauss points in a step at which power is looked at: as many as the longest steps have stages."""

LOOKED_INTO = 500
"""Steps, spread over the run, inside which the kinetic energy is looked at for its range."""
ROUND_OFF = 1e5
"""Energy, over what rounding the coordinates does to the energies, from which a drift can be told."""

ROUNDINGS = 4
"""Ways in which the coordinates are rounded up and down: few states alone may miss the largest change."""


class StepSamples(NamedTuple):
    """States at the ends of the steps, and inside each step where the power is integrated.

    Attributes
    ----------
    t : ndarray, shape (n_steps + 1,)
    q, v : ndarray, shape (n_steps + 1, n)
    inner : ndarray, shape (n_steps, INNER_POINTS)
        Gauss points of each step; ``weights`` [s] of the same shape.
    """

    trajectory: Trajectory
    t: Array
    q: Array
    v: Array
    inner: Array
    weights: Array


def step_samples(trajectory: Trajectory) -> StepSamples:
    """Collect the states at the ends of the steps."""
    places, weights = gauss_legendre(INNER_POINTS)
    segments = trajectory.segments
    t = trajectory.step_ends()
    h = np.diff(t)[:, None]
    return StepSamples(
        trajectory=trajectory,
        t=t,
        q=np.array([*(s.q for s in segments), trajectory.q]),
        v=np.array([*(s.v for s in segments), trajectory.v]),
        inner=t[:-1, None] + h * places,
        weights=h * weights,
    )


def balance(system: System, steps: StepSamples) -> dict[str, Any]:
    """Return the energy drift and the largest constraint violations at the ends of the steps.

    The drift is the largest difference between the total energy and its initial value plus the work
    put in since, over the largest of the energies' ranges, those of the kinetic energy inside the steps
    included: steps may begin and end at rest.  Where nothing moves the energies are round-off, and so is
    their drift: the range is taken to be at least `ROUND_OFF` times that.
    """
    energies, violations, rounding = [], [], 0.0
    for part in _parts(len(steps.t)):
        t, q, v = steps.t[part], steps.q[part], steps.v[part]
        x, u = system.absolute(q), system.absolute_velocity(q, v)
        energies.append(_energies(system, t, x, u))
        rounding = max(rounding, _rounding(system, t, x, energies[-1]))
        gap = system.residual(t, x)
        drift = system.drift(t, x, u)
        violations.append((np.abs(gap).max(initial=0.0), np.abs(drift).max(initial=0.0)))
    kinds = np.concatenate(energies, axis=1)
    total = kinds.sum(axis=0)
    work = _work(system, steps)
    ranges = np.ptp(kinds, axis=1).max(), np.abs(kinds[:2]).max(), np.abs(work).max()
    scale = float(max(*ranges, _inner_kinetic(system, steps), ROUND_OFF * rounding))
    residual = float(np.abs(total - total[0] - work).max())
    return {
        "energy_drift": residual / scale if scale > 0.0 else 0.0,
        "energy_initial": float(total[0]),
        "energy_final": float(total[-1]),
        "work_done": float(work[-1]),
        "constraint_position": float(max(v[0] for v in violations)),
        "constraint_velocity": float(max(v[1] for v in violations)),
    }


def _energies(system: System, t: Array, x: Array, u: Array) -> Array:
    """Return kinetic, strain and potential energy [J], shape (3, n_batch)."""
    return np.stack([system.kinetic_energy(x, u), system.strain_energy(x), system.potential_energy(t, x)])


def _rounding(system: System, t: Array, x: Array, energies: Array) -> float:
    """Return by how much stored energies change at most when the last digit of each coordinate does."""
    last_digit = np.finfo(float).eps * np.maximum(np.abs(x), np.abs(x).max(axis=1, keepdims=True))
    largest = 0.0
    for signs in random_signs((ROUNDINGS, *x.shape)):
        rounded = x + last_digit * signs
        stored = np.stack([system.strain_energy(rounded), system.potential_energy(t, rounded)])
        largest = max(largest, float(np.abs(stored - energies[1:]).max(initial=0.0)))
    return largest


def _inner_kinetic(system: System, steps: StepSamples) -> float:
    """Return the largest kinetic energy in the middle of steps [J].

    Strain energies there would not do: in stiff scenes the interpolation stretches what a step does not.
    """
    if not len(steps.inner):
        return 0.0
    chosen = slice(None, None, 1 + len(steps.inner) // LOOKED_INTO)
    middle = steps.inner[chosen, :: INNER_POINTS // 4].ravel()
    q, v = steps.trajectory.at(middle)
    x, u = system.absolute(q), system.absolute_velocity(q, v)
    return float(system.kinetic_energy(x, u).max())


def _parts(count: int) -> list[slice]:
    return [slice(i, min(i + MAX_STATES, count)) for i in range(0, count, MAX_STATES)]


def _work(system: System, steps: StepSamples) -> Array:
    """Return the work put in by loads, drivers and dampers up to each step end, shape (n_steps + 1,)."""
    if not system.exchanges_power:
        return np.zeros(len(steps.t))
    powers = []
    for part in _parts(len(steps.inner)):
        times = steps.inner[part].ravel()
        q, v = steps.trajectory.at(times)
        q, v = system.project(times, q, v)
        x, u = system.absolute(q), system.absolute_velocity(q, v)
        powers.append(system.power(times, x, u).reshape(-1, INNER_POINTS))
    gained = np.sum(np.concatenate(powers) * steps.weights, axis=1) if powers else np.zeros(0)
    return np.concatenate([[0.0], np.cumsum(gained)])
