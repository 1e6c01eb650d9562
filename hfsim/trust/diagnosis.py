"""Why a run failed or is suspicious: hypotheses, each tested by a short experiment.

A failure is *deck* if numbers or joints of the deck make it; *physical* if the mechanism itself has no
way on, or it stays whatever is changed; *model* if it goes away with `exact`; *numerical* if it goes
away with shorter steps, a tighter tolerance, another method or other coordinates.
"""

from __future__ import annotations

import shlex
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hfsim.errors import LimitReached, SolverFailure
from hfsim.integrators import Trajectory
from hfsim.maths.arrays import Array
from hfsim.maths.rank import dependence
from hfsim.parts.bodies import BeamSpec
from hfsim.parts.bodies.nodal import NodalBeam
from hfsim.run.balance import balance, step_samples
from hfsim.run.culprit import body_of
from hfsim.run.integration import Integration, Watch, run_integration
from hfsim.scene.build import Scene, build
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.schema import SolveSpec
from hfsim.trust.growth import Growth, amplitude_of, disturbed_growth, loaded_items
from hfsim.trust.validity import STEEP, truncated_beams, watch_validity

GOOD_BALANCE = 1e-3
"""Energy drift up to which an experiment counts as passed."""
DEAD = 1e-3
"""Smallest singular value of the joint equations, over that at the start, that means a dead centre."""
MASSLESS = 1e-8
"""Mass over the scene's total from which a body without inertia is to blame for motions too fast."""
REDUNDANT = 1e-6
"""Smallest singular value of the joint equations below which joints are all but redundant."""
CRUSHED = 3.0**-0.5
"""Stretch below which the force of the Green strain gives way to more compression: d/ds (s^3 - s) = 0."""
AT_LEAST = 3.0
"""CPU time that a diagnosis may take where the run itself took less [s]."""
SHARE = 0.2
"""Part of the time for all experiments that each one may take; one of the first may take half of it."""
AHEAD = 0.01
"""How far before and after the failure an experiment reaches, relative to the duration."""


@dataclass
class Experiments:
    """Short runs of one scene around a failure, within a limit of CPU time.

    Attributes
    ----------
    scene : Scene
    done : Integration
        The run in question.
    seconds : float
        CPU time for all experiments together [s].
    outcomes : dict of str to str
        What was tried, and what came of it.
    """

    scene: Scene
    done: Integration
    seconds: float
    outcomes: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._end = time.process_time() + self.seconds

    @property
    def solve(self) -> SolveSpec:
        """How the run was solved."""
        return self.scene.deck.solve

    @property
    def stop_time(self) -> float:
        """When the run stopped [s]."""
        return self.done.trajectory.t_end

    @property
    def target(self) -> float:
        """Time an experiment must reach to have passed [s]."""
        beyond = max(AHEAD * self.solve.duration, 5.0 * (self.solve.step or 0.0))
        return min(self.stop_time + beyond, self.solve.duration)

    def shortly_before(self) -> tuple[float, Array, Array]:
        """Return the last kept state well before the failure."""
        back = max(AHEAD * self.solve.duration, 2.0 * (self.solve.step or 0.0))
        early = [s for s in self.done.trajectory.segments if s.t <= self.stop_time - back]
        return (early[-1].t, early[-1].q, early[-1].v) if early else (0.0, self.scene.q, self.scene.v)

    def passes(self, what: str, update: dict[str, Any], scene: Scene | None = None) -> bool:
        """Try the stretch around the failure with other settings, or another scene from its start."""
        left = self._end - time.process_time()
        if left <= 0.0:
            self.outcomes[what] = "not tried, the time for experiments was used up"
            return False
        solve = self.solve.model_copy(update={"max_steps": None, **update, "duration": self.target})
        start = self.shortly_before() if scene is None else None
        used = scene or self.scene
        watch = _until(time.process_time() + max(SHARE * self.seconds, 0.5 * left))
        tried = run_integration(used, solve, start=start, extra=watch)
        reached = tried.trajectory.t_end
        if isinstance(tried.stop, LimitReached):
            self.outcomes[what] = f"not finished, {reached:.4g} s was reached"
            return False
        if tried.stop is not None:
            self.outcomes[what] = f"fails at {reached:.4g} s"
            return False
        drift = balance(used.system, step_samples(tried.trajectory))["energy_drift"]
        good = bool(drift <= GOOD_BALANCE)
        verb = "passes" if good else "gets wrongly past"
        self.outcomes[what] = f"{verb} {self.stop_time:.4g} s, energy drift {drift:.1e}"
        return good


def _until(deadline: float) -> Watch:
    def watch(t: float, q: Array, v: Array) -> None:
        if time.process_time() > deadline:
            raise LimitReached("the time for experiments was used up", t)

    return watch


def time_for(seconds: float) -> float:
    """Return the CPU time for experiments with a run that took so long: no more than that, or `AT_LEAST`."""
    return max(seconds, AT_LEAST)


def diagnose(scene: Scene, done: Integration, seconds: float) -> SolverFailure:
    """Return the failure of a run with its class, item, evidence and the next command to try.

    Parameters
    ----------
    scene : Scene
    done : Integration
        Whose ``stop`` is a `SolverFailure`.
    seconds : float
        CPU time that experiments may take; `time_for` suits a run.
    """
    stop = done.stop
    assert isinstance(stop, SolverFailure)
    trial = Experiments(scene, done, seconds)
    with np.errstate(all="ignore"):
        for hypothesis in (_bad_numbers, _dead_centre, _truncated_model, _without_mass, _crushed, _method):
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


def _dead_centre(stop: SolverFailure, trial: Experiments) -> SolverFailure | None:
    """Joint equations that lose rank along the way."""
    scene, end = trial.scene, trial.done.trajectory
    if not scene.system.n_rows:
        return None
    first, last = (
        dependence(
            scene.system.unreduced.jacobians(scene.system.absolute(q[None]))[0],
            scene.system.unreduced.rows,
            scene.joints,
            0.05,
        )
        for q in (scene.q, end.q)
    )
    if last.size > DEAD * first.size:
        return None
    drivers = [name for name in last.joints if scene.deck.joints[name].type == "driver"]
    item = f"joints.{(drivers or last.joints)[0]}"
    what = (
        f"drives the mechanism into a dead centre of {_names(last.joints)}"
        if drivers
        else (f"and {_names(last.joints[1:])} block the same motion there: a dead centre")
    )
    until = float(f"{end.t_end * 0.98:.3g}")
    reason = (
        f"{item} {what} at t = {end.t_end:.4g} s: the joint equations lose their rank and no motion leads on"
    )
    evidence = {"smallest_singular_value": last.size, "smallest_singular_value_at_start": first.size}
    return replace(
        _classed(stop, "physical", item, evidence, command(scene.loaded, {"solve.duration": until})),
        reason=reason,
    )


def _names(names: tuple[str, ...]) -> str:
    return ", ".join(f"'{name}'" for name in names)


def _truncated_model(stop: SolverFailure, trial: Experiments) -> SolverFailure | None:
    """What goes away with the model exact."""
    scene = trial.scene
    if next(truncated_beams(scene), None) is None:
        return None
    exact = trial.passes("model exact", {}, _all_exact(scene))
    undecided = "not" in trial.outcomes["model exact"].split()
    if not exact and not (stop.kind == "model" and undecided):
        return None
    name, term, sizes = _largest_term(stop, trial)
    evidence = {"term": term, **sizes, **trial.outcomes}
    remedy = command(scene.loaded, _exact_for(scene, name))
    found = _classed(stop, "model", f"bodies.{name}", evidence, remedy)
    return found if found.cause else replace(found, cause="it goes away with the model exact")


def _all_exact(scene: Scene) -> Scene:
    """Return the same scene with every beam in the model exact."""
    return build(scene.loaded, models=dict.fromkeys(scene.models, "exact"))


def _exact_for(scene: Scene, name: str) -> dict[str, Any]:
    """Return the entry of the deck that gives a beam the model exact."""
    spec = scene.deck.bodies[name]
    own = isinstance(spec, BeamSpec) and spec.model is not None
    return {f"bodies.{name}.model" if own else "solve.model": "exact"}


def _largest_term(stop: SolverFailure, trial: Experiments) -> tuple[str, str, dict[str, Any]]:
    """Return the body whose model fails, the term to blame, and what was measured of it."""
    samples = step_samples(trial.done.trajectory)
    validity = watch_validity(trial.scene, samples.t, samples.q, samples.v)
    worst = max(validity, key=lambda one: float(validity[one]["largest"]["estimated_error"]))
    name = stop.item.removeprefix("bodies.") if stop.item.removeprefix("bodies.") in validity else worst
    largest = validity[name]["largest"]
    sizes = {key: largest[key] for key in ("slope", "foreshortening")}
    if validity[name]["left_at"] is not None:
        sizes["left_range_at"] = validity[name]["left_at"]
    if "smallest_eigenvalue" in stop.evidence:
        return name, "inertia of third order: the mass matrix becomes indefinite", sizes
    if trial.scene.models[name] == "lowOrder":
        return name, "inertia forces of third order", {**sizes, "inertia": largest["inertia"]}
    if largest["stiffening"] > 1.0:
        return name, "stiffening by axial force", {**sizes, "stiffening": largest["stiffening"]}
    term = "foreshortening" if largest["slope"] > STEEP else "axial strain of the slope"
    return name, term, {**sizes, "axial_strain": largest["axial_strain"]}


def _method(stop: SolverFailure, trial: Experiments) -> SolverFailure | None:
    """What goes away with shorter steps, a tighter tolerance, another method or other coordinates."""
    for what, update in _other_settings(trial):
        scene = None
        if "coordinates" in update:
            scene = build(trial.scene.loaded.with_solve(update), trial.scene.model, trial.scene.models)
        if trial.passes(what, update, scene):
            changes = _changes(trial, update)
            item = f"solve.{next(iter(update))}"
            remedy = command(trial.scene.loaded, changes)
            found = _classed(stop, "numerical", item, trial.outcomes, remedy)
            return replace(found, cause=f"it goes away with {what}")
    return None


def _changes(trial: Experiments, update: dict[str, Any]) -> dict[str, Any]:
    """Return the entries of an update that are not as the deck has them, by deck path."""
    return {f"solve.{key}": value for key, value in update.items() if getattr(trial.solve, key) != value}


def _other_settings(trial: Experiments) -> Iterator[tuple[str, dict[str, Any]]]:
    solve, used = trial.solve, trial.done.method
    if solve.step is not None:
        for word, part in (("half the step", 2.0), ("an eighth of the step", 8.0)):
            yield word, {"step": float(f"{solve.step / part:.4g}")}
        yield "steps by tolerance", {"step": None, "method": "auto", "tolerance": min(solve.tolerance, 1e-6)}
        return
    yield "a tolerance 100 times tighter", {"tolerance": max(float(f"{solve.tolerance / 100.0:.4g}"), 1e-13)}
    for method in ("radau", "gauss", "gear"):
        if method != used:
            yield f"method {method}", {"method": method, "stages": None, "order": None}
    if {"linear", "exact"} & set(trial.scene.models.values()) and solve.coordinates == "frame":
        yield "absolute coordinates", {"coordinates": "absolute"}


def _without_mass(stop: SolverFailure, trial: Experiments) -> SolverFailure | None:
    """A body next to without mass whose motions are too fast for any step."""
    scene = trial.scene
    masses = {name: _mass(scene, name) for name in scene.bodies}
    name = min(masses, key=lambda one: masses[one])
    if len(masses) < 2 or masses[name] > MASSLESS * sum(masses.values()):
        return None
    values, vectors = linearised(trial.done, trial.done.trajectory.t_end)
    fastest = int(np.argmax(np.abs(values)))
    item = body_of(scene, np.abs(vectors[: scene.system.n, fastest]))
    if item != f"bodies.{name}":
        return None
    rate = float(np.abs(values[fastest]))
    reason = f"{item} has next to no mass ({masses[name]:.3g} of {sum(masses.values()):.3g} kg) and moves at "
    reason += f"{rate:.2g} rad/s: no step can follow it"
    evidence = {"fastest_rate": rate, "mass": masses[name], **trial.outcomes}
    key = "mass" if scene.deck.bodies[name].type == "rigid" else "length"
    remedy = f"give {item}.{key} a realistic value or leave the body out"
    return replace(_classed(stop, "deck", item, evidence, remedy), reason=reason)


def _mass(scene: Scene, name: str) -> float:
    spec = scene.deck.bodies[name]
    if spec.type == "rigid":
        return float(spec.mass)
    density, area = scene.deck.materials[spec.material].density, scene.deck.sections[spec.section].area
    return float(density * area * spec.length)


def _stays(stop: SolverFailure, trial: Experiments) -> SolverFailure:
    """What no experiment made go away."""
    end = trial.done.trajectory
    values, vectors = linearised(trial.done, end.t_end)
    growing = int(np.argmax(values.real))
    growth = float(values.real[growing])
    evidence: dict[str, Any] = {**trial.outcomes, "growth_rate": growth}
    item = stop.item or body_of(trial.scene, np.abs(vectors[: trial.scene.system.n, growing]))
    failed = [outcome for outcome in trial.outcomes.values() if outcome.startswith("fails")]
    if len(failed) < 2 and "not" in " ".join(trial.outcomes.values()).split():
        # too few experiments came to an end to put it down to the physics
        change = {"solve.tolerance": max(float(f"{trial.solve.tolerance / 100.0:.4g}"), 1e-13)}
        evidence["undecided"] = "no experiment came to an end in the time allowed"
        return _classed(stop, stop.kind, item, evidence, command(trial.scene.loaded, change))
    half = float(f"{end.t_end * 0.98:.3g}")
    remedy = command(trial.scene.loaded, {"solve.duration": half})
    return _classed(stop, "physical", item, evidence, remedy)


def suspect(
    scene: Scene, done: Integration, statistics: dict[str, Any], seconds: float
) -> dict[str, Any] | None:
    """Return class, item, evidence and next command of a run that reached its end but is not to be trusted.

    None where nothing speaks against it.

    Parameters
    ----------
    scene : Scene
    done : Integration
    statistics : dict
        With ``energy_drift`` and ``validity``.
    seconds : float
        CPU time that experiments may take; `time_for` suits a run.
    """
    trial = Experiments(scene, done, seconds)
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
    evidence = {"energy_drift": drift}
    gauss: tuple[str, dict[str, Any]] = ("method gauss", {"method": "gauss", "step": None, "stages": None})
    for what, update in (next(_other_settings(trial)), gauss):
        if trial.passes(what, update, scene):
            changes = _changes(trial, update)
            remedy = command(scene.loaded, changes, force=True)
            item = "solve.step" if solve.step is not None else f"solve.{next(iter(update))}"
            facts = {**evidence, **trial.outcomes}
            reason = "the energy balance is off, and is kept with smaller steps"
            return SolverFailure(reason, trial.stop_time, item, "numerical", facts, remedy)
    beams = [body for body in scene.system.variable_mass if body.truncated]
    if beams and trial.passes("model exact", {}, _all_exact(scene)):
        facts = {**evidence, **trial.outcomes, "term": "inertia forces of third order"}
        remedy = command(scene.loaded, _exact_for(scene, beams[0].name), force=True)
        reason = "the energy balance is off whatever the steps, and is kept by exact: lowOrder breaks it"
        return SolverFailure(reason, trial.stop_time, f"bodies.{beams[0].name}", "model", facts, remedy)
    remedy = command(scene.loaded, {"solve.tolerance": 1e-10}, force=True)
    reason = "the energy balance is off, and no experiment kept it in the time allowed"
    return SolverFailure(
        reason, trial.stop_time, "solve", "numerical", {**evidence, **trial.outcomes}, remedy
    )


def _left_range(trial: Experiments, validity: dict[str, Any]) -> SolverFailure | None:
    """The body whose model left its range first."""
    left = {name: facts for name, facts in validity.items() if facts["left_at"] is not None}
    if not left:
        return None
    name = min(left, key=lambda one: float(left[one]["left_at"]))
    reason = f"body '{name}' left the range of {trial.scene.models[name]}: {left[name]['reason']}"
    evidence = dict(left[name]["largest"])
    remedy = command(trial.scene.loaded, _exact_for(trial.scene, name), force=True)
    return SolverFailure(reason, left[name]["left_at"], f"bodies.{name}", "model", evidence, remedy)


def _nearly_redundant(trial: Experiments) -> SolverFailure | None:
    """Joints that all but block the same motion twice."""
    scene = trial.scene
    if not scene.system.n_rows:
        return None
    equations = scene.system.unreduced
    Phi_x = equations.jacobians(scene.system.absolute(scene.q[None]))[0]
    found = dependence(Phi_x, equations.rows, scene.joints, 0.05)
    if found.size > REDUNDANT:
        return None
    reason = (
        f"joints {_names(found.joints)} all but block the same motion twice: their reactions mean nothing"
    )
    evidence = {"smallest_singular_value": found.size}
    item = f"joints.{found.joints[-1]}"
    return SolverFailure(reason, 0.0, item, "deck", evidence, f"remove {item} or free one of its motions")


def _unstable(trial: Experiments) -> SolverFailure | None:
    """A motion under load from which disturbances grow away."""
    scene = trial.scene
    if not loaded_items(scene):
        return None
    watch = _until(time.process_time() + trial.seconds)
    growth = disturbed_growth(scene, trial.done, trial.solve, watch)
    return instability(scene, growth) if growth is not None and growth.unstable else None


def instability(scene: Scene, growth: Growth) -> SolverFailure:
    """Return class, item and evidence of a scene from whose motion disturbances grow away."""
    items = loaded_items(scene)
    amplitude = amplitude_of(scene, items[0]) if items else None
    cause = "parametric resonance" if amplitude else "buckling or another instability"
    reason = f"a disturbance of the start grows {growth.factor:.2g}-fold while the time doubles"
    reason += f" under {items[0]}: {cause}" if items else ", in free motion"
    evidence = {"growth": growth.factor, "growth_rate": growth.rate}
    remedy = f"lower {items[0]}, or take" if items else "take"
    remedy += " the curves as one of many possible ones"
    if amplitude is not None:
        remedy = command(scene.loaded, {amplitude[0]: 0.5 * amplitude[1]}, force=True)
    return SolverFailure(reason, 0.0, items[0] if items else "", "physical", evidence, remedy)


def _crushed(stop: SolverFailure, trial: Experiments) -> SolverFailure | None:
    """A beam pressed together beyond what Green strain can bear, while the energy was still kept."""
    scene, path = trial.scene, trial.done.trajectory
    beams = [
        one
        for one in scene.bodies.values()
        if isinstance(one, NodalBeam) and scene.models[one.name] != "linear" and _is_green(scene, one)
    ]
    if not beams or not path.segments:
        return None
    ends = step_samples(path)
    x = scene.system.absolute(ends.q)
    stretches = np.stack([_smallest_stretch(body, x) for body in beams])
    below = np.flatnonzero(stretches.min(axis=0) < CRUSHED)
    if not len(below) or not below[0]:
        return None
    k, body = int(below[0]), beams[int(np.argmin(stretches[:, below[0]]))]
    until = Trajectory(path.t_start, float(ends.t[k]), ends.q[k], ends.v[k], path.segments[:k])
    drift = balance(scene.system, step_samples(until))["energy_drift"]
    if drift > GOOD_BALANCE:
        return None
    time, stretch = float(ends.t[k]), float(stretches[:, k].min())
    reason = (
        f"body '{body.name}' is pressed together to {stretch:.2g} of its length at t = {time:.4g} s: below "
    )
    reason += (
        f"{CRUSHED:.3f} the force of Green strain gives way, and the beam collapses; {stop.reason} after that"
    )
    evidence = {"collapse_at": time, "smallest_stretch": stretch, "energy_drift_until_then": drift}
    entry = {f"bodies.{body.name}.strain": "engineering", f"bodies.{body.name}.curvature": "exact"}
    found = _classed(stop, "physical", f"bodies.{body.name}", evidence, command(scene.loaded, entry))
    return replace(found, reason=reason)


def _is_green(scene: Scene, body: NodalBeam) -> bool:
    spec = scene.deck.bodies[body.name]
    return isinstance(spec, BeamSpec) and spec.strain == "green"


def _smallest_stretch(body: NodalBeam, x: Array) -> Array:
    """Return the smallest length of the slope vector along a beam, shape (n_batch,)."""
    places = np.linspace(0.0, body.mesh.length, 4 * body.mesh.count + 1)
    rows = np.array([body.mesh.shape(float(a), 0.0, (1, 0)) for a in places])
    slopes = rows @ x[:, body.columns].reshape(len(x), -1, 2)
    return np.asarray(np.linalg.norm(slopes, axis=2).min(axis=1))


def linearised(done: Integration, t: float) -> tuple[Array, Array]:
    """Return eigenvalues [1/s] and eigenvectors of the equations of motion linearised at the end of a run.

    Returns
    -------
    values : ndarray of complex, shape (2 n,)
    vectors : ndarray of complex, shape (2 n, 2 n)
        Of (q, v).
    """
    problem = replace(done.problem, dissipates=True)
    by_q, by_v = problem.jacobians(t, done.trajectory.q, done.trajectory.v)
    n = len(by_q)
    assert by_v is not None
    matrix = np.block([[np.zeros((n, n)), np.eye(n)], [by_q, by_v]])
    if not np.isfinite(matrix).all():
        return np.zeros(2 * n), np.zeros((2 * n, 2 * n))
    values, vectors = np.linalg.eig(matrix)
    return values, vectors


def command(loaded: LoadedDeck, changes: dict[str, Any], force: bool = False) -> str:
    """Return the command that runs a deck again with some entries changed.

    Parameters
    ----------
    loaded : LoadedDeck
    changes : dict
        Deck path to value; they replace overrides already made.
    force : bool
        Replace the results of a finished run.
    """
    kept = [one for one in loaded.overrides if one.partition("=")[0] not in changes]
    parts = ["hfsim run", shlex.quote(loaded.source.file)]
    for override in [*kept, *(f"{key}={_text(value)}" for key, value in changes.items())]:
        parts.append(f"--set {shlex.quote(override)}")
    return " ".join([*parts, "--force"] if force else parts)


def _text(value: Any) -> str:
    return "null" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
