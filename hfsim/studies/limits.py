"""How long a fixed step may be: measured by bisection, beside what linear theory says.

The scene is linearised on the manifold of its joints (`hfsim.studies.spectra`).  The eigenvalues give
frequencies, growing motions (a scene that is physically unstable there) and the fastest period, in
multiples of which steps are told.

Theory is the test equation y'' = -w^2 y.  Per step the amplitude of a mode grows by the largest root of
the method at z = i w h: |R(z)| for one-step methods, the largest root of the characteristic polynomial
for backward differentiation.  Measured is the growth of a small disturbance in the fastest mode.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from hfsim.integrators import METHODS, Trajectory, choose, integrator
from hfsim.marching.balance import balance, step_samples
from hfsim.marching.columns import Columns, as_columns
from hfsim.marching.integration import run_integration
from hfsim.marching.stop import Budget, TimeUp
from hfsim.maths.arrays import Array
from hfsim.scene.build import Scene, build
from hfsim.scene.loading import LoadedDeck, parse_deck
from hfsim.studies.farm import Executor, Outcome, Task
from hfsim.studies.spectra import LimitsError, Spectrum, along, fastest_mode, spectrum
from hfsim.studies.stability.asked import Plan

STEPS = 400
"""Steps of a trial run: a growth of 1 % a step is 50-fold at its end."""
BOUNDS = (0.02, 24.0)
"""Shortest and longest step looked at, in fastest periods."""
WIDTH = 0.01
"""Relative width to which the longest stable step is located."""
AMPLITUDE = 1e-4
"""Motion of the disturbance, over the size of what moves most, or a turn of it: small enough to be linear."""
BLOWN = 10.0
"""Energy, over the largest there should be, from which a run has blown up."""
_ANSWER = 0.5
"""Time kept back by a measurement to tell what it has found until then [s]."""


# --- theory --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Theory:
    """What linear theory says of a method on the imaginary axis.

    Attributes
    ----------
    longest : float or None
        Longest step in periods that a trial run finds stable; None if any step is.
    """

    longest: float | None
    words: str


def theory(method: str, order: int | None = None) -> Theory:
    """Return what is predicted for undamped modes, steps in periods of the mode.

    A step counts as stable by what a trial run can see: an energy that grows less than `BLOWN`-fold in
    `STEPS` steps.

    Examples
    --------
    >>> theory("gauss").longest is None, round(theory("explicit").longest, 3)
    (True, 0.949)
    """
    said = integrator(method).stability
    named = f"order {order}: " if order else ""
    if said.growth is None:
        return Theory(None, said.words)
    y, amplification = np.linspace(0.0, 12.0, 601), said.growth
    growth = amplification(y, order)
    if growth.max() <= _SEEN:
        return Theory(None, named + said.words)
    first = partial(_first, lambda at: amplification(at, order), y, growth)
    last, worst, edge = np.nonzero(growth > _FEEDS)[0][-1], int(growth.argmax()), first(_SEEN)
    most = f"{growth[worst]:.3g} a step at wh = {y[worst]:.3g}"
    where = f"for every wh up to {y[last]:.3g}, by a factor of {most}"
    if last == len(y) - 1:
        where = f"from wh = {first(_FEEDS):.4g} on"
    seen = f"{BLOWN:g}-fold energy in {STEPS} steps at wh = {edge:.4g}"
    return Theory(edge / (2 * np.pi), f"{named}undamped modes grow {where}; {seen}")


_SEEN = BLOWN ** (1.0 / (2.0 * STEPS))
"""Growth of an amplitude per step from which a trial run sees it."""
_FEEDS = 1.0 + 1e-9
"""That from which a mode grows at all, and not by rounding."""


def _first(amplification: Callable[[Array], Array], y: Array, growth: Array, level: float) -> float:
    """Return from which w h on, to 1e-10, a mode grows by more than a level a step, by the growth at some."""
    beyond = int((growth > level).argmax())
    low, high = y[beyond - 1], y[beyond]
    for _ in range(28):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if amplification(np.array([middle]))[0] > level else (middle, high)
    return float(low)


# --- measurement ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class LimitJob:
    """A method whose longest stable step is to be measured, in a worker process.

    Attributes
    ----------
    limit : float
        Wall time it may take [s].
    deadline : float
        Reading of ``time.perf_counter`` by which all must have answered [s].
    turns : int
        Measurements in its process that share the time until then, this one included.
    """

    text: str
    file: str
    overrides: tuple[str, ...]
    model: str
    method: str
    order: int | None
    limit: float
    deadline: float = float("inf")
    turns: int = 1

    def budget(self) -> Budget:
        """Return its share of the wall time that is left now, some of it kept back to answer in time."""
        share = (self.deadline - time.perf_counter()) / self.turns
        return Budget(max(0.0, min(self.limit, share - min(_ANSWER, 0.1 * share))))


@dataclass(frozen=True)
class Limit:
    """The longest stable step of one method.

    Attributes
    ----------
    order : int or None
        Of gear.
    longest, beyond : float or None
        Longest step that was stable and shortest that was not, in fastest periods; None: none found.
    reason : str
        What happens beyond.
    predicted : float or None
        By theory; None for any step.
    words : str
        The theory in words.
    """

    method: str
    order: int | None
    stages: int | None
    longest: float | None
    beyond: float | None
    reason: str
    predicted: float | None
    words: str

    @property
    def title(self) -> str:
        """Method and order."""
        return f"{self.method} {self.order}" if self.order else self.method

    @property
    def deviation(self) -> float | None:
        """How far the longest stable step is from the predicted one [-]; None where it is not located."""
        if not self.predicted or self.longest is None or self.beyond is None:
            return None
        if self.beyond - self.longest > 2.0 * WIDTH * self.beyond:
            return None
        return self.longest / self.predicted - 1.0

    def facts(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {**asdict(self), "deviation": self.deviation}


def measure(job: LimitJob) -> Limit:
    """Find the longest stable step of a method within the time the job has."""
    budget = job.budget()
    overrides = (*job.overrides, f"solve.method={job.method}")
    scene = build(parse_deck(job.text, job.file, overrides), job.model)
    omega, shape = fastest_mode(scene, 0.0, scene.q, scene.v)
    period = 2.0 * np.pi / omega
    disturbed = _disturbed(scene, omega, shape)
    method = choose(scene.deck.solve, scene.system.dissipates)
    said = theory(method.name, job.order)
    found = Bracket(0.25 * said.longest if said.longest else 1.0)
    try:
        while (step := found.next()) is not None:
            found.note(step, trial(disturbed, job, step * period, budget))
        reason = found.reason
    except TimeUp:
        where = f"{found.reason}; not located any closer" if found.reason else "no end found"
        reason = f"{where} within {budget.seconds:.3g} s"
    return Limit(
        job.method, job.order, method.stages, found.low, found.high, reason, said.longest, said.words
    )


@dataclass
class Bracket:
    """The search for the longest stable step, in fastest periods.

    Attributes
    ----------
    first : float
        Step to begin with: doubled while stable, halved while not; then the gap is halved.
    low, high : float or None
        Longest step found stable and shortest found not to be.
    reason : str
        What happens at the latter.
    """

    first: float
    low: float | None = None
    high: float | None = None
    reason: str = ""

    def next(self) -> float | None:
        """Return the step to try next; None when the search has come to its end."""
        if self.low is None and self.high is None:
            return self.first
        if self.high is None:
            assert self.low is not None
            return 2.0 * self.low if 2.0 * self.low <= BOUNDS[1] else None
        if self.low is None:
            return 0.5 * self.high if 0.5 * self.high >= BOUNDS[0] else None
        return float(np.sqrt(self.low * self.high)) if self.high - self.low > WIDTH * self.high else None

    def note(self, step: float, reason: str) -> None:
        """Take in what came of a step: why it is not stable, empty if it is."""
        if reason:
            self.high, self.reason = step, reason
        else:
            self.low = step


def _disturbed(scene: Scene, omega: float, shape: Array) -> Scene:
    """Return the scene with its fastest mode set swinging a little."""
    v = scene.v + AMPLITUDE * omega * shape
    q, v = scene.system.project(np.zeros(1), scene.q[None], v[None])
    return replace(scene, q=q[0], v=v[0])


def trial(scene: Scene, job: LimitJob, step: float, budget: Budget) -> str:
    """Make `STEPS` steps of a length [s] from the scene's own start; return why it is not stable, if so."""
    update = {"method": job.method, "step": step, "duration": STEPS * step, "order": job.order}
    update |= {"stages": None, "max_steps": None}
    solve = scene.deck.solve.model_copy(update=update)
    done = run_integration(scene, solve, budget.guard(), (0.0, scene.q, scene.v)).in_time()
    if done.stop is not None:
        return str(done.stop)
    with np.errstate(all="ignore"):
        return _growth(scene, done.trajectory, step)


def _growth(scene: Scene, trajectory: Trajectory, step: float) -> str:
    """Return by how much too much the energy has grown in words; empty if it has not."""
    # not a number, and none, where the equations are singular
    given = float(np.fmax(0.0, balance(scene, step_samples(trajectory))["work_done"]))
    moving, stored = _energies(scene, 0.0, scene.q, scene.v)
    moving_end, stored_end = _energies(scene, STEPS * step, trajectory.q, trajectory.v)
    # a scene gains what weight, loads and drivers give; what dampers take is no licence to gain more
    due = max(moving + abs(stored) + max(stored - stored_end, 0.0) + given, 1e-300)
    growth = 1.0 + (moving_end + stored_end - moving - stored - given) / due
    return "" if growth <= BLOWN else f"the energy grows {growth:.3g}-fold in {STEPS} steps"


def _energies(scene: Scene, t: float, q: Array, v: Array) -> tuple[float, float]:
    """Return kinetic and strain energy, and that of springs and weight [J]."""
    system, time = scene.system, np.array([t])
    x, u = system.absolute(q[None]), system.absolute_velocity(q[None], v[None])
    moving = system.kinetic_energy(x, u) + system.strain_energy(x)
    return float(moving[0]), float(system.potential_energy(time, x)[0])


@dataclass(frozen=True)
class Limits(Columns):
    """What a model of a scene can stand; ``found["longest"]`` is a column of its methods.

    Attributes
    ----------
    spectra : tuple of Spectrum
        At the start and along the motion.
    lost : dict of str to str
        What was not measured, and why.
    """

    name: str
    model: str
    spectra: tuple[Spectrum, ...]
    limits: tuple[Limit, ...]
    lost: dict[str, str]
    interrupted: bool = False

    def __repr__(self) -> str:
        """Return what it is in a line: its spectra would fill the screen."""
        return f"<Limits {self.name}, {self.model}: {', '.join(one.title for one in self.limits)}>"

    @cached_property
    def columns(self) -> dict[str, Array]:  # type: ignore[override]
        """What is known of each method, and of each order of one, as columns."""
        return as_columns([one.facts() for one in self.limits], (*Limit.__dataclass_fields__, "deviation"))

    def facts(self) -> dict[str, Any]:
        """Return it as plain data, times in seconds and steps in fastest periods."""
        return {
            "name": self.name, "model": self.model,
            "spectra": [{**asdict(s), "period": s.period} for s in self.spectra],
            "limits": [limit.facts() for limit in self.limits], "lost": self.lost,
        }  # fmt: skip


def _spectra(job: LimitJob) -> tuple[Spectrum, ...]:
    scene = build(parse_deck(job.text, job.file, job.overrides), job.model)
    return along(scene, seconds=job.budget().seconds)


def limits(
    loaded: LoadedDeck,
    model: str,
    methods: tuple[str, ...],
    seconds: float,
    limit: float,
    executor: Executor,
) -> Limits:
    """Measure the longest stable step of each method, gear with each order.

    Parameters
    ----------
    seconds, limit : float
        Wall time all and one method may take [s].
    executor : Executor
        What does the work.

    Raises
    ------
    LimitsError
        If the scene has nothing that swings or too many unknowns.
    """
    deadline = time.perf_counter() + seconds
    scene = build(loaded, model)
    start = spectrum(scene, 0.0, scene.q, scene.v)
    if start.fastest <= 0.0:
        raise LimitsError(f"nothing swings in {loaded.deck.name} at the start: there is no fastest period")
    executor.deadline = deadline
    source = loaded.source
    wanted = [(m, k) for m in methods for k in (m in METHODS and integrator(m).orders) or (None,)]
    base = LimitJob(source.text, source.file, loaded.overrides, model, "", None, limit, deadline)
    turns = [-(-left // executor.jobs) for left in range(len(wanted) + 1, 0, -1)]
    executor.add(Task("spectra", _spectra, replace(base, turns=turns[0]), limit))
    for (method, order), left in zip(wanted, turns[1:], strict=True):
        job = replace(base, method=method, order=order, turns=left)
        executor.add(Task((method, order), measure, job, limit))
    found: dict[Any, Outcome] = {}
    executor.serve(lambda outcome: found.update({outcome.key: outcome}))
    lost = {_title(key): outcome.lost for key, outcome in found.items() if outcome.lost}
    lost |= {_title(key): executor.why_unreached for key in executor.unreached()}
    spectra = found["spectra"].value if "spectra" in found else None
    measured = [found[key].value for key in wanted if key in found and found[key].value is not None]
    return Limits(loaded.deck.name, model, spectra or (start,), tuple(measured), lost, executor.interrupted)


def limits_of_models(loaded: LoadedDeck, plan: Plan, executor: Executor) -> list[Limits]:
    """Do the same with the models of a plan, which share the time; fewer where a signal ends that."""
    deadline, found = time.perf_counter() + plan.seconds, list[Limits]()
    for k, model in enumerate(plan.models):
        share = (deadline - time.perf_counter()) / (len(plan.models) - k)
        found.append(limits(loaded, model, plan.methods, share, plan.limit, executor))
        if found[-1].interrupted:
            break
    return found


def _title(key: Any) -> str:
    return key if isinstance(key, str) else f"{key[0]}{f' of order {key[1]}' if key[1] else ''}"
