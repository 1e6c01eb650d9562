"""Short runs of a scene around a failure or a doubt: what goes away with which change of the deck."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import field
from typing import Any

import numpy as np

from hfsim.errors import LimitReached
from hfsim.integrators import METHODS, integrator
from hfsim.marching.balance import balance, step_samples
from hfsim.marching.integration import Integration, run_integration
from hfsim.marching.stop import Budget
from hfsim.maths.arrays import Array
from hfsim.maths.frozen import mutable
from hfsim.maths.matrices import dense
from hfsim.maths.rank import Dependence, by_joint, dependence
from hfsim.parts.bodies.models import LADDER, MODELS
from hfsim.scene.build import Scene, build
from hfsim.scene.gauging import gauge_of
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.schema import SolveSpec

DEAD = 1e-3
"""Smallest singular value of the joint equations, over that at the start, that means a dead centre."""
GOOD_BALANCE = 1e-3
"""Energy drift up to which an experiment counts as passed."""
AT_LEAST = 2.0
"""CPU time that work after a run may take where the run itself took less [s]."""
SHARE = 0.2
"""Part of the time for all experiments that each one may take; one of the first may take half of it."""
DENSE = 400
"""Unknowns, or joint equations, up to which dense matrices are taken apart: a second at most."""
AHEAD = 0.01
"""How far before and after the failure an experiment reaches, relative to the duration."""
ALIGNED = 0.05
"""Share of a blocked motion from which a joint takes part in blocking it."""

BY_TOLERANCE = "steps by tolerance"
"""What tells most of a run with fixed steps."""

Update = dict[str, Any]
"""Keys of the deck's ``solve`` with other values."""


def time_for(seconds: float) -> float:
    """Return the CPU time for work after a run that took so long: no more than that, or `AT_LEAST`."""
    return max(seconds, AT_LEAST)


@mutable
class Experiments:
    """Short runs of one scene around a failure, within a budget.

    Attributes
    ----------
    done : Integration
        The run in question.
    budget : Budget
        For all experiments together.
    outcomes : dict of str to str
        What was tried, and what came of it.
    """

    scene: Scene
    done: Integration
    budget: Budget
    outcomes: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._least = SHARE * self.budget.left

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

    @property
    def undecided(self) -> bool:
        """Whether any experiment did not come to an end."""
        return "not" in " ".join(self.outcomes.values()).split()

    @property
    def open_in_time(self) -> bool:
        """Whether a run with fixed steps was not followed to the end with steps by tolerance."""
        return self.outcomes.get(BY_TOLERANCE, "").startswith("not")

    def shortly_before(self) -> tuple[float, Array, Array]:
        """Return the last kept state well before the failure."""
        back = max(AHEAD * self.solve.duration, 2.0 * (self.solve.step or 0.0))
        early = [s for s in self.done.trajectory.segments if s.t <= self.stop_time - back]
        return (early[-1].t, early[-1].q, early[-1].v) if early else (0.0, self.scene.q, self.scene.v)

    def passes(self, what: str, update: Update, scene: Scene | None = None) -> bool:
        """Try the stretch around the failure with other settings, or another scene from its start.

        Raises
        ------
        KeyboardInterrupt
            If that ended the trial.
        """
        left = self.budget.left
        if left <= 0.0:
            self.outcomes[what] = "not tried, the time for experiments was used up"
            return False
        solve = self.solve.model_copy(update={"max_steps": None, **update, "duration": self.target})
        start = self.shortly_before() if scene is None else None
        guard = self.budget.guard(max(self._least, 0.5 * left))
        tried = run_integration(scene or self.scene, solve, guard, start)
        if isinstance(tried.stop, KeyboardInterrupt):
            raise tried.stop
        self.outcomes[what], good = self._outcome(scene or self.scene, tried)
        self.done.trajectory.past.recall()
        return good

    def _outcome(self, scene: Scene, tried: Integration) -> tuple[str, bool]:
        reached = tried.trajectory.t_end
        if isinstance(tried.stop, LimitReached):
            return f"not finished, {reached:.4g} s was reached", False
        if tried.stop is not None:
            return f"fails at {reached:.4g} s", False
        drift = balance(scene, step_samples(tried.trajectory))["energy_drift"]
        good = bool(drift <= GOOD_BALANCE)
        verb = "passes" if good else "gets wrongly past"
        return f"{verb} {self.stop_time:.4g} s, energy drift {drift:.1e}", good

    def passes_exact(self) -> bool:
        """Try the scene with every beam in the model exact, from its start."""
        exact = build(self.scene.loaded, models=dict.fromkeys(self.scene.models, LADDER[-1]))
        return self.passes("model exact", {}, exact)

    def other_settings(self) -> Iterator[tuple[str, Update]]:
        """Yield in words and in keys what else to try: shorter steps, other methods, other coordinates."""
        solve = self.solve
        if solve.step is not None:
            for word, part in (("half the step", 2.0), ("an eighth of the step", 8.0)):
                yield word, {"step": float(f"{solve.step / part:.4g}")}
            yield BY_TOLERANCE, self.finer()
            return
        yield "a tolerance 100 times tighter", self.finer()
        places = {name: integrator(name).rescue for name in METHODS}
        for method in sorted(places, key=lambda name: places[name]):
            if np.isfinite(places[method]) and method != self.done.method:
                yield f"method {method}", {"method": method, "stages": None, "order": None}
        bodies, models = self.scene.deck.bodies, self.scene.models.items()
        beams = [(MODELS[one], bodies[name].element) for name, one in models]
        if solve.coordinates == "frame" and any(one.stepping_in("absolute", e) != one for one, e in beams):
            yield "absolute coordinates", {"coordinates": "absolute"}

    def finer(self) -> Update:
        """Return a tolerance 100 times tighter, or steps by tolerance where they were fixed."""
        if self.solve.step is not None:
            return {"step": None, "method": "auto", "tolerance": min(self.solve.tolerance, 1e-6)}
        return {"tolerance": max(float(f"{self.solve.tolerance / 100.0:.4g}"), 1e-13)}

    def command(self, update: Update, force: bool = False) -> str:
        """Return the command that runs the deck with keys of ``solve`` changed that are not so already."""
        changes = {f"solve.{k}": value for k, value in update.items() if getattr(self.solve, k) != value}
        return command(self.scene.loaded, changes, force)

    def command_until_then(self) -> str:
        """Return the command that runs the deck until shortly before it stopped."""
        return command(self.scene.loaded, {"solve.duration": float(f"{self.stop_time * 0.98:.3g}")})


def joint_dependence(scene: Scene, q: Array) -> Dependence:
    """Return how near joint equations are to depending on one another in a state (n,), if any are solved.

    However far bodies have slid there: lengths are measured by what the scene has got to.
    """
    if not scene.system.n_rows:
        return Dependence(0, 1.0, ())
    equations = scene.system.unreduced
    gauged = equations.phi.jacobian_at(scene.system.absolute(q[None])) * gauge_of(scene, q).unit
    rows = by_joint(gauged, equations.rows, scene.joints)
    return dependence(rows, equations.rows, scene.joints, ALIGNED)


def left_out_counts(scene: Scene, q: Array) -> str:
    """Return what an equation left out is of that makes up for lost ones in a state (n,); '' if none does."""
    system = scene.system
    if not system.redundant:
        return ""
    x, (own, left_out) = system.absolute(q[None]), system.monitored
    kept, others = (dense(one.phi.jacobian_at(x)) for one in (own, left_out))
    known, found = _independent(kept), zip(left_out.constraints, left_out.rows, strict=True)
    counting = (c.item for c, rows in found if _independent(np.vstack([kept, others[rows]])) > known)
    return next(counting, "")


def _independent(rows: Array) -> int:
    """Return how many rows of unit length are independent, and not all but dependent."""
    lengths = np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-300)
    sizes = np.linalg.svd(rows / lengths, compute_uv=False)
    return int(np.sum(sizes > DEAD * sizes[0]))


def command_exact(scene: Scene, name: str, force: bool = False) -> str:
    """Return the command that runs the deck of a scene with a beam in the model exact."""
    own = getattr(scene.deck.bodies[name], "model", None) is not None
    return command(scene.loaded, {f"bodies.{name}.model" if own else "solve.model": LADDER[-1]}, force)


def command(loaded: LoadedDeck, changes: dict[str, Any], force: bool = False) -> str:
    """Return the command that runs a deck again with some entries changed.

    Parameters
    ----------
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


def listed(names: tuple[str, ...]) -> str:
    """Return names in quotes, with commas."""
    return ", ".join(f"'{name}'" for name in names)
