"""The error of an integration, measured by a second, tighter one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hfsim.integrators import Trajectory
from hfsim.run.distance import channel_errors
from hfsim.run.integration import Leg, run_integration
from hfsim.run.record import Record
from hfsim.run.solution import Channel
from hfsim.scene.build import Scene


def measured_error(legs: Sequence[Leg], channels: tuple[Channel, ...]) -> dict[str, Any]:
    """Integrate again, tighter and with Gauss collocation, and return the largest differences.

    Models change where they did in the run: how good they are is not judged here.
    """
    solve = legs[0].scene.deck.solve
    tighter = max(min(solve.tolerance, 1e-6) * 1e-2, 1e-13)
    update = {"method": "gauss", "tolerance": tighter, "step": None, "stages": None, "max_steps": None}
    again = Record()
    before: tuple[Scene, Trajectory] | None = None
    for leg in legs:
        end, scene = leg.done.trajectory.t_end, leg.scene
        if before is not None:
            from hfsim.trust.handover import hand_over

            scene = hand_over(before[0], scene, before[1])[0]
        tighter_solve = solve.model_copy(update=update | {"duration": end})
        tight = run_integration(
            scene, tighter_solve, start=(leg.begin, scene.q, scene.v), record=again
        ).trajectory
        if tight.t_end < end:
            break
        before = scene, tight
    absolute, relative = channel_errors(channels, again.channels())
    return {
        "error_estimate": max(relative.values(), default=0.0),
        "error_by_channel": absolute,
        "error_estimate_by": f"difference to a second run, gauss at tolerance {tighter:g}",
    }
