"""The model that suffices: each beam begins in the cheapest model certified, and moves up when it must.

The ladder is rigid, linear, exact. A run begins with all its beams rigid, which costs next to nothing;
the forces on them tell how they would bend (`hfsim.trust.quasistatic`), and from that and from the
deformation that flexible models compute follow estimates of what each model leaves out
(`hfsim.trust.validity`). Where an estimate passes the bound, the run goes back to where it was below a
tenth of it and goes on from there with a higher model.

`lowOrder` is not on the ladder: wherever it was measured, it took longer than exact in its better
coordinates. `linear` is taken only if the forecast of the rigid motion certifies it for at least half of
the time left, and only by the one flexible beam of a scene: with two, it took 0.8 to 2.4 times as long
as exact, and beside an exact one, without analytic derivatives, twice as long.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from hfsim.errors import DeckError, SolverFailure
from hfsim.integrators import Trajectory
from hfsim.marching.integration import Integration, Leg, run_integration
from hfsim.marching.record import Record
from hfsim.marching.stop import Halted, Progress
from hfsim.maths.arrays import Array
from hfsim.mechanics.deformation import Deformation
from hfsim.parts.bodies.models import LADDER, MODELS
from hfsim.scene.build import Scene, build
from hfsim.scene.loading import LoadedDeck
from hfsim.trust.handover import hand_over
from hfsim.trust.quasistatic import deformation_of
from hfsim.trust.validity import error_reason, tip_error, tip_range

SAFETY = 0.5
"""Estimate at which a model is left, over the error stated: estimates are of order of magnitude."""
CHECKPOINT = 0.1
"""Share of that estimate below which a state is good enough to go on from."""
TOGETHER = 0.1
"""Share of the duration within which bodies that leave their models do so together."""
SHORTEST = 0.05
"""Share of the duration below which a leg is not worth the disturbance at its end."""
WORTH_IT = 0.5
"""Share of the time left for which the model linear must be certified to be taken."""
EVERY = 16
"""Steps from one look at the estimates to the next."""
INNER = 8
"""Places in each step at which estimates are made when a part of the run has ended."""


class OutOfRange(Halted):
    """An estimate passed its bound: this part of the run ends."""


class Switch(NamedTuple):
    """A beam going over to a higher model.

    Attributes
    ----------
    time : float
        [s].
    energy_gained : float
        By the whole scene, all bodies that go over at this time together [J].
    energy_share : float
        That over the kinetic and strain energy there; 0 if there is none.
    """

    time: float
    body: str
    model: str
    next_model: str
    reason: str
    energy_gained: float
    energy_share: float


@dataclass
class Course:
    """What an adaptive run came to.

    Attributes
    ----------
    discarded_steps : int
        Of parts that were gone back over.
    errors : dict of str to float
        Largest estimate that was kept, by body, relative to the range of its tip.
    not_rigid : str
        Why the run could not begin with rigid beams, where it could not.
    """

    legs: list[Leg] = field(default_factory=list)
    switches: list[Switch] = field(default_factory=list)
    discarded_steps: int = 0
    errors: dict[str, float] = field(default_factory=dict)
    not_rigid: str = ""

    def shares(self) -> dict[str, dict[str, float]]:
        """Return the share of the time simulated that each beam spent in each model."""
        spans = [leg.done.trajectory.t_end - leg.begin for leg in self.legs]
        total = sum(spans)
        shares: dict[str, dict[str, float]] = {name: {} for name in self.legs[-1].scene.models}
        for leg, span in zip(self.legs, spans, strict=True):
            for name, model in leg.scene.models.items():
                share = span / total if total > 0.0 else 1.0
                shares[name][model] = shares[name].get(model, 0.0) + share
        return shares

    def facts(self) -> dict[str, Any]:
        """Return the course as JSON-ready facts."""
        return {
            "shares": self.shares(),
            "switches": [switch._asdict() for switch in self.switches],
            "discarded_steps": self.discarded_steps,
            "estimated_errors": self.errors,
            "not_rigid": self.not_rigid,
        }


class _Exit(NamedTuple):
    """Where a beam has to leave its model, and from where to go on."""

    time: float
    back_to: float
    reason: str


@dataclass
class Adaptive:
    """A run under way whose models are chosen in it; what is kept of it goes to the record."""

    loaded: LoadedDeck
    model: str | None
    progress: Progress | None
    record: Record
    course: Course = field(default_factory=Course)

    def __post_init__(self) -> None:
        solve = self.loaded.deck.solve
        named = self.loaded.deck.models(self.model or solve.model)
        self.chosen = {name: LADDER[0] for name, one in named.items() if one == "auto"}
        self.bound = SAFETY * solve.model_error
        self.reach: dict[str, float] = {}
        self.forecast: dict[str, dict[str, tuple[Array, Array]]] = {}

    def run(self) -> Course:
        """Make legs until the end, each with the models that the one before asked for; raise `DeckError`."""
        deck = self.loaded.deck
        scene, begin = self._first_scene(), 0.0
        self.record.open(scene)
        while True:
            start = (begin, scene.q, scene.v)
            if not self.watched(scene):
                done = run_integration(scene, deck.solve, self.progress, start, record=self.record)
                self.course.legs.append(Leg(scene, done, self.record.legs[-1], begin))
                return self.course
            done = run_integration(scene, deck.solve, self.progress, start, _Watch(self, scene))
            exits = self._exits(scene, done)
            if not exits:
                self._keep(scene, done, begin)
                return self.course
            at = min(one.back_to for one in exits.values())
            at = at if at - begin > SHORTEST * deck.solve.duration else begin
            soon = min(one.time for one in exits.values()) + TOGETHER * deck.solve.duration
            leaving = {name: one for name, one in exits.items() if one.time <= soon}
            kept = _until(scene, done, at)
            self.course.discarded_steps += len(done.trajectory.segments) - len(kept.trajectory.segments)
            if kept.trajectory.segments:
                self._keep(scene, kept, begin)
            try:
                scene, begin = self._moved_up(scene, kept.trajectory, leaving), at
            except SolverFailure as failure:
                self._end(failure)
                return self.course

    def _keep(self, scene: Scene, done: Integration, begin: float) -> None:
        done = done._replace(stop=self.record.keep(scene, done.trajectory, done.problem.counts) or done.stop)
        self.course.legs.append(Leg(scene, done, self.record.legs[-1], begin))

    def _end(self, failure: SolverFailure) -> None:
        """Let what was kept end with a failure."""
        leg = self.course.legs[-1]
        self.course.legs[-1] = leg._replace(done=leg.done._replace(stop=failure))

    def _first_scene(self) -> Scene:
        """Assemble the scene with rigid beams, or, where these cannot move, with flexible ones."""
        try:
            return build(self.loaded, self.model, self.chosen)
        except DeckError as refusal:
            self.course.not_rigid = refusal.problems[0].message
            self.chosen = dict.fromkeys(self.chosen, LADDER[-1])
            return build(self.loaded, self.model, self.chosen)

    def _moved_up(self, scene: Scene, path: Trajectory, leaving: Mapping[str, _Exit]) -> Scene:
        """Return the scene with higher models for some beams, starting where the trajectory ends."""
        before = dict(self.chosen)
        for name in leaving:
            self.chosen[name] = self._next_model(name, path.t_end)
        models = {**scene.models, **self.chosen}.values()
        if sum(MODELS[one].flexible for one in models) > 1:
            self.chosen = {k: LADDER[-1] if MODELS[m].alone else m for k, m in self.chosen.items()}
        new, gained = build(self.loaded, self.model, self.chosen), 0.0
        if self.course.legs:
            new, gained = hand_over(scene, new, path)
        system = new.system
        x, u = system.absolute(new.q[None]), system.absolute_velocity(new.q[None], new.v[None])
        there = float((system.kinetic_energy(x, u) + system.strain_energy(x))[0])
        share = gained / there if there > 0.0 else 0.0
        for name, after in self.chosen.items():
            if after != before[name]:
                reason = leaving[name].reason if name in leaving else "another beam is flexible too"
                switch = Switch(path.t_end, name, before[name], after, reason, gained, share)
                self.course.switches.append(switch)
        return new

    def _next_model(self, name: str, now: float) -> str:
        """Return the model to go over to: one that the forecast certifies for long, else the highest."""
        rest = self.loaded.deck.solve.duration - now
        forecast = self.forecast.get(name, {}) if self.chosen[name] == LADDER[0] else {}
        for model, (times, errors) in forecast.items():
            over = times[(times >= now) & (errors > self.bound)]
            if not len(over) or over[0] - now >= WORTH_IT * rest:
                return model
        return LADDER[-1]

    # ------------------------------------------------------------------ estimates

    def watched(self, scene: Scene) -> list[str]:
        """Return the beams whose model may have to be left."""
        return [name for name in self.chosen if scene.models[name] != LADDER[-1]]

    def _exits(self, scene: Scene, done: Integration) -> dict[str, _Exit]:
        """Return where beams have to leave their models; nothing if the leg can stand as it is."""
        names, stop = self.watched(scene), done.stop
        if not names or not (stop is None or isinstance(stop, SolverFailure | OutOfRange)):
            return {}
        times, q, v = _states(scene, done.trajectory)
        exits, errors = {}, {}
        for name in names:
            relative, terms, seen = self.estimate(scene, name, times, q, v, forecast=stop is None)
            errors[name] = float(relative.max())
            over = np.flatnonzero(~(relative <= self.bound))
            if not len(over) and not isinstance(stop, SolverFailure):
                continue
            first = int(over[0]) if len(over) else len(times) - 1
            good = np.flatnonzero(relative[: first + 1] < CHECKPOINT * self.bound)
            reason = error_reason(terms, first, seen, relative) if len(over) else str(stop)
            back_to = times[good[-1]] if len(good) else times[0]
            exits[name] = _Exit(float(times[first]), float(back_to), reason)
        if not exits:
            for name, error in errors.items():
                self.course.errors[name] = max(error, self.course.errors.get(name, 0.0))
        return exits

    def estimate(
        self, scene: Scene, name: str, times: Array, q: Array, v: Array, forecast: bool = False
    ) -> tuple[Array, dict[str, Array], Deformation]:
        """Return the error estimated over the range of the tip, its terms [m] and the deformation."""
        model, seen = scene.models[name], deformation_of(scene, scene.bodies[name], times, q, v)
        reach = max(tip_range(scene, name, scene.system.absolute(q)), float(np.ptp(seen.tip, axis=0).max()))
        first = forecast and model == LADDER[0]
        if first:
            self.reach.setdefault(name, reach)
        scale = max(reach, self.reach.get(name, 0.0), 1e-300)

        def error(terms: dict[str, Array]) -> Array:
            return np.asarray(sum(terms.values(), np.zeros(len(times))) / scale)

        if first:
            ringing = seen.bent(2.0)
            self.forecast[name] = {
                later: (times, error(tip_error(scene, name, later, ringing, times))) for later in LADDER[1:-1]
            }
        terms = tip_error(scene, name, model, seen, times)
        return error(terms), terms, seen


@dataclass
class _Watch:
    """Ends a leg of flexible models soon after an estimate passes the bound."""

    run: Adaptive
    scene: Scene

    def __post_init__(self) -> None:
        self._names = self.run.watched(self.scene)
        self._states: list[tuple[float, Array, Array]] = []
        # an all-rigid run is short, and its end is what forecasts are made from
        flexible = any(MODELS[model].flexible for model in self.scene.models.values())
        self._idle = not self._names or not flexible
        self._next = EVERY

    def __call__(self, t: float, q: Array, v: Array) -> None:
        """Look at a kept state.

        Raises
        ------
        OutOfRange
            If an estimate passed the bound.
        """
        if self._idle:
            return
        self._states.append((t, q, v))
        if len(self._states) < self._next:
            return
        # looks get rarer, so that their cost stays a small share
        self._next = len(self._states) + max(EVERY, len(self._states) // 8)
        times, states, rates = (np.array(part) for part in zip(*self._states, strict=True))
        for name in self._names:
            relative = self.run.estimate(self.scene, name, times, states, rates)[0]
            if not relative.max() <= self.run.bound:
                raise OutOfRange(f"'{name}' left the range of {self.scene.models[name]}")


def _states(scene: Scene, path: Trajectory) -> tuple[Array, Array, Array]:
    """Return times and states at the ends of the steps and within them."""
    ends = path.step_ends()
    inner = np.linspace(0.0, 1.0, INNER, endpoint=False)
    times = np.append((ends[:-1, None] + np.diff(ends)[:, None] * inner).ravel(), ends[-1])
    q, v = path.at(times)
    return times, *scene.system.project(times, q, v)


def _until(scene: Scene, done: Integration, t: float) -> Integration:
    """Return an integration cut off at a time, ended there as if that had been asked for."""
    path = done.trajectory
    count = sum(segment.t < t for segment in path.segments)
    q, v = scene.system.project(np.array([t]), *path.at(np.array([t])))
    return done._replace(trajectory=path.part(slice(count), t, q[0], v[0]), stop=None)
