"""What matrix separation saves: the forms of one elastic force, timed side by side (the paper's Table 1).

Every form of `hfsim.studies.separation_forms` computes the same numbers.  For each element and each number of
elements they are timed in turns, per evaluation and for a whole run: the soft beam of the paper's section
7.1, pinned at its root, integrated by central differences with the same fixed steps.  What a step costs
besides the elastic force is kept small (a mass matrix inverted or factorised once), so that the force
dominates: explicit steps ask for nothing else.  Batches of beams that differ in their starts move at once,
as an ensemble or the stages of a step do.

Nothing is printed or written here.
"""

from __future__ import annotations

import math
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hfsim.maths.arrays import Array
from hfsim.parts.bodies.mesh import BeamMesh
from hfsim.parts.elements import ELEMENTS, Inertia, Stiffness
from hfsim.studies.bench import Budget
from hfsim.studies.separation_forms import STIFFNESS_FORMS, StiffnessForm

AGREEMENT = 1e-11
"""Largest difference from the direct form that counts as round-off, for one element; n elements have n^2
times more, since products of positions, which cancel in rigid motions, are so much larger than the rest."""

PAPER_RATIO = 0.1
"""Consumed time of the separated over the unseparated formulation, Table 1 of the paper."""

GOALS = {"separated": 0.1, "gram": 0.03}
"""Ratios of whole runs, to the direct form, that hfsim aims at."""

LENGTH, MODULUS, DENSITY, AREA, SECOND_MOMENT = 1.2, 7.0e5, 5540.0, 1.8e-3, 1.215e-8
"""The beam of section 7.1 [m, Pa, kg/m^3, m^2, m^4]; Poisson's ratio zero."""

GRAVITY = 9.81
"""[m/s^2]."""

MOST_AT_ONCE = 1024
"""Elements of all beams of a batch together that are measured."""

STEPS = 200
"""Steps of a whole run; each evaluates the force once."""

_HEIGHT = math.sqrt(12.0 * SECOND_MOMENT / AREA)
_FUSED_MASS = 64
"""Vectors up to which one dense product from element forces to a step's change is sooner than adding them up
and solving with a banded factor."""
_SAMPLE = 2e-3
"""Time that one sample of evaluations shall take [s]."""
_DOMINATES = 0.5
"""Share of the direct run above which the elastic force is said to dominate."""


@dataclass(frozen=True)
class Spread:
    """CPU times: median and extremes of the repeats [s]."""

    median: float
    least: float
    most: float

    @classmethod
    def of(cls, times: list[float]) -> Spread:
        """Return the spread of some times."""
        return cls(float(np.median(times)), min(times), max(times))


@dataclass(frozen=True)
class FormTimes:
    """One form with one element kind and number of elements.

    Attributes
    ----------
    form : str
    force, both : Spread
        CPU time of one evaluation of the force, and of force and tangent, for all elements of all states [s].
    run : Spread
        CPU time of the whole run [s].
    force_ratio, both_ratio, run_ratio : float
        Medians over those of the direct form.
    tables, peak : int
        Memory of constant tables, and the most that one evaluation of force and tangent takes besides [byte].
    difference, run_difference : float
        From the direct form: of the force relative to the largest sum of terms |K| |p| that it is the
        difference of, of the tangent and the whole trajectory relative to the largest entry.
    """

    form: str
    force: Spread
    both: Spread
    run: Spread
    force_ratio: float
    both_ratio: float
    run_ratio: float
    tables: int
    peak: int
    difference: float
    run_difference: float

    @property
    def worst_difference(self) -> float:
        """The larger of the two differences."""
        return max(self.difference, self.run_difference)


@dataclass(frozen=True)
class Cell:
    """All forms of one element kind and number of elements.

    Attributes
    ----------
    element : str
    elements, states : int
        Of each beam; of beams in the batch.
    status, reason : str
        ``done`` or ``skipped``; why.
    repeats : int
        Rounds in which every form was timed once.
    steps : int
        Of one run.
    share : float
        Part of the direct run's time that is spent in the elastic force.
    forms : tuple of FormTimes
    """

    element: str
    elements: int
    states: int = 1
    status: str = "skipped"
    reason: str = ""
    repeats: int = 0
    steps: int = 0
    share: float = 0.0
    forms: tuple[FormTimes, ...] = ()

    @property
    def size(self) -> str:
        """Elements and states in words."""
        beams = f" of each of {self.states} beams" if self.states > 1 else ""
        return f"{self.elements} elements{beams}"


@dataclass(frozen=True)
class SeparationBench:
    """Everything that was measured.

    Attributes
    ----------
    status : str
        ``done``, ``wrong`` (forms disagree) or ``interrupted``.
    budget, used : float
        Wall time allowed and used [s].
    cells : tuple of Cell
    """

    status: str
    budget: float
    used: float
    cells: tuple[Cell, ...]

    @property
    def disagreements(self) -> list[str]:
        """A sentence for each form that differs from the direct one by more than round-off."""
        return [
            f"{cell.element}, {cell.size}: {form.form} differs from direct by "
            f"{form.worst_difference:.1e}, more than round-off ({AGREEMENT * cell.elements**2:.0e})"
            for cell in self.cells
            for form in cell.forms
            if form.worst_difference > AGREEMENT * cell.elements**2
        ]

    def best(self, form: str) -> tuple[float, Cell] | None:
        """Return the smallest ratio of whole runs of a form where the elastic force dominates."""
        known = [
            (f.run_ratio, i)
            for i, cell in enumerate(self.cells)
            for f in cell.forms
            if f.form == form and cell.share >= _DOMINATES
        ]
        if not known:
            return None
        ratio, at = min(known)
        return ratio, self.cells[at]

    @property
    def verdicts(self) -> list[str]:
        """A sentence for each of `GOALS`."""
        return [self._verdict(form, goal) for form, goal in GOALS.items()]

    def _verdict(self, form: str, goal: float) -> str:
        best = self.best(form)
        if best is None:
            return f"{form}: the elastic force dominates no run that was measured"
        ratio, cell = best
        single = next(f.force_ratio for f in cell.forms if f.form == form)
        missed = "reached" if ratio <= goal else f"missed by a factor of {ratio / goal:.2g}"
        return (
            f"{form}: at best {100 * ratio:.3g} % of the direct run ({cell.element}, {cell.size}; "
            f"force alone {100 * single:.3g} %); goal {100 * goal:g} %: {missed}"
        )


# --- the run -------------------------------------------------------------------------------------


def soft_beam(element: str, count: int) -> tuple[BeamMesh, Stiffness]:
    """Return the beam of section 7.1 in so many elements."""
    mesh = BeamMesh(ELEMENTS[element](LENGTH / count), count, Inertia(DENSITY * AREA, 0.0, _HEIGHT))
    stiffness = Stiffness(
        axial=MODULUS * AREA,
        bending=MODULUS * SECOND_MOMENT,
        lame_lambda=0.0,
        lame_mu=0.5 * MODULUS,
        height=_HEIGHT,
        width=AREA / _HEIGHT,
    )
    return mesh, stiffness


@dataclass(frozen=True)
class PinnedBeam:
    """Beams in absolute nodal coordinates, pinned at their roots, with gravity; several in one batch.

    States have the shape (n_dim, n_per_node, n_nodes, n_states): the vectors of all elements are then two
    views, of their first and of their last nodes, and forces are added to two views.

    Attributes
    ----------
    mesh : BeamMesh
    form : StiffnessForm
    states : int
        Beams of equal data that move at the same time, each from a start of its own.
    """

    mesh: BeamMesh
    form: StiffnessForm
    states: int = 1

    @property
    def _shape(self) -> tuple[int, int, int, int]:
        return 2, self.mesh.element.per_node, self.mesh.count + 1, self.states

    @cached_property
    def _mass(self) -> Array:
        """Mass matrix of one component, node by node, with the root position held."""
        M = self.mesh.mass.copy()
        M[0], M[:, 0], M[0, 0] = 0.0, 0.0, 1.0
        return M

    @cached_property
    def _factor(self) -> Array:
        from scipy.linalg.lapack import dpbtrf

        M, band = self._mass, 2 * self._shape[1]
        lower = np.zeros((band, len(M)))
        for k in range(band):
            lower[k, : len(M) - k] = np.diag(M, -k)
        return np.asarray(dpbtrf(lower, lower=1)[0])

    def _solve(self, f: Array) -> Array:
        """Return the accelerations that forces cause, by the banded factor of the mass matrix."""
        from scipy.linalg.lapack import dpbtrs

        # LAPACK wants each right-hand side in one piece, node by node
        turned = (0, 3, 2, 1)
        sides = f.transpose(turned)
        found = dpbtrs(self._factor, sides.reshape(2 * self.states, -1).T, lower=1, overwrite_b=1)[0]
        return np.asarray(found.T.reshape(sides.shape).transpose(turned))

    @cached_property
    def _weight(self) -> Array:
        field = np.outer([0.0, -GRAVITY], self.mesh.mass @ self.mesh.positions)
        by_node = field.reshape(2, -1, self._shape[1]).swapaxes(1, 2)
        return np.repeat(by_node[..., None], self.states, axis=-1)

    def elements(self, x: Array) -> Array:
        """Return the nodal components of the elements in columns, shape (n, n_elements * n_states)."""
        nodes = x.swapaxes(0, 1)
        both = np.concatenate([nodes[:, :, :-1], nodes[:, :, 1:]])
        return both.reshape(2 * len(both), -1)

    def acceleration(self, x: Array) -> Array:
        """Return x'', same shape as x."""
        F = self.form.force(self.elements(x)).reshape(2, x.shape[1], 2, -1, self.states)
        f = self._weight.copy()
        nodes = f.swapaxes(0, 1)
        nodes[:, :, :-1] -= F[0]
        nodes[:, :, 1:] -= F[1]
        f[:, 0, 0] = 0.0
        return self._solve(f)

    def start(self) -> Array:
        """Return arcs, large deformations: the first of one radian, the others up to half as much more."""
        along = np.linspace(0.0, 1.0, self.mesh.count + 1)[:, None]
        bend = np.linspace(1.0, 1.5, self.states) if self.states > 1 else np.ones(1)
        angle = along * bend
        tangent = np.stack([np.cos(angle), np.sin(angle)])
        normal = np.stack([-np.sin(angle), np.cos(angle)])
        place = self.mesh.length / bend * np.stack([np.sin(angle), 1.0 - np.cos(angle)])
        return np.stack([place, tangent, normal][: self._shape[1]], axis=1)

    def step(self) -> float:
        """Return a step that central differences bear [s]: waves along, bending, of the thickness."""
        le, r = self.mesh.element.length, _HEIGHT / math.sqrt(12.0)
        speed = math.sqrt(MODULUS / DENSITY)
        return 0.5 * min(0.1 * le, 0.05 * le**2 / r, 0.1 * _HEIGHT) / speed

    @cached_property
    def _moves(self) -> tuple[NDArray[np.intp], Array, Array]:
        """Coordinates of all elements, and what their forces and the weight change in the move of a step."""
        size = self._shape[0] * self._shape[1] * self._shape[2]
        square, alone = self.step() ** 2, replace(self, states=1)
        at = alone.elements(np.arange(float(size)).reshape(alone._shape)).astype(np.intp).ravel()
        units = np.eye(size).reshape(*alone._shape[:-1], size)
        many = replace(self, states=size)
        units[:, 0, 0] = 0.0
        inverse = many._solve(units).reshape(size, size)
        weight = inverse @ alone._weight.reshape(size, 1)
        return at, -square * inverse[:, at], square * weight

    @cached_property
    def _change(self) -> Callable[[Array], Array]:
        """The function from x to h^2 x''."""
        if len(self._mass) > _FUSED_MASS:
            square = self.step() ** 2

            def change(x: Array) -> Array:
                a = self.acceleration(x)
                a *= square
                return a

            return change
        at, by_force, by_weight = self._moves
        n = 4 * self._shape[1]

        def fused(x: Array) -> Array:
            p = x.reshape(-1, self.states).take(at, axis=0).reshape(n, -1)
            moved = by_force.dot(self.form.force(p).reshape(-1, self.states))
            moved += by_weight
            return np.asarray(moved).reshape(x.shape)

        return fused

    def run(self) -> Array:
        """Integrate from rest by central differences (Verlet); return all states, STEPS + 1 of them."""
        x, change = self.start(), self._change
        move = 0.5 * change(x)
        states = np.empty((STEPS + 1, *x.shape))
        states[0] = x
        for k in range(STEPS):
            x = np.add(x, move, out=states[k + 1])
            move += change(x)
        return states


# --- measuring -----------------------------------------------------------------------------------


def held_bytes(thing: Any) -> int:
    """Return the memory of all arrays that a form holds, those made at first use included [byte]."""
    arrays: dict[int, int] = {}
    _collect_arrays(thing, arrays)
    return sum(arrays.values())


def _collect_arrays(thing: Any, arrays: dict[int, int]) -> None:
    if isinstance(thing, np.ndarray):
        owner = thing if thing.base is None else thing.base
        arrays[id(owner)] = getattr(owner, "nbytes", thing.nbytes)
    elif is_dataclass(thing):
        names = {field.name for field in fields(thing)} | set(vars(thing))
        for name in names:
            _collect_arrays(getattr(thing, name), arrays)


def _peak_bytes(work: Callable[[], object]) -> int:
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        work()
        return tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()


def _difference(values: Array, truth: Array, scale: float | None = None) -> float:
    gap = float(np.abs(values - truth).max() / (scale or np.abs(truth).max()))
    return gap if math.isfinite(gap) else math.inf


def _clocked(work: Callable[[], object], calls: int = 1) -> float:
    """Return the CPU time of one call [s]."""
    start = time.process_time()
    for _ in range(calls):
        work()
    return (time.process_time() - start) / calls


def _in_turns(works: list[Callable[[], object]], repeats: int, budget: Budget) -> list[list[float]]:
    """Time pieces of work in turns, so that whatever else the machine does falls on all of them.

    At least one round is made; no other one that would overdraw the budget.
    """
    calls = [max(1, math.ceil(_SAMPLE / max(_clocked(work), 1e-7))) for work in works]
    times: list[list[float]] = [[] for _ in works]
    for done in range(repeats):
        start = budget.used
        for mine, work, count in zip(times, works, calls, strict=True):
            mine.append(_clocked(work, count))
        if budget.left < budget.used - start and done + 1 < repeats:
            break
    return times


def measure(
    elements: tuple[int, ...],
    kinds: tuple[str, ...],
    repeats: int,
    budget: Budget,
    forms: dict[str, type[StiffnessForm]] | None = None,
    states: tuple[int, ...] = (1,),
) -> SeparationBench:
    """Time every form for each kind of element and number of elements, within a budget.

    Parameters
    ----------
    elements : tuple of int
    kinds : tuple of str
        Of `ELEMENTS`.
    repeats : int
        Rounds of timing.
    budget : Budget
        The first cell is measured even if it takes longer; what is left out is told as skipped.
    forms : dict, optional
        Instead of `STIFFNESS_FORMS`; the first one is what the others are compared with.
    states : tuple of int
        Beams in a batch; of more than one as many as have `MOST_AT_ONCE` elements together.

    Returns
    -------
    SeparationBench
    """
    sizes = [
        (count, batch)
        for batch in sorted(states)
        for count in sorted(elements)
        if batch == 1 or count * batch <= MOST_AT_ONCE
    ]
    wanted = [(kind, *size) for size in sizes for kind in kinds]
    cells: list[Cell] = []
    cost: dict[str, float] = {}
    status = "done"
    try:
        for kind, count, batch in wanted:
            start = budget.used
            expected = cost.get(kind, 0.0)
            if cells and budget.left <= expected:
                reason = f"about {expected:.2g} s expected" if budget.left > 0.0 else "the budget is used up"
                cells.append(Cell(kind, count, batch, reason=reason))
                continue
            cells.append(_cell((kind, count, batch), repeats, budget, forms or STIFFNESS_FORMS))
            cost[kind] = budget.used - start
            budget.report(min(1.0, len(cells) / len(wanted)))
    except KeyboardInterrupt:
        status = "interrupted"
        cells += [Cell(*one, reason=status) for one in wanted[len(cells) :]]
    ordered = sorted(cells, key=lambda cell: (kinds.index(cell.element), cell.states, cell.elements))
    bench = SeparationBench(status, budget.seconds, budget.used, tuple(ordered))
    if status == "done" and bench.disagreements:
        return SeparationBench("wrong", bench.budget, bench.used, bench.cells)
    return bench


def _cell(
    size: tuple[str, int, int], repeats: int, budget: Budget, forms: dict[str, type[StiffnessForm]]
) -> Cell:
    kind, count, states = size
    mesh, stiffness = soft_beam(kind, count)
    beams = {name: PinnedBeam(mesh, form.of(mesh.element, stiffness), states) for name, form in forms.items()}
    first_beam = next(iter(beams.values()))
    p = first_beam.elements(first_beam.start())
    results = [beam.form.force_and_tangent(p) for beam in beams.values()]
    # the force is a small sum of large terms, whose round-off no form can avoid
    terms = float((np.abs(first_beam.form.stiffness(p)) @ np.abs(p.T)[..., None]).max())
    runs = [beam.run() for beam in beams.values()]
    works: list[Callable[[], object]] = []
    for beam in beams.values():
        works += [partial(beam.form.force, p), partial(beam.form.force_and_tangent, p), beam.run]
    samples = _in_turns(works, repeats, budget)
    times = [Spread.of(sample) for sample in samples]
    first = times[:3]
    rows = []
    for k, (name, beam) in enumerate(beams.items()):
        force, both, run = times[3 * k : 3 * k + 3]
        rows.append(
            FormTimes(
                form=name,
                force=force,
                both=both,
                run=run,
                force_ratio=force.median / first[0].median,
                both_ratio=both.median / first[1].median,
                run_ratio=run.median / first[2].median,
                tables=held_bytes(beam.form),
                peak=_peak_bytes(partial(beam.form.force_and_tangent, p)),
                difference=max(
                    _difference(results[k][0], results[0][0], terms),
                    _difference(results[k][1], results[0][1]),
                ),
                run_difference=_difference(runs[k], runs[0]),
            )
        )
    share = min(1.0, (STEPS + 1) * first[0].median / first[2].median)
    return Cell(*size, "done", "", len(samples[0]), STEPS, share, tuple(rows))


# --- tables --------------------------------------------------------------------------------------

_SPREADS = ("force", "both", "run")
_FORM_COLUMNS = (
    "force_ratio", "both_ratio", "run_ratio", "tables", "peak", "difference", "run_difference"
)  # fmt: skip

CSV_COLUMNS = (
    "element", "elements", "states", "form", "status", "reason", "repeats", "steps", "share",
    *(f"{name}_{part}" for name in _SPREADS for part in ("median", "least", "most")), *_FORM_COLUMNS,
)  # fmt: skip
"""Columns of ``bench.csv``."""


def as_rows(result: SeparationBench) -> list[dict[str, object]]:
    """Return one row for each cell and form, with the keys `CSV_COLUMNS`; one for a cell without any."""
    rows: list[dict[str, object]] = []
    for cell in result.cells:
        facts = {name: value for name, value in asdict(cell).items() if name != "forms"}
        rows += [{**facts, **_form_row(form)} for form in cell.forms] or [facts]
    return rows


def _form_row(form: FormTimes) -> dict[str, object]:
    row: dict[str, object] = {"form": form.form, **{name: getattr(form, name) for name in _FORM_COLUMNS}}
    for name in _SPREADS:
        row |= {f"{name}_{part}": value for part, value in asdict(getattr(form, name)).items()}
    return row


def as_facts(result: SeparationBench) -> dict[str, Any]:
    """Return the study as JSON-ready facts (``bench.json``)."""
    best = {form: found[0] if (found := result.best(form)) else None for form in GOALS}
    return {
        **asdict(result),
        "paper_ratio": PAPER_RATIO,
        "goals": GOALS,
        "best": best,
        "verdicts": result.verdicts,
        "disagreements": result.disagreements,
    }
