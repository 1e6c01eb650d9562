"""The equilibrium of a scene as a run of one row: its channels, shapes and facts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hfsim.marching.clock import PhaseClock
from hfsim.marching.sampling import SceneSamples, compute_channels, outlines_of
from hfsim.marching.solution import Run
from hfsim.maths.arrays import Array
from hfsim.mechanics.statics.equilibrium import Equilibrium
from hfsim.scene.build import Scene, build
from hfsim.scene.equilibrium import Turns, doubts, equilibrium_of, held_by_nothing, problem_of, why_not
from hfsim.scene.loading import LoadedDeck

METHOD = "static"
"""What stands in the place of a method of integration."""
NO_ERROR = "an equilibrium is no motion"
NO_MESH = "not measured: compare with more elements"


@dataclass(frozen=True, eq=False)
class StaticSamples(SceneSamples):
    """States at rest: joints that move by themselves count as if they stood."""

    @cached_property
    def solved(self) -> tuple[Array, Array]:
        """Accelerations, which are zero, and the multipliers of all joints, (n_times, n_rows)."""
        system = self.scene.system
        own, force = system.unreduced, system.force(self.t, self.x, self.u)
        still = np.zeros((len(self.t), own.n_rows))
        return np.zeros_like(self.x), own.constrained(self.x, own.reduction.free_force(force), still)[1]


def run_static(loaded: LoadedDeck, t: float = 0.0) -> Run:
    """Return where a scene comes to rest under what acts on it at a time [s], as a run of one row.

    Outlines are those of the start and of the equilibrium; where there is none, the row is what was reached
    on the way, with the share of the loads that was on.

    Raises
    ------
    DeckError
        If the scene cannot be assembled.
    """
    clock = PhaseClock()
    with clock.phase("build"):
        scene = build(loaded)
    with clock.phase("solve"):
        turns = Turns(scene)
        problem = problem_of(scene, t, turns)
        found = equilibrium_of(scene, problem)
        turns(found.share, found.state)
    angles = {name: np.array([angle]) for name, angle in turns.angles.items()}
    samples = StaticSamples(scene, np.array([t]), turns.q, np.zeros_like(turns.q), angles)
    with clock.phase("solve"):
        channels = compute_channels(samples)
    start = SceneSamples(scene, np.zeros(1), scene.q[None], np.zeros((1, scene.system.n)), {})
    seen = outlines_of([start, samples])
    failure = None if not found.reason else why_not(scene, t, found)
    return Run(
        name=scene.deck.name,
        model=scene.model,
        method=METHOD,
        t=samples.t,
        channels=channels,
        statistics={**facts_of(scene, samples, found), "cpu_s": clock.cpu, "wall_s": clock.wall},
        status="done" if failure is None else "failed",
        reason="" if failure is None else str(failure),
        failure=None if failure is None else failure.facts(scene.loaded.line_of),
        exit_code=0 if failure is None else failure.exit_code,
        outline_t=np.array([0.0, found.share]),
        outlines=seen.points,
        outline_forces=seen.forces,
        snapshots=tuple(samples.snapshots()) if failure is None else (),
        states=[samples],
    )


def facts_of(scene: Scene, samples: StaticSamples, found: Equilibrium) -> dict[str, Any]:
    """Return what summaries say of an equilibrium."""
    gaps = scene.system.residual(samples.t, samples.x)
    return {
        "kind": METHOD,
        "load": found.share,
        "stable": None if found.reason else found.stable,
        "smallest_eigenvalue": float(found.values[0]) if len(found.values) else None,
        "held_by_nothing": held_by_nothing(scene, found.neutral) if len(found.neutral) else [],
        "relaxed": found.relaxed,
        "limit": found.limit,
        "steps": found.effort.steps,
        "newton_iterations": found.effort.iterations,
        "unknowns": scene.system.n,
        "multipliers": scene.system.n_rows,
        "constraint_position": float(np.abs(gaps).max(initial=0.0)),
        "constraint_velocity": 0.0,
        "error_estimate_reason": NO_ERROR,
        "mesh_error_estimate_reason": NO_MESH,
        "models": scene.models,
        "assembly": scene.assembly.facts(),
        "warnings": [*scene.warnings, *doubts(scene, found)],
    }
