"""What a run has cost and how well it kept energy and joints, over all its legs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hfsim.integrators import integrator
from hfsim.marching.integration import Leg

_SUMS = (
    *("steps", "rejected", "newton_iterations", "evaluations", "evaluation_calls", "factorisations"),
    *("native_steps", "work_done"),
)
_LARGEST = ("unknowns", "multipliers", "energy_drift", "constraint_position", "constraint_velocity")


def leg_statistics(leg: Leg) -> dict[str, Any]:
    """Return counts, sizes, models, energy balance and constraint drift of one leg."""
    counts, system = leg.done.problem.counts, leg.scene.system
    return {
        "steps": counts.steps,
        "rejected": counts.rejected,
        "newton_iterations": counts.iterations,
        "evaluations": counts.evaluations,
        "evaluation_calls": counts.calls,
        "factorisations": counts.factorisations,
        "native_steps": counts.native,
        "kernel": "native" if counts.native or leg.done.problem.often.replayed() else "numpy",
        "unknowns": system.n,
        "multipliers": system.n_rows,
        **_numbers(leg.done.trajectory.numbers),
        "models": leg.scene.models,
        "assembly": leg.scene.assembly.facts(),
        **_happened(leg),
        **leg.record.balance.facts(),
    }


def _happened(leg: Leg) -> dict[str, Any]:
    """Return when each latch caught and each spring let go [s], None if it has not, by what it is of."""
    forces, found = leg.scene.system.forces, dict[str, dict[str, float | None]]()
    if any(part.events for part in forces):
        from hfsim.mechanics.once import events_of

        with leg.done.trajectory.past.recalled():
            for event, ties in events_of(forces):
                t = float(event.since[0])
                found.setdefault(event.told, {})[event.item(ties)] = t if np.isfinite(t) else None
    return found


def joined(parts: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the statistics of a run: sums or the largest over its legs, the rest of the last."""
    facts = dict(parts[-1])
    facts |= {key: sum(part[key] for part in parts) for key in _SUMS}
    facts |= {key: max(part[key] for part in parts) for key in _LARGEST}
    facts["kernel"] = min(part["kernel"] for part in parts)
    warnings = list(dict.fromkeys(warning for part in parts for warning in part["warnings"]))
    for key in ("stages", "order"):
        every = {name: n for part in parts for name, n in (part[key] or {}).items()}
        facts[key] = every or None
    return facts | {"energy_initial": parts[0]["energy_initial"], "warnings": warnings}


def _numbers(most: Mapping[str, int]) -> dict[str, dict[str, int] | None]:
    """Return the stages and the orders of methods that have several."""
    orders = {name: n for name, n in most.items() if integrator(name).orders}
    return {"stages": {n: most[n] for n in most if n not in orders} or None, "order": orders or None}
