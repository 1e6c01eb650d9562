"""Energy balance and constraint drift along a trajectory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hfsim.arrays import Array
from hfsim.integrators import Trajectory
from hfsim.shapes import gauss_legendre
from hfsim.system import System

MAX_STATES = 4000
"""States looked at in one batch."""

INNER_POINTS = 16
"""Gauss points in a step at which power is looked at: as many as the longest steps have stages."""


@dataclass(frozen=True)
class StepSamples:
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
    put in since, over the largest of the energies' ranges.
    """
    energies, violations = [], []
    for part in _parts(len(steps.t)):
        t, q, v = steps.t[part], steps.q[part], steps.v[part]
        x, u = system.absolute(q), system.absolute_velocity(q, v)
        energies.append(
            np.stack([system.kinetic_energy(x, u), system.strain_energy(x), system.potential_energy(t, x)])
        )
        gap = system.residual(t, x)
        drift = system.drift(t, x, u)
        violations.append((np.abs(gap).max(initial=0.0), np.abs(drift).max(initial=0.0)))
    kinds = np.concatenate(energies, axis=1)
    total = kinds.sum(axis=0)
    work = _work(system, steps)
    scale = float(max(np.ptp(kinds, axis=1).max(), np.abs(kinds[:2]).max(), np.abs(work).max()))
    residual = float(np.abs(total - total[0] - work).max())
    return {
        "energy_drift": residual / scale if scale > 0.0 else 0.0,
        "energy_initial": float(total[0]),
        "energy_final": float(total[-1]),
        "work_done": float(work[-1]),
        "constraint_position": float(max(v[0] for v in violations)),
        "constraint_velocity": float(max(v[1] for v in violations)),
    }


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
