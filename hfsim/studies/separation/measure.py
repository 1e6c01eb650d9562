"""Timing of the forms of the elastic force, per evaluation and for whole runs.

Every form of `ELASTIC_FORMS` computes the same numbers.  For each element and each number of elements they
are timed in turns: the force, force and tangent, and a whole run of the soft beam of the paper's section 7.1
by explicit fixed steps, which ask for little besides the force.

Nothing is printed or written here.
"""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np

from hfsim.deck.source import refuse_unknown
from hfsim.marching.integration import Integration, run_integration
from hfsim.marching.stop import Budget
from hfsim.maths.arrays import Array
from hfsim.parts.elements import ELASTIC_FORMS, elastic_form
from hfsim.scene.build import Scene
from hfsim.studies.separation._base import StiffnessForm
from hfsim.studies.separation.beams import KINDS, STEPS, Beams
from hfsim.studies.separation.results import Cell, FormTimes, SeparationBench
from hfsim.studies.timing import Spread, clocked, in_turns

USUAL_ELEMENTS, USUAL_STATES = (1, 4, 16, 64, 256), (1, 64)
"""Numbers of elements, and of beams in a batch, where none are named."""
MOST_AT_ONCE = 1024
"""Elements of all beams of a batch together that are measured."""

_SAMPLE = 2e-3
"""Time that one sample of evaluations shall take [s]."""


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
        for name in {field.name for field in fields(thing)} | set(vars(thing)):
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


def _difference(values: Array, truth: Array, scale: float | None) -> float:
    gap = float(np.abs(values - truth).max() / (scale or np.abs(truth).max()))
    return gap if math.isfinite(gap) else math.inf


def _sampled(work: Callable[[], object]) -> Callable[[], float]:
    """Return what times one call of a piece of work, as many calls together as a sample lasts."""
    calls = max(1, math.ceil(_SAMPLE / max(clocked(work), 1e-7)))
    return lambda: clocked(work, calls)


def known_kinds(given: Sequence[str]) -> tuple[str, ...]:
    """Return the kinds of element asked for, all without any; raise `ArgumentError` if one is unknown."""
    refuse_unknown("element", given, KINDS)
    return tuple(given or KINDS)


def measure(
    elements: Sequence[int], kinds: Sequence[str], repeats: int, budget: Budget, states: Sequence[int] = (1,)
) -> SeparationBench:
    """Time every form for each kind of element and number of elements, within a budget.

    Parameters
    ----------
    elements : sequence of int
        Without any `USUAL_ELEMENTS`.
    kinds : sequence of str
        Of `beams.KINDS`.
    repeats : int
        Rounds of timing.
    budget : Budget
        The first cell is measured even if it takes longer; what is left out is told as skipped.
    states : sequence of int
        Beams in a batch, of more than one as many as have `MOST_AT_ONCE` elements together; without any
        `USUAL_STATES`.
    """
    sizes = [
        (count, batch)
        for batch in sorted(states or USUAL_STATES)
        for count in sorted(elements or USUAL_ELEMENTS)
        if batch == 1 or count * batch <= MOST_AT_ONCE
    ]
    wanted = [(kind, *size) for size in sizes for kind in kinds]
    cells: list[Cell] = []
    cost: dict[str, float] = {}
    status = "done"
    try:
        for one in wanted:
            start, expected = budget.used, cost.get(one[0], 0.0)
            if cells and budget.left <= expected:
                reason = f"about {expected:.2g} s expected" if budget.left > 0.0 else "the budget is used up"
                cells.append(Cell(*one, reason=reason))
                continue
            cells.append(_cell(Beams(*one), repeats, budget))
            cost[one[0]] = budget.used - start
            budget.report(min(1.0, len(cells) / len(wanted)))
    except KeyboardInterrupt:
        status = "interrupted"
        cells += [Cell(*one, reason=status) for one in wanted[len(cells) :]]
    cells.sort(key=lambda cell: (kinds.index(cell.element), cell.states, cell.elements))
    bench = SeparationBench(status, budget.seconds, budget.used, tuple(cells))
    if status == "done" and bench.disagreements:
        return SeparationBench("wrong", bench.budget, bench.used, bench.cells)
    return bench


@dataclass(frozen=True)
class _Way:
    """A form at work: on all elements at once, and in a scene.

    Attributes
    ----------
    p : ndarray, shape (n, n_columns)
    """

    form: StiffnessForm
    p: Array
    scene: Scene

    def force(self) -> Array:
        return self.form.force(self.p)

    def both(self) -> tuple[Array, Array]:
        return self.form.force_and_tangent(self.p)

    def run(self) -> Integration:
        done = run_integration(self.scene, self.scene.deck.solve)
        if done.stop is not None:
            raise done.stop
        return done

    def results(self) -> tuple[Array, Array, Array, Array]:
        """Return the force, the same beside the tangent, the tangent and the states after each step."""
        path = self.run().trajectory
        return self.force(), *self.both(), path.at(path.step_ends())[0]


def _cell(beams: Beams, repeats: int, budget: Budget) -> Cell:
    p = beams.components
    one = beams.element, beams.properties, beams.n_dim
    forms = {name: elastic_form(name).of(*one) for name in ELASTIC_FORMS}
    ways = {name: _Way(form, p, beams.scene(name)) for name, form in forms.items()}
    direct, *_ = ways.values()
    results = [way.results() for way in ways.values()]
    # the force is a small sum of large terms, whose round-off no form can avoid
    terms = float((np.abs(direct.form.stiffness(p)) @ np.abs(p.T)[..., None]).max())
    scales = (terms, terms, None, None)
    works = [work for way in ways.values() for work in (way.force, way.both, way.run)]
    samples = in_turns([_sampled(work) for work in works], repeats, budget)
    times = [Spread.of(sample) for sample in samples]
    rows = []
    for k, (name, way) in enumerate(ways.items()):
        force, both, run = times[3 * k : 3 * k + 3]
        *differences, run_difference = map(_difference, results[k], results[0], scales)
        row = FormTimes(
            form=name,
            force=force,
            both=both,
            run=run,
            force_ratio=force.median / times[0].median,
            both_ratio=both.median / times[1].median,
            run_ratio=run.median / times[2].median,
            tables=held_bytes(way.form),
            peak=_peak_bytes(way.both),
            difference=max(differences),
            run_difference=run_difference,
        )
        rows.append(row)
    evaluations = direct.run().problem.counts.evaluations
    share = min(1.0, evaluations * times[0].median / times[2].median)
    size = beams.kind, beams.count, beams.states
    return Cell(*size, "done", "", len(samples[0]), STEPS, share, tuple(rows))
