"""Why a run failed or is suspicious: hypotheses, each tested by a short experiment.

A failure is *deck* if numbers or joints of the deck make it; *physical* if the mechanism itself has no
way on, or it stays whatever is changed; *model* if it goes away with `exact`; *numerical* if it goes
away with shorter steps, a tighter tolerance, another method or other coordinates.
"""

from __future__ import annotations

import shlex
from dataclasses import replace
from typing import Any

import numpy as np

from hfsim.errors import SolverFailure
from hfsim.integrators import Problem
from hfsim.marching.balance import balance, step_samples
from hfsim.marching.culprit import body_of
from hfsim.marching.integration import Integration
from hfsim.marching.stop import Budget
from hfsim.maths.arrays import Array, ComplexArray
from hfsim.maths.eigenvectors import eigenvectors
from hfsim.mechanics.linearized import by_differences
from hfsim.mechanics.modes import first_order
from hfsim.mechanics.pose import Pose, Twist
from hfsim.scene.build import Scene, build
from hfsim.trust.experiments import (
    DEAD,
    DENSE,
    GOOD_BALANCE,
    Experiments,
    command,
    command_exact,
    joint_dependence,
    left_out_counts,
    listed,
)
from hfsim.trust.validity import STEEP, truncated_beams, watch_validity

FEW_REJECTED, LAST, AS_LONG = 0.5, 100, 0.7
"""Share of rejected steps of a run that is only long; steps at its end, and their length over that of all."""
NEAR, FALLEN, SOON, BENT = 0.03, 4.0, 0.01, 0.03
"""Smallest singular value of the joint equations, over that at the start, from which it may be about to
vanish: if it fell to a part within a share of the time, and its square along a straight line but for this."""
FLAT = 1e-2
"""Stretch of a beam's axis below which it has next to no direction: joints that hold one lose it."""
MASSLESS = 1e-8
"""Mass over the scene's total from which a body without inertia is to blame for motions too fast."""


def diagnose(scene: Scene, done: Integration, budget: Budget) -> SolverFailure:
    """Return the failure of a run with its class, item, evidence and the next command to try.

    Parameters
    ----------
    done : Integration
        Whose ``stop`` is a `SolverFailure`.
    budget : Budget
        What experiments may take; `time_for` suits a run.

    Raises
    ------
    KeyboardInterrupt
        If that ended an experiment: nothing can be said then.
    """
    stop = done.stop
    assert isinstance(stop, SolverFailure)
    trial = Experiments(scene, done, budget)
    with np.errstate(all="ignore"):
        for hypothesis in HYPOTHESES:
            found = hypothesis(stop, trial)
            if found is not None:
                return found
        return _stays(stop, trial)


def _classed(
    stop: SolverFailure, kind: str, item: str, evidence: dict[str, Any], remedy: str
) -> SolverFailure:
    # what the failure itself had put it down to holds only if the experiments agree
    cause = stop.cause if kind == stop.kind else ""
    evidence = {**stop.evidence, **evidence}
    return replace(stop, kind=kind, item=item, evidence=evidence, remedy=remedy, cause=cause)


def _bad_numbers(stop: SolverFailure, trial: Experiments) -> SolverFailure | None:
    if stop.kind != "deck":
        return None
    file = shlex.quote(trial.scene.loaded.source.file)
    return replace(stop, remedy=f"{stop.remedy}, then: hfsim run {file}")


def _no_way_over(stop: SolverFailure, trial: Experiments) -> SolverFailure | None:
    """A change of models that found no state to go on from: as it says itself."""
    return stop if "next_model" in stop.evidence else None


def _too_long(stop: SolverFailure, trial: Experiments) -> SolverFailure | None:
    """Steps as long as ever, few of which are rejected, in a run that would take too many of them."""
    path, share = trial.done.trajectory, stop.evidence.get("rejected_share")
    if share is None or share > FEW_REJECTED or not path.segments:
        return None
    steps = [one.h for one in path.segments]
    if np.median(steps[-LAST:]) < AS_LONG * np.median(steps):
        return None
    step = {"step": float(np.median(steps))}
    found = _classed(stop, "numerical", "solve.duration", step, trial.command_until_then())
    return replace(found, cause="nothing holds them up but the duration")


def _wound_up(stop: SolverFailure, trial: Experiments) -> SolverFailure | None:
    """Elements whose sections turn too far from node to node: only a finer mesh can help."""
    if "turn_between_nodes" not in stop.evidence:
        return None
    count = trial.scene.bodies[stop.item.removeprefix("bodies.")].mesh.count  # type: ignore[attr-defined]
    finer = command(trial.scene.loaded, {f"{stop.item}.elements": 2 * count}, force=True)
    return replace(stop, remedy=f"{finer}, and more if it is to be wound up further")


def _dead_centre(stop: SolverFailure, trial: Experiments) -> SolverFailure | None:
    """Joint equations of several joints that lose rank along the way, not for want of a direction."""
    scene, end = trial.scene, trial.done.trajectory
    first, last = (joint_dependence(scene, q) for q in (scene.q, end.q))
    if len(last.joints) < 2 or last.size > NEAR * first.size:
        return None
    if last.size > DEAD * first.size and not _runs_out(trial, last.size):
        return None
    if any(least[0] < FLAT for least in _stretches(scene, end.q[None]).values()):
        return None
    if item := left_out_counts(scene, end.q):
        return _left_out(stop, item, end.t_end, last.size)
    driven = {row.item for row in scene.system.constraints if row.driven}
    involved = [f"joints.{name}" for name in last.joints]
    drivers = [item for item in involved if item in driven]
    item, what = (drivers or involved)[0], f"drives the mechanism into a dead centre of {listed(last.joints)}"
    if not drivers:
        what = f"and {listed(last.joints[1:])} block the same motion there: a dead centre"
    reason = f"{item} {what} at t = {end.t_end:.4g} s: "
    reason += "the joint equations lose their rank and no single motion leads on"
    evidence = {"smallest_singular_value": last.size, "smallest_singular_value_at_start": first.size}
    return replace(_classed(stop, "physical", item, evidence, trial.command_until_then()), reason=reason)


def _runs_out(trial: Experiments, size: float) -> bool:
    """Whether the smallest singular value at the end, of this size, is on its way to zero soon.

    Before a dead centre all is off its place there as the root of the time that is left, and so is that
    value: its square falls along a straight line.
    """
    path = trial.done.trajectory

    def square(ago: float) -> float:
        q = path.at(np.array([path.t_end - ago]))[0][0]
        return float(joint_dependence(trial.scene, q).size ** 2)

    ago, before = path.segments[-1].h if path.segments else path.t_end, 0.0
    while before < (FALLEN * size) ** 2:
        ago *= 2.0
        if ago > SOON * path.t_end:
            return False
        before = square(ago)
    straight = 0.5 * (before + size**2)
    return abs(square(0.5 * ago) - straight) < BENT * straight


def _left_out(stop: SolverFailure, item: str, at: float, size: float) -> SolverFailure:
    """Equations of joints that others made superfluous near the start, and do not any more."""
    reason = f"at t = {at:.4g} s an equation of {item} counts that was left out: "
    reason += "the others depend on one another there"
    remedy = "free a motion of a joint of that loop: spherical or cylindrical for revolute"
    evidence = {"smallest_singular_value": size}
    return replace(_classed(stop, "numerical", item, evidence, remedy), reason=reason)


def _truncated_model(stop: SolverFailure, trial: Experiments) -> SolverFailure | None:
    """What goes away with the model exact."""
    scene = trial.scene
    if next(truncated_beams(scene), None) is None:
        return None
    if not trial.passes_exact() and not (stop.kind == "model" and trial.undecided):
        return None
    name, term, sizes = _largest_term(stop, trial)
    evidence = {"term": term, **sizes, **trial.outcomes}
    found = _classed(stop, "model", f"bodies.{name}", evidence, command_exact(trial.scene, name))
    return found if found.cause else replace(found, cause="it goes away with the model exact")


def _largest_term(stop: SolverFailure, trial: Experiments) -> tuple[str, str, dict[str, Any]]:
    """Return the body whose model fails, the term to blame, and what was measured of it."""
    samples = step_samples(trial.done.trajectory)
    validity = watch_validity(trial.scene, samples.t, samples.q, samples.v)
    worst = max(validity, key=lambda one: float(validity[one]["largest"]["estimated_error"]))
    named = stop.item.removeprefix("bodies.")
    name = named if named in validity else worst
    largest = validity[name]["largest"]
    sizes = {key: largest[key] for key in ("slope", "foreshortening")}
    if validity[name]["left_at"] is not None:
        sizes["left_range_at"] = validity[name]["left_at"]
    if "smallest_eigenvalue" in stop.evidence:
        return name, "inertia of third order: the mass matrix becomes indefinite", sizes
    if largest["inertia"]:
        return name, "inertia forces of third order", {**sizes, "inertia": largest["inertia"]}
    if largest["stiffening"] > 1.0:
        return name, "stiffening by axial force", {**sizes, "stiffening": largest["stiffening"]}
    term = "foreshortening" if largest["slope"] > STEEP else "axial strain of the slope"
    return name, term, {**sizes, "axial_strain": largest["axial_strain"]}


def _method(stop: SolverFailure, trial: Experiments) -> SolverFailure | None:
    """What goes away with shorter steps, a tighter tolerance, another method or other coordinates."""
    for what, update in trial.other_settings():
        scene = None
        if "coordinates" in update:
            scene = build(trial.scene.loaded.with_solve(update), trial.scene.model, trial.scene.models)
        if trial.passes(what, update, scene):
            item, remedy = f"solve.{next(iter(update))}", trial.command(update)
            found = _classed(stop, "numerical", item, trial.outcomes, remedy)
            return replace(found, cause=f"it goes away with {what}")
    return None


def _without_mass(stop: SolverFailure, trial: Experiments) -> SolverFailure | None:
    """A body next to without mass whose motions are too fast for any step."""
    scene = trial.scene
    masses = _masses(scene)
    name = min(masses, key=lambda one: masses[one])
    if len(masses) < 2 or masses[name] > MASSLESS * sum(masses.values()):
        return None
    if scene.system.n > DENSE:
        return None
    values, vectors = _linearised_at_the_end(trial)
    fastest = int(np.argmax(np.abs(values)))
    item = body_of(scene, np.abs(vectors[: scene.system.n, fastest]))
    if item != f"bodies.{name}":
        return None
    rate = float(np.abs(values[fastest]))
    reason = f"{item} has next to no mass ({masses[name]:.3g} of {sum(masses.values()):.3g} kg) and moves at "
    reason += f"{rate:.2g} rad/s: no step can follow it"
    evidence = {"fastest_rate": rate, "mass": masses[name], **trial.outcomes}
    key = "mass" if hasattr(scene.deck.bodies[name], "mass") else "length"
    remedy = f"give {item}.{key} a realistic value or leave the body out"
    return replace(_classed(stop, "deck", item, evidence, remedy), reason=reason)


def _masses(scene: Scene) -> dict[str, float]:
    """Return the masses [kg] of bodies that can move: their kinetic energy at unit speed, twice."""
    x, n_dim = scene.system.absolute(scene.q[None]), len(scene.deck.gravity)
    pose, shift = Pose.level(np.zeros(n_dim)), next(Twist.units(n_dim))
    masses = {}
    for name, body in scene.bodies.items():
        if not body.still:
            u = np.zeros_like(x)
            u[:, body.columns] = body.moving(pose, shift)
            masses[name] = 2.0 * float(scene.system.kinetic_energy(x, u)[0])
    return masses


def _stays(stop: SolverFailure, trial: Experiments) -> SolverFailure:
    """What no experiment made go away."""
    item, evidence, n = stop.item, dict[str, Any](trial.outcomes), trial.scene.system.n
    if n <= DENSE:
        values, vectors = _linearised_at_the_end(trial)
        growing = int(np.argmax(values.real))
        evidence["growth_rate"] = float(values.real[growing])
        item = item or body_of(trial.scene, np.abs(vectors[:n, growing]))
    failed = sum(outcome.startswith("fails") for outcome in trial.outcomes.values())
    if trial.undecided and (trial.open_in_time or failed < 2):
        # too few experiments came to an end to put it down to the physics
        evidence["undecided"] = "the experiments that tell did not come to an end in the time allowed"
        return _classed(stop, stop.kind, item, evidence, trial.command(trial.finer()))
    return _classed(stop, "physical", item, evidence, trial.command_until_then())


def _crushed(stop: SolverFailure, trial: Experiments) -> SolverFailure | None:
    """A beam pressed together to nothing, or beyond what Green strain bears, while energy was still kept."""
    scene, path = trial.scene, trial.done.trajectory
    limits = {name: scene.bodies[name].gives_way_at or FLAT for name in scene.models}
    if not limits or not path.segments:
        return None
    ends = step_samples(path)
    least = _stretches(scene, ends.q)
    stretches = np.stack([least[name] / limit for name, limit in limits.items()])
    below = np.flatnonzero(stretches.min(axis=0) < 1.0)
    if not len(below) or not below[0]:
        return None
    k = int(below[0])
    name = list(limits)[int(np.argmin(stretches[:, k]))]
    until = path.part(slice(k), float(ends.t[k]), ends.q[k], ends.v[k])
    drift = balance(scene, step_samples(until))["energy_drift"]
    if drift > GOOD_BALANCE:
        return None
    time, stretch = float(ends.t[k]), limits[name] * float(stretches[:, k].min())
    what, remedy = "its axis has no direction there", trial.command_until_then()
    if limits[name] > FLAT:
        what = f"below {limits[name]:.3f} the force of Green strain gives way, and the beam collapses"
        entry = {f"bodies.{name}.strain": "engineering", f"bodies.{name}.curvature": "exact"}
        remedy = command(scene.loaded, entry)
    reason = f"body '{name}' is pressed together to {stretch:.2g} of its length at t = {time:.4g} s: {what}; "
    reason += f"{stop.reason} after that"
    evidence = {"collapse_at": time, "smallest_stretch": stretch, "energy_drift_until_then": drift}
    return replace(_classed(stop, "physical", f"bodies.{name}", evidence, remedy), reason=reason)


def _stretches(scene: Scene, q: Array) -> dict[str, Array]:
    """Return the smallest stretch of each beam along its axis in states (n_batch, n), (n_batch,)."""
    x = scene.system.absolute(q)
    return {name: scene.bodies[name].smallest_stretch(x) for name in scene.models}


def _linearised_at_the_end(trial: Experiments) -> tuple[ComplexArray, ComplexArray]:
    path = trial.done.trajectory
    return linearised(trial.done.problem, trial.stop_time, path.q, path.v)


def linearised(problem: Problem, t: float, q: Array, v: Array) -> tuple[ComplexArray, ComplexArray]:
    """Return eigenvalues [1/s] and eigenvectors of the equations of motion linearised at a state.

    Returns
    -------
    values : ndarray of complex, shape (2 n,)
    vectors : ndarray of complex, shape (2 n, 2 n)
        Of (q, v / rate), at some rate.  All are zero where the equations have no finite derivative.
    """
    # the analytic derivative leaves out what velocities do
    try:
        by_q, by_v = by_differences(problem.evaluate, t, q, v, True, problem.units()).slopes()
        assert by_v is not None
        square = float(np.abs(by_q).max(initial=0.0))
        rate = np.sqrt(square) if 0.0 < square < np.inf else 1.0
        values, vectors = eigenvectors(first_order(by_q, by_v, rate))
    except np.linalg.LinAlgError:
        return np.zeros(2 * len(q), complex), np.zeros((2 * len(q), 2 * len(q)), complex)
    return values, vectors


HYPOTHESES = (
    *(_no_way_over, _dead_centre, _bad_numbers, _truncated_model, _wound_up, _without_mass),
    *(_crushed, _method, _too_long),
)
"""In the order in which they are tried; the first that holds is the cause."""
