"""What a user should know before trusting the curves of a run."""

from __future__ import annotations

from typing import Any

import numpy as np

from hfsim.integrators import Trajectory
from hfsim.marching.balance import step_samples
from hfsim.marching.integration import Leg
from hfsim.marching.sampling import SceneSamples
from hfsim.parts.bodies.models import MODELS

LARGE_DRIFT = 1e-3
"""Energy drift from which a run warns."""


def doubts(leg: Leg, drift: float) -> dict[str, Any]:
    """Return ``validity``, where models of beams stand, and ``warnings`` for one leg."""
    found = validity(leg.record.samples, leg.done.trajectory)
    warnings = [*leg.scene.warnings, *_drift_warnings(leg, drift)]
    if found:
        from hfsim.trust.validity import validity_warnings

        warnings += validity_warnings(leg.scene.models, found)
    return {"validity": found, "warnings": warnings}


def validity(samples: SceneSamples, trajectory: Trajectory) -> dict[str, Any]:
    """Return what `watch_validity` finds at the output times and at the ends of the steps."""
    if not any(MODELS[model].truncated for model in samples.scene.models.values()):
        return {}
    from hfsim.trust.validity import watch_validity

    steps = step_samples(trajectory)
    times, first = np.unique(np.concatenate([samples.t, steps.t]), return_index=True)
    q, v = (np.concatenate(pair)[first] for pair in ((samples.q, steps.q), (samples.v, steps.v)))
    with trajectory.past.recalled():
        return watch_validity(samples.scene, times, q, v)


def _drift_warnings(leg: Leg, drift: float) -> list[str]:
    scene, done = leg.scene, leg.done
    if drift < LARGE_DRIFT or done.stop is not None:
        return []
    truncated = [body.name for body in scene.system.variable_mass if body.truncated]
    if truncated:
        why = f"lowOrder leaves out inertia terms of {', '.join(truncated)}; compare with exact"
    else:
        stepped = scene.deck.solve.step is not None
        remedy = "shorten the step" if stepped else "lower the tolerance"
        other = "" if "gauss" in done.method.split(", ") else " or take gauss"
        why = f"method {done.method} does not resolve the motion; {remedy}{other}"
    return [f"the energy balance is off by {drift:.2g} of the energies that change: {why}"]
