"""References that points of a map are held against: solved tightly and, where points depend on it, twice.

Whether the scene itself is unstable is asked of `exact`: it is solved again with a start disturbed by next
to nothing, and the distance of the two solutions tells (`hfsim.trust.growth`).

How well a reference is known is asked where a point is not near it: a second solution, of another method or
at least another tolerance, tells how far off it is, and where that is not well enough, two methods ever
tighter as in `hfsim bench` (`hfsim.studies.agreement`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import dropwhile, islice

from hfsim.errors import DeckError, HfsimError
from hfsim.marching.distance import reference_scales
from hfsim.marching.integration import Integration, run_integration
from hfsim.marching.sampling import compute_channels, sample
from hfsim.marching.stop import Budget, TimeUp
from hfsim.scene.build import Scene, build
from hfsim.scene.loading import parse_deck
from hfsim.scene.schema import SolveSpec
from hfsim.studies.agreement import LADDER, agreements, floors_of, way_in_words
from hfsim.studies.stability.trials import Job, all_finite, why_stopped
from hfsim.studies.stability.verdict import REFUSED, Truth
from hfsim.trust.growth import disturbed_growth
from hfsim.trust.suspicion import instability

_STAGES = {"gauss": 14, "radau": 9}
"""Stages of references: those of no default, so that even where a run and its reference take the same few
steps, two discretisations are compared."""
_KNOWN = 0.1
"""How well a reference is to be known, over the bound on the error of points."""
_FALLS = 3.0
"""Factor by which a tighter reference must be known better for a still tighter one to pay."""


def solve_reference(job: Job) -> Truth:
    """Solve a model tightly, by the first of a few ways (`_ways`) that reaches the end."""
    try:
        scene = build(parse_deck(job.text, job.file, job.overrides), job.model)
    except DeckError as problem:
        return Truth("lost", reason=REFUSED + problem.problems[0].message)
    budget = Budget(job.limit)
    first: Integration | None = None
    try:
        for solve in _ways(scene, job):
            done = run_integration(scene, solve, budget.guard()).in_time()
            first = first or done
            if done.stop is None:
                break
    except TimeUp as stop:
        if first is None:
            return Truth("lost", reason=f"the reference was {stop} after {job.limit:.3g} s")
        done = first
    return _truth_of(scene, done if done.stop is None else first or done, solve, job.disturbed, budget)


def _tolerance(scene: Scene, job: Job) -> float:
    return min(job.tolerance, 0.1 * scene.deck.solve.tolerance)


def _ways(scene: Scene, job: Job) -> Iterator[SolveSpec]:
    """Yield ways to solve a scene tightly; the last is looser, for round-off may forbid the first two."""
    for method, factor in (("gauss", 1.0), ("radau", 1.0), ("gauss", 1e3)):
        update = {"method": method, "tolerance": min(factor * _tolerance(scene, job), 1e-6), "step": None}
        update |= {"stages": _STAGES[method], "max_steps": None}
        yield scene.deck.solve.model_copy(update=update)


def _in_words(solve: SolveSpec) -> str:
    return way_in_words(solve.method, solve.stages, solve.tolerance)


def _truth_of(scene: Scene, done: Integration, solve: SolveSpec, disturbed: bool, budget: Budget) -> Truth:
    samples, end = sample(scene, done.trajectory), done.trajectory.t_end
    growth = disturbed_growth(scene, done, solve, budget.guard()) if disturbed else None
    factor = growth.factor if growth else None
    if done.stop is not None:
        as_solved = replace(scene, loaded=scene.loaded.with_solve(solve.model_dump()))
        kind, item, reason = why_stopped(as_solved, done, budget.left)
        return Truth("failed", kind, reason, end, item, growth=factor)
    channels = compute_channels(samples)
    if not all_finite(channels):
        return Truth("failed", "numerical", "the reference is not finite", end, growth=factor)
    found = instability(scene, growth) if growth and growth.unstable else None
    kind, item, reason = (found.kind, found.item, found.reason) if found else ("", "", "")
    scales = reference_scales(samples, channels)
    return Truth("done", kind, reason, end, item, channels, scales, factor, how=_in_words(solve))


# --- how well one is known ------------------------------------------------------------------------


def check_reference(job: Job) -> Truth:
    """Return the reference of a job with how well it is known, or a tighter one where that is not enough."""
    truth = job.truth
    assert truth is not None
    scene = build(parse_deck(job.text, job.file, job.overrides), job.model)
    budget = Budget(job.limit)
    try:
        found = _solved_twice(scene, job, truth, budget)
    except TimeUp as stop:
        return replace(truth, doubt=f"a second solution was {stop} after {job.limit:.3g} s")
    return _tighter(scene, job, found, budget)


def _solved_twice(scene: Scene, job: Job, truth: Truth, budget: Budget) -> Truth:
    """Hold a reference against the next way that reaches the end."""
    doubt = "there is no other way that reaches the end"
    for solve in islice(dropwhile(lambda way: _in_words(way) != truth.how, _ways(scene, job)), 1, None):
        done = run_integration(scene, solve, budget.guard()).in_time()
        if done.stop is not None:
            doubt = f"{_in_words(solve)} does not reach the end: {done.stop}"
            continue
        others = compute_channels(sample(scene, done.trajectory))
        if all_finite(others):
            floors = floors_of(truth.channels, others, truth.scales)
            return replace(truth, floors=floors, how=f"{truth.how} against {_in_words(solve)}")
    return replace(truth, doubt=doubt)


def _tighter(scene: Scene, job: Job, truth: Truth, budget: Budget) -> Truth:
    """Return the first of ever tighter references that is known well enough, or the best there is."""
    ladder = [level for level in LADDER if level < _tolerance(scene, job)]
    better = agreements(scene, budget, budget.left, ladder=ladder)
    while truth.floor is not None and truth.floor > _KNOWN * job.bound:
        found, _ = next(better, (None, 0.0))
        if found is None or isinstance(found, HfsimError):
            break
        before, agreed = truth.floor, replace(truth, **vars(found))
        truth = min(truth, agreed, key=lambda one: one.floor or 0.0)
        if (agreed.floor or 0.0) > before / _FALLS:
            break
    return truth
