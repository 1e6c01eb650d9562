"""Steps that follow a vibration nobody asked for: which one it is, and what would save them."""

from __future__ import annotations

from typing import Any

import numpy as np

from hfsim.marching.culprit import body_of
from hfsim.marching.distance import channel_errors, farthest, group_of
from hfsim.marching.integration import Integration, run_integration
from hfsim.marching.record import Record
from hfsim.marching.stop import Budget
from hfsim.maths.eigenvectors import eigenvectors
from hfsim.mechanics.modes import Modes
from hfsim.scene.build import Scene
from hfsim.trust.estimate import Compared

LOOSER = 100.0
"""Factor on the tolerance that is tried."""
LOOSEST = 1e-4
SAVES = 3.0
"""Factor on the steps that is worth a word."""
UNASKED = 1e-3
"""Change of a position, angle or deflection, relative to its range, that nobody asked to be resolved."""
LOOKED_AT = 8
"""Steps at the end of a run in which the vibration is looked for."""
LARGEST = 400
"""Unknowns up to which all modes are computed."""


def ringing(run: Compared, budget: Budget) -> dict[str, Any] | None:
    """Return what a looser tolerance saves and hardly changes, and the vibration that asks for the steps.

    Returns
    -------
    dict or None
        ``tolerance``, ``fewer_steps`` (a factor), ``change`` of ``channel`` relative to its range;
        ``frequency`` [Hz] and ``item`` of the vibration, not known in large scenes.
        None where nothing is to be saved, or no time was left to find out.
    """
    leg = run.legs[-1]
    scene, done = leg.scene, leg.done
    solve, steps = scene.deck.solve, done.problem.counts.steps
    if len(run.legs) > 1 or solve.step is not None or solve.tolerance >= LOOSEST:
        return None
    looser, record = float(f"{min(LOOSER * solve.tolerance, LOOSEST):.2g}"), Record(balanced=False)
    again = run_integration(
        scene,
        solve.model_copy(update={"tolerance": looser, "max_steps": steps}),
        budget.guard(0.5 * budget.left),
        (leg.begin, scene.q, scene.v),
        record=record,
    )
    if isinstance(again.stop, KeyboardInterrupt):
        raise again.stop
    if again.stop is not None:
        return None
    fewer = steps / max(again.problem.counts.steps, 1)
    changes = channel_errors(run.channels, record.channels())[1]
    motion = [one.name for one in run.channels if group_of(one.unit) == "motion"]
    channel, change = farthest({name: changes[name] for name in motion if name in changes} or changes)
    if fewer < SAVES or change is None or change > UNASKED:
        return None
    with done.trajectory.past.recalled():
        vibration = _vibration(scene, done)
    found = {"tolerance": looser, "fewer_steps": fewer, "change": change, "channel": channel}
    return None if vibration is None else found | vibration


def _vibration(scene: Scene, done: Integration) -> dict[str, Any] | None:
    """Return frequency and body of the mode that most limits the steps, by the ends of their series.

    None where nothing is free to vibrate.
    """
    steps, unknown = done.trajectory.segments[-LOOKED_AT:], {"frequency": None, "item": ""}
    if scene.system.n > LARGEST:
        return unknown
    modes = Modes.of(done.problem.near(steps[-1].t, steps[-1].q, steps[-1].v))
    if not modes.stiffness.size:
        return None
    w2, shapes = eigenvectors(-modes.stiffness)
    frequency, moved = np.sqrt(np.maximum(w2.real, 0.0)), modes.basis @ shapes.real
    size = np.abs(moved).max(axis=0)

    ends = np.concatenate([step.series[-2:] for step in steps])
    parts = np.abs(np.linalg.solve(shapes, (ends @ modes.basis).T)) * size[:, None]
    k = int(np.argmax(parts.max(axis=1)))
    if not frequency[k]:
        return unknown
    item = body_of(scene, np.abs(moved[:, k]))
    return {"frequency": float(frequency[k]) / (2.0 * np.pi), "item": item}
