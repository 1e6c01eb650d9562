"""Error against run time: one scene with many methods, tolerances, models and meshes.

The truth is computed, not assumed.  For each model and mesh (a `Cell`) the same equations are solved by
two methods, ever tighter, until they agree; what is left between them is the error floor, below which no
error is a number.  With several meshes a second truth, on a mesh twice as fine as the finest, splits the
error of each point into that of time and that of the mesh.

Nothing is printed or written here.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from hfsim.errors import HfsimError
from hfsim.maths.arrays import Array
from hfsim.parts.bodies import BeamSpec
from hfsim.parts.channels import Samples
from hfsim.run.balance import balance, step_samples
from hfsim.run.distance import ChannelScale, channel_scales, farthest, gap
from hfsim.run.integration import Integration, run_integration
from hfsim.run.solution import Channel
from hfsim.run.stop import Budget, Progress, TimeUp
from hfsim.scene.build import Scene, build
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.schema import SolveSpec
from hfsim.simulate import compute_channels, sample

TARGETS = {"1 %": 1e-2, "0.01 %": 1e-4, "1e-6": 1e-6}
"""Errors, relative to the range of the channel, for which a method is recommended."""

LADDER = (1e-7, 1e-9, 1e-11, 1e-13)
"""Tolerances of the reference, tried in this order."""

REFERENCES = (("gauss", 16, 1.0), ("radau", 16, 0.1))
"""The two methods that must agree, each with its stages and a factor on the tolerance; the first one
gives the reference."""

ROUND_OFF = 1e-14
"""Relative error that no reference is trusted below, however well its two methods agree."""

_ENOUGH = 1e-12
"""Agreement at which the reference is refined no more."""
_REFERENCE_SHARE = 0.5
"""Part of the budget that all references may take."""
_IN_TIME_SHARE = 0.6
"""Part of that for the references of the meshes asked for; the rest is for the finer mesh."""
_TRIAL_SHARE = 0.02
"""Part of the budget after which the first point of a method is stopped, judged by how far it came, and
put back until its turn: one slow method must not starve the others."""
_BETTER = 0.8
"""Factor by which an error must fall to be worth more time."""
_WARM_UP = 1e-3
"""Part of the duration that each method runs first, so that no point pays for imports and tables."""
_REPEAT_SHARE = 0.02
"""Part of the budget within which a point is repeated."""
_FIRST_GROWTH = 2.0
"""Growth of the cost from one level to the next before it has been seen."""
_LADDER_GROWTH = 2.5
"""Growth of the cost of a reference from one rung of `LADDER` to the next."""

@dataclass(frozen=True)
class Sweep:
    """What is varied.

    Attributes
    ----------
    methods, models : tuple of str
    tolerances : tuple of float
        Loosest first [-]; not used with `steps`.
    steps : tuple of float
        Fixed steps, longest first [s]; empty: steps follow the tolerances.
    elements : tuple of int
        Elements of every beam; empty: as in the deck.
    degrees : tuple of int
        Degrees of every beam of cable elements; empty: as in the deck.
    repeats : int
        How often a short point is timed.
    """

    methods: tuple[str, ...]
    models: tuple[str, ...]
    tolerances: tuple[float, ...] = tuple(10.0**-k for k in range(3, 11))
    steps: tuple[float, ...] = ()
    elements: tuple[int, ...] = ()
    degrees: tuple[int, ...] = ()
    repeats: int = 3

    @property
    def levels(self) -> tuple[float, ...]:
        """Steps or tolerances, cheapest first."""
        return tuple(sorted(self.steps or self.tolerances, reverse=True))

    @property
    def meshes(self) -> list[tuple[int | None, int | None]]:
        """Elements and degree of each mesh; None: as in the deck.

        With several degrees, meshes are left out that are finer, by their number of vectors, than the
        finest one of the lowest degree: they would take most of the time and compare with nothing.
        """
        degrees: tuple[int | None, ...] = tuple(sorted(self.degrees)) or (None,)
        if not self.elements:
            return [(None, degree) for degree in degrees]
        limit = self._finest
        pairs = [(n, degree) for degree in degrees for n in sorted(self.elements)]
        return [(n, p) for n, p in pairs if p is None or n == 1 or n * (p - 1) <= limit]

    @property
    def _finest(self) -> int:
        return max(self.elements, default=1) * (min(self.degrees, default=3) - 1)

    @property
    def fine_mesh(self) -> tuple[int | None, int | None, int]:
        """Elements, degree and a factor on the elements of a mesh about twice as fine as the finest one."""
        degree = max(self.degrees, default=None)
        if not self.elements:
            return None, degree, 2
        if degree is None:
            return max(self.elements), None, 2
        return -(-2 * self._finest // (degree - 1)), degree, 1


@dataclass(frozen=True)
class ChannelError:
    """Error of one channel of one point.

    Attributes
    ----------
    channel, unit : str
    max_abs : float
        Largest error over time, in `unit`.
    max_relative, rms_relative : float
        Largest and root-mean-square error over the channel's scale [-].
    below_floor : bool
        Whether the error is smaller than the reference's own; the numbers are the floor then.
    judged : bool
        Whether the channel counts for the error of the point.
    """

    channel: str
    unit: str
    max_abs: float
    max_relative: float
    rms_relative: float
    below_floor: bool
    judged: bool


@dataclass(frozen=True)
class Point:
    """One model, mesh, method and tolerance (or step).

    Attributes
    ----------
    model : str
    elements : int
        Elements of all beams together.
    degree : int
        Highest of their degrees.
    method : str
    tolerance, step : float or None
        Which of the two was prescribed.
    status, reason : str
        ``done``, ``failed``, ``limit``, ``over budget`` (cut off) or ``skipped``; why.
    cpu, cpu_min, cpu_max : float or None
        CPU time of the integration, median and extremes of `repeats` [s].
    error, rms_error : float or None
        Time error of the worst judged channel over its scale: largest over time, root mean square [-].
    below_floor : bool
        Whether `error` is the floor because the true one is smaller.
    total_error : float or None
        Error against the mesh-converged reference [-].
    exact_error : float or None
        Error against the best reference of the model exact (ancf where exact is not swept), that of the model
        included; None where neither is there [-].
    """

    model: str
    elements: int
    method: str
    tolerance: float | None
    step: float | None
    status: str = "skipped"
    reason: str = ""
    degree: int = 3
    cpu: float | None = None
    cpu_min: float | None = None
    cpu_max: float | None = None
    repeats: int = 0
    steps: int | None = None
    rejected: int | None = None
    newton_iterations: int | None = None
    evaluations: int | None = None
    factorisations: int | None = None
    energy_drift: float | None = None
    error: float | None = None
    rms_error: float | None = None
    worst_channel: str = ""
    below_floor: bool = False
    total_error: float | None = None
    exact_error: float | None = None
    channels: tuple[ChannelError, ...] = ()

    @property
    def mesh(self) -> str:
        """Elements, and their degree unless cubic, in words."""
        return mesh_words(self.elements, self.degree)

    @property
    def level(self) -> str:
        """Tolerance or step in words."""
        if self.step is not None:
            return f"step {self.step:g} s"
        return f"tolerance {tidy(self.tolerance or 0.0)}"

    @property
    def judged_error(self) -> float | None:
        """Total error where one is known, else the time error."""
        return self.error if self.total_error is None else self.total_error


@dataclass(frozen=True)
class Cell:
    """One model on one mesh, with its reference.

    Attributes
    ----------
    model : str
    elements : int
        Elements of all beams together.
    degree : int
        Highest of their degrees.
    unknowns : int
    status, reason : str
        ``done``, ``failed`` (there is no reference: the model broke down) or ``over budget``.
    reference : str
        How the reference was computed.
    reference_cpu : float
        What it cost, all attempts together [s].
    floor : float or None
        Largest difference of its two methods in any judged channel over its scale [-].
    floors : dict of str to float
        The same for each channel.
    mesh_error, mesh_order : float or None
        Distance to the mesh-converged reference in the worst judged channel [-]; order by which it fell
        since the coarser mesh.
    mesh_channel : str
        That channel.
    mesh_errors : dict of str to float
        The same distance for each judged channel [-].
    mesh_reference, mesh_reference_degree : int or None
        Elements of that reference and their degree.
    model_error : float or None
        Distance to the reference of the model exact on the same mesh in the worst judged channel [-].
    model_channel : str
        That channel.
    """

    model: str
    elements: int
    unknowns: int
    status: str
    reason: str = ""
    degree: int = 3
    reference: str = ""
    reference_cpu: float = 0.0
    floor: float | None = None
    floors: dict[str, float] = field(default_factory=dict)
    mesh_error: float | None = None
    mesh_order: float | None = None
    mesh_channel: str = ""
    mesh_errors: dict[str, float] = field(default_factory=dict)
    mesh_reference: int | None = None
    mesh_reference_degree: int = 3
    model_error: float | None = None
    model_channel: str = ""

    @property
    def mesh(self) -> str:
        """Elements, and their degree unless cubic, in words."""
        return mesh_words(self.elements, self.degree)

    @property
    def mesh_reference_words(self) -> str:
        """Mesh of the mesh-converged reference in words."""
        return mesh_words(self.mesh_reference or 0, self.mesh_reference_degree)


def mesh_words(elements: int, degree: int) -> str:
    """Return a mesh in words.

    Examples
    --------
    >>> mesh_words(4, 3), mesh_words(2, 7)
    ('4 elements', '2 elements of degree 7')
    """
    plain = f"{elements} element{'s' if elements > 1 else ''}"
    return plain if degree == 3 else f"{plain} of degree {degree}"


@dataclass(frozen=True)
class Bench:
    """Everything a study found.

    Attributes
    ----------
    name : str
        Name of the deck.
    status : str
        ``done``, ``failed`` (no model had a reference) or ``interrupted``.
    duration : float
        Span of the scene [s].
    budget, used : float
        Wall time allowed and used [s].
    cells : tuple of Cell
    points : tuple of Point
    """

    name: str
    status: str
    duration: float
    budget: float
    used: float
    cells: tuple[Cell, ...]
    points: tuple[Point, ...]

    def points_of(self, cell: Cell) -> list[Point]:
        """Return the points of one cell."""
        mesh = (cell.model, cell.elements, cell.degree)
        return [p for p in self.points if (p.model, p.elements, p.degree) == mesh]

    def degrees(self, model: str) -> list[int]:
        """Return the degrees of the meshes of a model."""
        return sorted({cell.degree for cell in self.cells if cell.model == model})

    def points_of_degree(self, model: str, degree: int) -> list[Point]:
        """Return the points of all meshes of a model with elements of a degree."""
        return [p for p in self.points if (p.model, p.degree) == (model, degree)]

    @property
    def recommendations(self) -> list[str]:
        """One sentence for each model and each of `TARGETS`."""
        models = dict.fromkeys(cell.model for cell in self.cells)
        lines = []
        for model in models:
            mine = [p for p in self.points if p.model == model]
            # where some meshes are known to be wrong by so much, one of unknown error must not win
            mine = [p for p in mine if p.total_error is not None] or mine
            meshes = len({p.mesh for p in mine}) > 1
            prefix = f"{model}: " if len(models) > 1 else ""
            lines += [prefix + advice(mine, words, target, meshes) for words, target in TARGETS.items()]
        return [*lines, *self._advice_on_models()]

    def _advice_on_models(self) -> list[str]:
        """Return how far each model is from exact, and for each target the cheapest model that suffices."""
        others = [cell for cell in self.cells if cell.model_error is not None]
        lines = [
            f"{c.model}, {c.mesh}: off {self._true_model} by {c.model_error:.1e} in {c.model_channel}"
            for c in others
        ]
        if not others:
            return lines
        judged = [replace(p, error=None, total_error=p.exact_error) for p in self.points]
        meshes = len({p.mesh for p in judged}) > 1
        return lines + [model_advice(judged, words, target, meshes) for words, target in TARGETS.items()]

    @property
    def _true_model(self) -> str:
        return _true_model({cell.model for cell in self.cells})


# --- solving -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Truth:
    """A reference: its channels, what errors are divided by, and how far its two methods differ."""

    channels: tuple[Channel, ...]
    scales: tuple[ChannelScale, ...]
    floors: dict[str, float]
    how: str

    @property
    def floor(self) -> float:
        judged = [self.floors[s.channel] for s in self.scales if s.judged]
        return max(judged, default=ROUND_OFF)


@dataclass
class _Work:
    """A cell while it is being worked on."""

    cell: Cell
    scene: Scene
    truth: _Truth | None
    fine: _Truth | None = None
    exact: _Truth | None = None


def with_mesh(loaded: LoadedDeck, count: int | None, degree: int | None, times: int = 1) -> LoadedDeck:
    """Return the deck with `times` `count` elements of a degree in every beam; None leaves what there is."""
    deck = loaded.deck
    bodies = dict(deck.bodies)
    for name, spec in deck.bodies.items():
        if isinstance(spec, BeamSpec):
            number = {"elements": times * (spec.elements if count is None else count)}
            order = {} if degree is None or spec.element != "cable" else {"degree": degree}
            bodies[name] = spec.model_copy(update={**number, **order})
    return replace(loaded, deck=deck.model_copy(update={"bodies": bodies}))


def _elements_of(scene: Scene) -> int:
    return sum(spec.elements for spec in scene.deck.bodies.values() if spec.type == "beam")


def _degree_of(scene: Scene) -> int:
    return max((spec.degree for spec in scene.deck.bodies.values() if spec.type == "beam"), default=3)


def _solve_of(scene: Scene, method: str, level: float, fixed: bool, stages: int | None = None) -> SolveSpec:
    asked = {"step": level} if fixed else {"tolerance": level, "step": None}
    # stages and order of the deck are kept where a point uses the deck's own method
    own = scene.deck.solve.method == method and stages is None
    options = {} if own else {"stages": stages, "order": None}
    return scene.deck.solve.model_copy(update={"method": method, **asked, **options})


def _timed(scene: Scene, solve: SolveSpec, guard: Progress) -> tuple[Integration, float]:
    start = time.process_time()
    done = run_integration(scene, solve, guard)
    cpu = time.process_time() - start
    return done.in_time(), cpu


# --- references ----------------------------------------------------------------------------------


def _cell_work(loaded: LoadedDeck, model: str, budget: Budget, allowed: float, must: bool = False) -> _Work:
    """Build one cell and compute its reference within `allowed` seconds; if it must, one at any price."""
    scene = build(loaded, model)
    cell = Cell(
        model,
        _elements_of(scene),
        scene.system.n,
        "over budget",
        "no time for a reference",
        _degree_of(scene),
    )
    work, end = _Work(cell, scene, None), budget.used + allowed
    for level in LADDER:
        start = budget.used
        first = level == LADDER[0]
        try:
            found, cpu = _agreement(scene, level, budget.guard(np.inf if must and first else end - start))
        except TimeUp:
            break
        better = _note_reference(work, found, cpu)
        expected = _LADDER_GROWTH * (budget.used - start)
        if not better or work.truth is None or work.truth.floor < _ENOUGH or budget.used + expected > end:
            break
    return work


def _note_reference(work: _Work, found: _Truth | HfsimError, cpu: float) -> bool:
    """Keep what was found if it is better than what is there; return whether it is much better."""
    old, spent = work.truth, work.cell.reference_cpu + cpu
    work.cell = replace(work.cell, reference_cpu=spent)
    if isinstance(found, HfsimError):
        if old is None:
            work.cell = replace(work.cell, status="failed", reason=str(found))
        return False
    if old is None or found.floor < old.floor:
        work.truth = found
        work.cell = replace(
            work.cell, status="done", reason="", reference=found.how, floor=found.floor, floors=found.floors
        )
    return old is None or found.floor < old.floor / 3.0


def _agreement(scene: Scene, tolerance: float, guard: Progress) -> tuple[_Truth | HfsimError, float]:
    """Solve by two methods; return the first with its distance to the second, and the CPU time [s]."""
    runs, spent = [], 0.0
    for method, stages, factor in REFERENCES:
        done, cpu = _timed(scene, _solve_of(scene, method, factor * tolerance, False, stages), guard)
        spent += cpu
        if done.stop is not None:
            assert not isinstance(done.stop, KeyboardInterrupt)
            return done.stop, spent
        samples = sample(scene, done.trajectory)
        runs.append((samples, compute_channels(samples)))
    (samples, channels), (_, others) = runs
    scales = judged_scales(samples, channels)
    floors = {
        scale.channel: max(ROUND_OFF, gap(one.values, two.values).largest / scale.scale)
        for scale, one, two in zip(scales, channels, others, strict=True)
    }
    how = (f"{m} ({stages} stages, tolerance {tidy(factor * tolerance)})" for m, stages, factor in REFERENCES)
    return _Truth(channels, scales, floors, " against ".join(how)), spent


def judged_scales(samples: Samples, channels: tuple[Channel, ...]) -> tuple[ChannelScale, ...]:
    """Return what errors in each channel of a reference are divided by, and which of them count."""
    scene = samples.scene
    outlines = {name: body.outline(samples.x) for name, body in scene.bodies.items()}
    # a conserved energy has no range to be measured by; the energy drift tells of it
    return channel_scales(channels, outlines, conserved=not scene.system.exchanges_power)


def tidy(number: float) -> str:
    """Return a number with one digit.

    Examples
    --------
    >>> tidy(1e-7), tidy(3.2e-11)
    ('1e-7', '3e-11')
    """
    return f"{number:.0e}".replace("e-0", "e-").replace("e+0", "e+")


def _finer_truths(
    loaded: LoadedDeck, sweep: Sweep, works: Sequence[_Work], budget: Budget, allowed: float
) -> None:
    """Give the cells of each model a mesh-converged reference, on `Sweep.fine_mesh` if time allows."""
    for i, model in enumerate(sweep.models):
        mine = [w for w in works if w.cell.model == model and w.truth is not None]
        if len(mine) < 2:
            continue
        share = allowed / (len(sweep.models) - i)
        start = budget.used
        fine = _cell_work(with_mesh(loaded, *sweep.fine_mesh), model, budget, share)
        allowed -= budget.used - start
        fine = fine if fine.truth is not None else max(mine, key=lambda w: w.cell.unknowns)
        _split(sorted(mine, key=lambda w: (w.cell.degree, w.cell.elements)), fine)


def _split(works: Sequence[_Work], fine: _Work) -> None:
    """Note the mesh error of each cell and the order by which it falls."""
    assert fine.truth is not None
    for work in works:
        assert work.truth is not None
        if work is fine:
            continue
        work.fine = fine.truth
        found = _channel_errors(work.truth.channels, fine.truth)
        errors = {e.channel: e.max_relative for e in found if e.judged}
        worst, largest = farthest(errors)
        work.cell = replace(
            work.cell, mesh_error=largest, mesh_channel=worst, mesh_errors=errors,
            mesh_reference=fine.cell.elements, mesh_reference_degree=fine.cell.degree,
        )  # fmt: skip
    for coarse, finer in pairwise(works):
        finer.cell = replace(finer.cell, mesh_order=observed_order(coarse.cell, finer.cell))


def _true_model(models: Collection[str]) -> str:
    """Return the model that the others are held against; exact and ancf are the same up to coordinates."""
    return next((name for name in ("exact", "ancf") if name in models), "")


def _compare_models(works: Sequence[_Work]) -> None:
    """Note how far each model is from the exact one; nothing with a single model."""
    models = {w.cell.model for w in works}
    yardsticks = {
        (w.cell.elements, w.cell.degree): w for w in works if w.cell.model == _true_model(models) and w.truth
    }
    for work in works if len(models) > 1 else ():
        yardstick = yardsticks.get((work.cell.elements, work.cell.degree))
        if yardstick is None or yardstick.truth is None:
            continue
        work.exact = yardstick.fine or yardstick.truth
        if work is yardstick or work.truth is None:
            continue
        found = _channel_errors(work.truth.channels, yardstick.truth)
        worst, largest = farthest({e.channel: e.max_relative for e in found if e.judged})
        work.cell = replace(work.cell, model_error=largest, model_channel=worst)


def observed_order(coarse: Cell, fine: Cell, channel: str | None = None) -> float | None:
    """Return the order by which the mesh error fell from one mesh to a finer one; None if not known.

    Of one channel, or of the worst one.

    Examples
    --------
    >>> coarse, fine = (Cell("exact", n, 4 * n, "done", mesh_error=e) for n, e in ((2, 0.16), (4, 0.01)))
    >>> observed_order(coarse, fine)
    4.0
    """
    if coarse.degree != fine.degree:
        return None
    if channel is None:
        before, after = coarse.mesh_error, fine.mesh_error
    else:
        before, after = coarse.mesh_errors.get(channel), fine.mesh_errors.get(channel)
    if not before or not after:
        return None
    return float(np.log(before / after) / np.log(fine.elements / coarse.elements))


# --- points --------------------------------------------------------------------------------------


@dataclass
class _Series:
    """All levels of one method in one cell, and what the next one is expected to cost in wall time [s].

    Attributes
    ----------
    work : _Work
    method : str
    levels : list of float
        Those still to run.
    costs : list of float
        Wall times of those that ran [s].
    forecast : float or None
        Wall time of the next one as its trial showed [s], with `trial` in words.
    """

    work: _Work
    method: str
    levels: list[float]
    costs: list[float] = field(default_factory=list)
    forecast: float | None = None
    trial: str = ""

    @property
    def expected(self) -> float:
        if self.forecast is not None:
            return self.forecast
        if not self.costs:
            return 0.0
        growth = self.costs[-1] / max(self.costs[-2], 1e-9) if len(self.costs) > 1 else _FIRST_GROWTH
        return self.costs[-1] * float(np.clip(growth, 1.1, 10.0))


def _warm_up(works: Sequence[_Work], sweep: Sweep, budget: Budget) -> None:
    """Let every method make its first steps untimed."""
    scene = next((w.scene for w in works if w.truth is not None), None)
    if scene is None:
        return
    short = {"duration": _WARM_UP * scene.deck.solve.duration}
    for method in sweep.methods:
        solve = _solve_of(scene, method, max(sweep.tolerances), fixed=False)
        try:
            _timed(scene, solve.model_copy(update=short), budget.guard(0.1 * budget.left))
        except TimeUp:
            continue


def _run_points(works: Sequence[_Work], sweep: Sweep, budget: Budget, points: list[Point]) -> None:
    """Run the cheapest waiting point until all are done or the budget is; append to `points`."""
    waiting = [_Series(w, method, list(sweep.levels)) for w in works for method in sweep.methods]
    try:
        while waiting:
            series = min(waiting, key=lambda s: s.expected)
            if series.work.cell.status == "over budget":
                points += _given_up(series, sweep, series.work.cell.reason)
            elif budget.left <= series.expected:
                points += _given_up(series, sweep, f"about {series.expected:.2g} s expected")
            else:
                points += _next_point(series, sweep, budget)
            waiting = [s for s in waiting if s.levels]
    except KeyboardInterrupt:
        for series in waiting:
            points += _given_up(series, sweep, "interrupted")
        raise


def _blank(series: _Series, level: float, sweep: Sweep) -> Point:
    cell, fixed = series.work.cell, bool(sweep.steps)
    tolerance, step = (None, level) if fixed else (level, None)
    return Point(cell.model, cell.elements, series.method, tolerance, step, degree=cell.degree)


def _given_up(series: _Series, sweep: Sweep, reason: str) -> list[Point]:
    """Return what is left of a series: skipped, or over budget where a trial was cut off."""
    left = [replace(_blank(series, level, sweep), reason=reason) for level in series.levels]
    if series.trial and left:
        left[0] = replace(left[0], status="over budget", reason=f"{series.trial}; {reason}")
    series.levels.clear()
    return left


def _next_point(series: _Series, sweep: Sweep, budget: Budget) -> list[Point]:
    """Run the next level of a series, repeatedly if it is short; return nothing if it was put back."""
    point, work = _blank(series, series.levels[0], sweep), series.work
    solve = _solve_of(work.scene, series.method, series.levels[0], bool(sweep.steps))
    unknown = not series.costs and series.forecast is None
    start = budget.used
    try:
        allowed = min(_TRIAL_SHARE * budget.seconds, budget.left) if unknown else budget.left
        done, cpu = _timed(work.scene, solve, budget.guard(allowed))
    except TimeUp as stop:
        spent = budget.used - start
        series.trial = f"{stop} after {spent:.2g} s"
        series.forecast = max(spent / max(stop.share, 1e-6), 1.5 * spent)
        return []
    series.costs.append(budget.used - start)
    series.levels.pop(0)
    series.forecast, series.trial = None, ""
    times = [cpu, *_repeated(work.scene, solve, sweep, budget, cpu)] if done.stop is None else [cpu]
    point = replace(
        point, cpu=float(np.median(times)), cpu_min=min(times), cpu_max=max(times), repeats=len(times),
        **_counts(done),
    )  # fmt: skip
    return [_judged(point, done, work)]


def _repeated(scene: Scene, solve: SolveSpec, sweep: Sweep, budget: Budget, cpu: float) -> list[float]:
    times: list[float] = []
    while len(times) < sweep.repeats - 1 and (len(times) + 1) * cpu < _REPEAT_SHARE * budget.seconds:
        try:
            times.append(_timed(scene, solve, budget.guard(budget.left))[1])
        except TimeUp:
            break
    return times


def _counts(done: Integration) -> dict[str, Any]:
    counts = done.problem.counts
    return {
        "steps": counts.steps,
        "rejected": counts.rejected,
        "newton_iterations": counts.iterations,
        "evaluations": counts.evaluations,
        "factorisations": counts.factorisations,
    }


def _judged(point: Point, done: Integration, work: _Work) -> Point:
    """Return the point with its status and, if it reached the end, its errors."""
    if done.stop is not None:
        assert not isinstance(done.stop, KeyboardInterrupt)
        status = "limit" if done.stop.exit_code == 5 else "failed"
        return replace(point, status=status, reason=f"{done.stop} (t = {done.trajectory.t_end:.4g} s)")
    drift = float(balance(work.scene.system, step_samples(done.trajectory))["energy_drift"])
    if work.truth is None:
        return replace(point, status="done", energy_drift=drift, reason="there is no reference")
    channels = compute_channels(sample(work.scene, done.trajectory))
    if not all(np.isfinite(channel.values).all() for channel in channels):
        return replace(point, status="failed", reason="the result is not finite")
    errors = _channel_errors(channels, work.truth)
    total, exact = (None if one is None else _largest_error(channels, one) for one in (work.fine, work.exact))
    judged = [e for e in errors if e.judged]
    worst = max(judged, key=lambda e: e.max_relative, default=None)
    return replace(
        point, status="done", energy_drift=drift, channels=errors, total_error=total,
        exact_error=exact, **(_worst(worst, judged, work.truth.floor) if worst else {}),
    )  # fmt: skip


def _largest_error(channels: Sequence[Channel], truth: _Truth) -> float:
    errors = (e.max_relative for e in _channel_errors(channels, truth) if e.judged)
    return max(errors, default=truth.floor)


def _worst(worst: ChannelError, judged: Sequence[ChannelError], floor: float) -> dict[str, Any]:
    return {
        "error": max(worst.max_relative, floor),
        "rms_error": max(floor, *(e.rms_relative for e in judged)),
        "worst_channel": worst.channel,
        "below_floor": worst.max_relative <= floor,
    }


def _channel_errors(channels: Sequence[Channel], truth: _Truth) -> tuple[ChannelError, ...]:
    together = zip(channels, truth.channels, truth.scales, strict=True)
    return tuple(channel_error(c.values, t.values, s, truth.floors[s.channel]) for c, t, s in together)


def channel_error(values: Array, truth: Array, scale: ChannelScale, floor: float) -> ChannelError:
    """Return the error of one channel; nothing below the floor is a number.

    Parameters
    ----------
    values, truth : ndarray, shape (n_times,)
        In the unit of the channel.
    scale : ChannelScale
    floor : float
        Error of `truth` over the scale [-].
    """
    found = gap(values, truth)
    largest, rms = found.largest / scale.scale, found.rms / scale.scale
    return ChannelError(
        channel=scale.channel,
        unit=scale.unit,
        max_abs=max(largest, floor) * scale.scale,
        max_relative=max(largest, floor),
        rms_relative=max(rms, floor),
        below_floor=largest <= floor,
        judged=scale.judged,
    )


# --- what follows from the points ----------------------------------------------------------------


def pareto(points: Sequence[Point], total: bool = False) -> list[Point]:
    """Return the points whose error no cheaper one comes near (within a fifth), cheapest first.

    The error is that in time or, if asked for, the total one.
    """
    judged = [(p.cpu, p.total_error if total else p.error, p) for p in points]
    known = [(cpu, error, p) for cpu, error, p in judged if cpu is not None and error is not None]
    front: list[Point] = []
    least = np.inf
    for _, error, point in sorted(known, key=lambda item: item[:2]):
        if error < _BETTER * least:
            front.append(point)
            least = error
    return front


def recommend(points: Sequence[Point], target: float) -> Point | None:
    """Return the cheapest point whose error is at most `target` [-]; None if there is none.

    An error below the floor counts as the floor; where the error of the mesh is known, it counts too.
    """
    known = [(p.cpu, p.judged_error, p) for p in points if p.cpu is not None]
    good = [(cpu, p) for cpu, error, p in known if error is not None and error <= target]
    return min(good, key=lambda item: item[0])[1] if good else None


def advice(points: Sequence[Point], words: str, target: float, meshes: bool = False) -> str:
    """Return the recommendation for one target in a sentence."""
    best = recommend(points, target)
    if best is not None:
        return f"for {words}: {_setting(best, meshes)}: {best.cpu:.2g} s"
    known = [(p.judged_error, p) for p in points if p.judged_error is not None]
    if not known:
        return f"for {words}: nothing was measured"
    error, most = min(known, key=lambda item: item[0])
    why = "the reference is not known better" if most.below_floor else "nothing tried reaches it"
    return f"for {words}: {why}; best {error:.1e} with {_setting(most, meshes)}: {most.cpu:.2g} s"


def model_advice(points: Sequence[Point], words: str, target: float, meshes: bool = False) -> str:
    """Return in a sentence the cheapest model for one target, beside the exact one.

    Parameters
    ----------
    points : sequence of Point
        With the error against the exact model as their total one.
    words : str
        The target in words.
    target : float
    meshes : bool
        Whether meshes are to be named.
    """
    true = _true_model({p.model for p in points})
    best, plain = recommend(points, target), recommend([p for p in points if p.model == true], target)
    if best is None:
        return f"for {words} of {true}: no model that was tried reaches it"
    setting = f"{_setting(best, meshes)}: {best.cpu:.2g} s"
    if best.model == true:
        rest = sorted({p.model for p in points if recommend([p], target)} - {true})
        also = f" ({', '.join(rest)} would do too)" if rest else ", no other model suffices"
        return f"for {words} of {true}: {true}{also}: {setting}"
    beside = f"; {true}: {plain.cpu:.2g} s" if plain else ""
    return f"for {words} of {true}: {best.model} suffices: {setting}{beside}"


def _setting(point: Point, meshes: bool) -> str:
    mesh = f"{point.mesh}, " if meshes else ""
    return f"{mesh}{point.method}, {point.level}"


def bench(loaded: LoadedDeck, sweep: Sweep, budget: Budget) -> Bench:
    """Measure error and CPU time of every point of a sweep, within a budget.

    Parameters
    ----------
    loaded : LoadedDeck
    sweep : Sweep
    budget : Budget
        The first reference is made even if it takes longer.

    Returns
    -------
    Bench
        Failures are data; what was not run is told as skipped, what was cut off as over budget.

    Raises
    ------
    DeckError
        If the scene cannot be assembled with one of the models or meshes.
    """
    works: list[_Work] = []
    points: list[Point] = []
    status = "done"
    try:
        _references(loaded, sweep, works, budget)
        _warm_up(works, sweep, budget)
        _run_points(works, sweep, budget, points)
    except KeyboardInterrupt:
        status = "interrupted"
    if status == "done" and not any(w.truth for w in works):
        status = "failed"
    return Bench(
        name=loaded.deck.name,
        status=status,
        duration=loaded.deck.solve.duration,
        budget=budget.seconds,
        used=budget.used,
        cells=tuple(work.cell for work in works),
        points=_in_order(points, sweep),
    )


def _references(loaded: LoadedDeck, sweep: Sweep, works: list[_Work], budget: Budget) -> None:
    """Compute the references of all cells and, with several meshes, the mesh-converged ones."""
    meshes = len(sweep.meshes) > 1
    share = _REFERENCE_SHARE * budget.left
    in_time = (_IN_TIME_SHARE if meshes else 1.0) * share
    wanted = [(model, mesh) for model in sweep.models for mesh in sweep.meshes]
    for i, (model, mesh) in enumerate(wanted):
        start = budget.used
        allowed = in_time / (len(wanted) - i)
        works.append(_cell_work(with_mesh(loaded, *mesh), model, budget, allowed, must=i == 0))
        in_time -= budget.used - start
    if meshes:
        _finer_truths(loaded, sweep, works, budget, (1.0 - _IN_TIME_SHARE) * share)
    _compare_models(works)


def _in_order(points: Sequence[Point], sweep: Sweep) -> tuple[Point, ...]:
    def place(p: Point) -> tuple[int, int, int, int, float]:
        level = p.step if p.step is not None else p.tolerance or 0.0
        return sweep.models.index(p.model), p.degree, p.elements, sweep.methods.index(p.method), -level

    return tuple(sorted(points, key=place))


# --- tables --------------------------------------------------------------------------------------

_POINT_COLUMNS = (
    "model", "elements", "degree", "method", "tolerance", "step", "status", "reason", "cpu", "cpu_min",
    "cpu_max", "repeats", "steps", "rejected", "newton_iterations", "evaluations", "factorisations",
    "energy_drift", "error", "rms_error", "worst_channel", "below_floor", "total_error", "exact_error",
)  # fmt: skip
_CELL_COLUMNS = ("unknowns", "mesh_error", "model_error", "floor")
_CHANNEL_COLUMNS = ("unit", "max_abs", "max_relative", "rms_relative", "below_floor", "judged")

CSV_COLUMNS = (
    *_POINT_COLUMNS, *_CELL_COLUMNS,
    "channel", *(f"channel_{name}" for name in _CHANNEL_COLUMNS), "channel_floor", "channel_mesh_error",
)  # fmt: skip
"""Columns of ``bench.csv``."""


def as_rows(result: Bench) -> list[dict[str, object]]:
    """Return one row for each point and channel, with the keys `CSV_COLUMNS`; one for a point without any."""
    rows: list[dict[str, object]] = []
    for cell in result.cells:
        for point in result.points_of(cell):
            facts = {name: getattr(point, name) for name in _POINT_COLUMNS}
            facts |= {
                name: getattr(cell, name) for name in ("unknowns", "mesh_error", "model_error", "floor")
            }
            for error in point.channels:
                mine = {f"channel_{name}": getattr(error, name) for name in _CHANNEL_COLUMNS}
                mine |= {"channel": error.channel, "channel_floor": cell.floors[error.channel]}
                mine["channel_mesh_error"] = cell.mesh_errors.get(error.channel)
                rows.append({**facts, **mine})
            if not point.channels:
                rows.append(facts)
    return rows


def as_facts(result: Bench) -> dict[str, Any]:
    """Return the study as JSON-ready facts (``bench.json``)."""
    facts = asdict(result)
    facts["pareto"] = [
        [{"method": p.method, "tolerance": p.tolerance, "step": p.step} for p in pareto(result.points_of(c))]
        for c in result.cells
    ]
    return {**facts, "recommendations": result.recommendations}
