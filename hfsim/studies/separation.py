"""What matrix separation saves: the forms of one elastic force, timed side by side (the paper's Table 1).

Every form of `hfsim.elements.separation` computes the same numbers.  For each element and each number of
elements they are timed in turns, per evaluation and for a whole run: the soft beam of the paper's section
7.1, pinned at its root, integrated by central differences with the same fixed steps.  What a step costs
besides the elastic force is kept small (a banded mass matrix factorised once), so that the force dominates.

Nothing is printed or written here.
"""

from __future__ import annotations

import math
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, is_dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hfsim.arrays import Array
from hfsim.elements import ELEMENTS, Inertia, Stiffness
from hfsim.elements.separation import STIFFNESS_FORMS, StiffnessForm
from hfsim.models.mesh import BeamMesh
from hfsim.studies.bench import Budget

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

STEPS = 200
"""Steps of a whole run; each evaluates the force once."""

_HEIGHT = math.sqrt(12.0 * SECOND_MOMENT / AREA)
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
        CPU time of one evaluation of the force, and of force and tangent, for all elements of one state [s].
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
    elements : int
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
    status: str = "skipped"
    reason: str = ""
    repeats: int = 0
    steps: int = 0
    share: float = 0.0
    forms: tuple[FormTimes, ...] = ()


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
            f"{cell.element}, {cell.elements} elements: {form.form} differs from direct by "
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
            f"{form}: at best {100 * ratio:.3g} % of the direct run ({cell.element}, {cell.elements} "
            f"elements; force alone {100 * single:.3g} %); goal {100 * goal:g} %: {missed}"
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
    """A beam in absolute nodal coordinates, pinned at its root, with gravity.

    Attributes
    ----------
    mesh : BeamMesh
    form : StiffnessForm
    """

    mesh: BeamMesh
    form: StiffnessForm

    @property
    def _per_node(self) -> int:
        return 2 * self.mesh.element.per_node

    @cached_property
    def _columns(self) -> NDArray[np.intp]:
        """Coordinates of each element, shape (n_elements, n)."""
        return self._per_node * np.arange(self.mesh.count)[:, None] + np.arange(2 * self._per_node)

    @cached_property
    def _solve(self) -> Callable[[Array], Array]:
        """Solution with the banded mass matrix of one component, root position left out, factorised once."""
        from scipy.linalg.lapack import dpbtrf, dpbtrs

        M, band = self.mesh.mass[1:, 1:], self._per_node
        lower = np.zeros((band, len(M)))
        for k in range(min(band, len(M))):
            lower[k, : len(M) - k] = np.diag(M, -k)
        factor = dpbtrf(lower, lower=1)[0]
        return lambda sides: np.asarray(dpbtrs(factor, sides, lower=1)[0])

    @cached_property
    def _weight(self) -> Array:
        field = np.outer(self.mesh.positions, [0.0, -GRAVITY])
        return np.asarray((self.mesh.mass @ field).reshape(-1, self._per_node))

    def elements(self, x: Array) -> Array:
        """Return the nodal components of each element, shape (n_elements, n)."""
        return x.take(self._columns)

    def acceleration(self, x: Array) -> Array:
        """Return x'', shape (n,)."""
        w, F = self._per_node, self.form.force(self.elements(x))
        f = self._weight.copy()
        f[:-1] -= F[:, :w]
        f[1:] -= F[:, w:]
        a = np.zeros((x.size // 2, 2))
        a[1:] = self._solve(f.reshape(-1, 2)[1:])
        return a.ravel()

    def start(self) -> Array:
        """Return an arc of one radian, shape (n,): a large deformation."""
        angle = np.linspace(0.0, 1.0, self.mesh.count + 1)
        tangent = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        normal = np.stack([-np.sin(angle), np.cos(angle)], axis=-1)
        place = self.mesh.length * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=-1)
        vectors = [place, tangent, normal][: self.mesh.element.per_node]
        return np.stack(vectors, axis=1).ravel()

    def step(self) -> float:
        """Return a step that central differences bear [s]: waves along, bending, of the thickness."""
        le, r = self.mesh.element.length, _HEIGHT / math.sqrt(12.0)
        speed = math.sqrt(MODULUS / DENSITY)
        return 0.5 * min(0.1 * le, 0.05 * le**2 / r, 0.1 * _HEIGHT) / speed

    def run(self) -> Array:
        """Integrate from rest by central differences (Verlet); return all states, shape (STEPS + 1, n)."""
        h, x = self.step(), self.start()
        v = 0.5 * h * self.acceleration(x)
        states = [x]
        for _ in range(STEPS):
            x = x + h * v
            v = v + h * self.acceleration(x)
            states.append(x)
        return np.array(states)


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

    Returns
    -------
    SeparationBench
    """
    wanted = [(kind, count) for count in sorted(elements) for kind in kinds]
    cells: list[Cell] = []
    cost: dict[str, float] = {}
    status = "done"
    try:
        for kind, count in wanted:
            start = budget.used
            expected = cost.get(kind, 0.0)
            if cells and budget.left <= expected:
                reason = f"about {expected:.2g} s expected" if budget.left > 0.0 else "the budget is used up"
                cells.append(Cell(kind, count, reason=reason))
                continue
            cells.append(_cell(kind, count, repeats, budget, forms or STIFFNESS_FORMS))
            cost[kind] = budget.used - start
            budget.report(min(1.0, len(cells) / len(wanted)))
    except KeyboardInterrupt:
        status = "interrupted"
        cells += [Cell(kind, count, reason=status) for kind, count in wanted[len(cells) :]]
    ordered = sorted(cells, key=lambda cell: (kinds.index(cell.element), cell.elements))
    bench = SeparationBench(status, budget.seconds, budget.used, tuple(ordered))
    if status == "done" and bench.disagreements:
        return SeparationBench("wrong", bench.budget, bench.used, bench.cells)
    return bench


def _cell(kind: str, count: int, repeats: int, budget: Budget, forms: dict[str, type[StiffnessForm]]) -> Cell:
    mesh, stiffness = soft_beam(kind, count)
    beams = {name: PinnedBeam(mesh, form.of(mesh.element, stiffness)) for name, form in forms.items()}
    first_beam = next(iter(beams.values()))
    p = first_beam.elements(first_beam.start())
    results = [beam.form.force_and_tangent(p) for beam in beams.values()]
    # the force is a small sum of large terms, whose round-off no form can avoid
    terms = float((np.abs(first_beam.form.stiffness(p)) @ np.abs(p)[..., None]).max())
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
    return Cell(kind, count, "done", "", len(samples[0]), STEPS, share, tuple(rows))


# --- tables --------------------------------------------------------------------------------------

_SPREADS = ("force", "both", "run")
_FORM_COLUMNS = (
    "force_ratio", "both_ratio", "run_ratio", "tables", "peak", "difference", "run_difference"
)  # fmt: skip

CSV_COLUMNS = (
    "element", "elements", "form", "status", "reason", "repeats", "steps", "share",
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
