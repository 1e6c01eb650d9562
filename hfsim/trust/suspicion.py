"""Why a run that reached its end is not to be trusted: doubts, each tested by a short experiment."""

from __future__ import annotations

from typing import Any

import numpy as np

from hfsim.errors import SolverFailure
from hfsim.integrators import Trajectory
from hfsim.marching.integration import Integration
from hfsim.marching.stop import Budget
from hfsim.maths.arrays import Array
from hfsim.maths.rank import Dependence
from hfsim.scene.build import Scene
from hfsim.trust.diagnosis import linearised
from hfsim.trust.experiments import (
    DEAD,
    GOOD_BALANCE,
    Experiments,
    Update,
    command,
    command_exact,
    joint_dependence,
    listed,
)
from hfsim.trust.growth import UNSTABLE, WINDOWS, Growth, amplitude_of, disturbed_growth, loaded_items

LOOKED_AT, NEAREST = (60, 300), 4
"""Times at which singular positions are looked for, and how many of the nearest are looked at closely."""
SMALL, RESTS_AT, LEAVES_AT = 100, 60, 4
"""Coordinates up to which it is looked whether what rests would rather go away, times at which it is looked
what rests, and those of them at which whether it would."""
TIGHT = 1e-10
"""Tolerance that is proposed where nothing else is known to help."""
REDUNDANT = 1e-6
"""Smallest singular value of the joint equations below which joints are all but redundant."""

RESTING, APART = 1e-6, 1e-3
"""Change of a coordinate, over the largest of them, up to which it rests, as rounding grows too; and what a
motion of resting ones may have of others, as its derivatives are those of differences."""


def suspect(
    scene: Scene, done: Integration, statistics: dict[str, Any], budget: Budget
) -> dict[str, Any] | None:
    """Return class, item, evidence and next command of a run that reached its end but is not to be trusted.

    None where nothing speaks against it.

    Parameters
    ----------
    statistics : dict
        With ``energy_drift`` and ``validity``.
    budget : Budget
        What experiments may take; `time_for` suits a run.

    Raises
    ------
    KeyboardInterrupt
        If that ended an experiment.
    """
    trial = Experiments(scene, done, budget)
    with np.errstate(all="ignore"):
        found = (
            _suspicious_balance(trial, statistics["energy_drift"])
            or _left_range(trial, statistics["validity"])
            or _nearly_redundant(trial)
            or _unstable(trial)
        )
    if found is None:
        return None
    return {"reason": found.reason, **found.facts(scene.loaded.line_of)}


def _suspicious_balance(trial: Experiments, drift: float) -> SolverFailure | None:
    """Energy out of nothing: numerical if it goes away with smaller steps, else of the model."""
    if drift < GOOD_BALANCE:
        return None
    scene, solve = trial.scene, trial.solve

    def failure(reason: str, item: str, kind: str, remedy: str, **more: str) -> SolverFailure:
        evidence = {"energy_drift": drift, **trial.outcomes, **more}
        return SolverFailure(
            f"the energy balance is off{reason}", trial.stop_time, item, kind, evidence, remedy
        )

    gauss: tuple[str, Update] = ("method gauss", {"method": "gauss", "step": None, "stages": None})
    for what, update in (next(trial.other_settings()), gauss):
        if trial.passes(what, update, scene):
            item = "solve.step" if solve.step is not None else f"solve.{next(iter(update))}"
            remedy = trial.command(update, force=True)
            return failure(", and is kept with smaller steps", item, "numerical", remedy)
    beams = [body for body in scene.system.variable_mass if body.truncated]
    if beams and trial.passes_exact():
        reason = f" whatever the steps, and is kept by exact: {beams[0].model} breaks it"
        remedy = command_exact(trial.scene, beams[0].name, force=True)
        item = f"bodies.{beams[0].name}"
        return failure(reason, item, "model", remedy, term="inertia forces of third order")
    if (passed := singular_position(scene, trial.done.trajectory)) is not None:
        return _led_over(trial, drift, *passed)
    remedy = "a finer mesh, or a look at what the motion does there: no tolerance is known to keep it"
    if solve.step is None and solve.tolerance > TIGHT and not scene.loaded.has_target:
        remedy = command(scene.loaded, {"solve.tolerance": TIGHT}, force=True)
    return failure(", and no experiment kept it in the time allowed", "solve", "numerical", remedy)


def singular_position(scene: Scene, path: Trajectory) -> tuple[float, Dependence] | None:
    """Return when joint equations lost their rank on the way, and which; None if they did not."""
    if not scene.system.n_rows:
        return None
    least, most = LOOKED_AT
    times = np.linspace(0.0, path.t_end, min(max(least, len(path.step_ends())), most))

    def size(t: float) -> float:
        return joint_dependence(scene, path.at(np.array([t]))[0][0]).size

    sizes = np.array([size(t) for t in times])
    bound = DEAD * sizes[0]
    inner = np.flatnonzero((sizes[1:-1] <= sizes[:-2]) & (sizes[1:-1] <= sizes[2:])) + 1
    for k in inner[np.argsort(sizes[inner])][:NEAREST]:
        from scipy.optimize import minimize_scalar

        found = minimize_scalar(size, bounds=(times[k - 1], times[k + 1]), method="bounded")
        if found.fun <= bound:
            return float(found.x), joint_dependence(scene, path.at(np.array([found.x]))[0][0])
    return None


def _led_over(trial: Experiments, drift: float, t: float, found: Dependence) -> SolverFailure:
    """Return that a step may have led out of a singular position on another way than the motion's."""
    names = listed(found.joints)
    reason = f"the energy balance is off: at t = {t:.4g} s the equations of joints {names} lose their rank, "
    reason += "and a step may go on from there on another way, such as with crossed loops"
    evidence = {"energy_drift": drift, "smallest_singular_value": found.size}
    until = command(trial.scene.loaded, {"solve.duration": float(f"{0.98 * t:.3g}")}, force=True)
    remedy = f"keep it away from there, for smaller steps need not help; until then: {until}"
    return SolverFailure(reason, t, f"joints.{found.joints[-1]}", "physical", evidence, remedy)


def _left_range(trial: Experiments, validity: dict[str, Any]) -> SolverFailure | None:
    """The body whose model left its range first."""
    left = {name: facts for name, facts in validity.items() if facts["left_at"] is not None}
    if not left:
        return None
    name = min(left, key=lambda one: float(left[one]["left_at"]))
    reason = f"body '{name}' left the range of {trial.scene.models[name]}: {left[name]['reason']}"
    evidence = dict(left[name]["largest"])
    remedy = command_exact(trial.scene, name, force=True)
    return SolverFailure(reason, left[name]["left_at"], f"bodies.{name}", "model", evidence, remedy)


def _nearly_redundant(trial: Experiments) -> SolverFailure | None:
    """Joints that all but block the same motion twice."""
    found = joint_dependence(trial.scene, trial.scene.q)
    if found.size > REDUNDANT:
        return None
    names = listed(found.joints)
    reason = f"joints {names} all but block the same motion twice: their reactions mean nothing"
    evidence = {"smallest_singular_value": found.size}
    item = f"joints.{found.joints[-1]}"
    return SolverFailure(reason, 0.0, item, "deck", evidence, f"remove {item} or free one of its motions")


def _unstable(trial: Experiments) -> SolverFailure | None:
    """A motion under load, or one that leaves something at rest, from which disturbances grow away."""
    scene = trial.scene
    if trial.budget.left <= 0.0 or not (loaded_items(scene) or _rests_unstably(trial)):
        return None
    growth = disturbed_growth(scene, trial.done, trial.solve, trial.budget.guard())
    return instability(scene, growth) if growth is not None and growth.unstable else None


def _rests_unstably(trial: Experiments) -> bool:
    """Tell whether what rests for a while would rather go away, such as a column under its weight."""
    path, n = trial.done.trajectory, trial.scene.system.n
    if n > SMALL or path.t_start > 0.0 or path.condensed:
        return False
    times = np.linspace(0.0, path.t_end / WINDOWS, RESTS_AT)
    q, v = path.at(times)
    resting = np.ptp(q, axis=0) <= RESTING * np.abs(q).max(initial=1.0)
    if not resting.any():
        return False

    def may_grow(t: float, q: Array, v: Array) -> bool:
        values, vectors = linearised(trial.done.problem, t, q, v)
        moved = np.abs(vectors[:n])
        apart = moved[~resting].max(axis=0, initial=0.0) <= APART * moved.max(axis=0)
        return bool((values.real[apart] * path.t_end > 2.0 * np.log(UNSTABLE)).any())

    some = np.linspace(0, RESTS_AT - 1, LEAVES_AT).astype(int)
    return any(map(may_grow, times[some], q[some], v[some]))


def instability(scene: Scene, growth: Growth) -> SolverFailure:
    """Return class, item and evidence of a scene from whose motion disturbances grow away."""
    items = loaded_items(scene)
    amplitude = amplitude_of(scene, items[0]) if items else None
    cause = "parametric resonance" if amplitude else "buckling or another instability"
    reason = f"a disturbance of the start grows {growth.factor:.2g}-fold while the time doubles"
    under = items[0] if items else "weight" if any(scene.deck.gravity) else ""
    reason += f" under {under}: {cause}" if under else ", in free motion"
    evidence = {"growth": growth.factor, "growth_rate": growth.rate}
    remedy = f"lower {items[0]}, or take" if items else "take"
    remedy += " the curves as one of many possible ones"
    if amplitude is not None:
        remedy = command(scene.loaded, {amplitude[0]: 0.5 * amplitude[1]}, force=True)
    return SolverFailure(reason, 0.0, items[0] if items else "", "physical", evidence, remedy)
