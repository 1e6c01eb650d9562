"""A step of a kind that is tried: what is recorded has to give what NumPy does."""

from __future__ import annotations

from typing import Any

import numpy as np

from hfsim.integrators._along import looked as along
from hfsim.integrators._closing import tried as moved
from hfsim.integrators._derivative import Derivative
from hfsim.integrators._iteration import Iteration, Kind, Place
from hfsim.integrators._problem import Problem
from hfsim.integrators.derivative import computed
from hfsim.maths.arrays import Array
from hfsim.maths.replayed import shaken
from hfsim.mechanics.projection import Projection

At = tuple[Any, Array, Array, Array | None]
"""(t, q, v, expected strains or None) where a derivative is taken."""


class InNumPy(Iteration):
    """A step of a kind, with a derivative that is given or that of its start."""

    def __init__(self, problem: Problem, kind: Kind, place: Place, given: Derivative | None) -> None:
        derivative = given or derived(problem, kind, *here(problem, place))
        super().__init__(problem, derivative, kind.table, place, kind.strained)

    def start(self) -> Array:
        """Return the accelerations at the start."""
        t, q, v, _ = self._place
        return self._problem.single(t, q, v)

    def closed(self, q: Array, v: Array) -> list[Array]:
        """Return what the functions of the projection return at an end."""
        return closed(self._problem, self._place, q, v)

    def looked(self, series: Array, q: Array, v: Array) -> list[Array]:
        """Return what is seen along the step, with an end."""
        return looked(self._problem, self._place, series, q, v)


def closed(problem: Problem, place: Place, q: Array, v: Array) -> list[Array]:
    """Return what the functions of the projection return at an end (n,) of a step."""
    t, project = np.array([place.t + place.h]), problem.project
    return moved(Projection(project.system), t, q, v) if isinstance(project, Projection) else []


def looked(problem: Problem, place: Place, series: Array, q: Array, v: Array) -> list[Array]:
    """Return what is seen along a step with such an end (n,)."""
    return list(along(problem, place, series, q, v))


def tried(step: Any, place: Place, begun: Any = None) -> tuple[Any, list[list[Array]]]:
    """Do a step, in NumPy or recorded, with two corrections.

    Returns
    -------
    begun : (ndarray, ndarray or None)
        Accelerations and expected strains that corrections begin with: those given, or the guess.
    results : list of lists of ndarray
        Of the step, of what looks along it, and of what moves its end; empty where that is not recorded.
    """
    found, h = [step.start()], place.h
    step.guess(found[0])
    found.append(step.end().q)
    if begun is None:
        begun = step.a.copy(), None if step.expected is None else step.expected.copy()
    step.a[...] = begun[0]
    if step.expected is not None:
        step.expected[...] = begun[1]
    found += [np.asarray(one) for one in step.middle() if one is not None]
    step.reach()
    step.prepare()
    for finite in (True, False):
        step.correct()
        found.append(step.correction_found.copy())
        step.advance(finite)
    strains = () if step.expected is None else (1.0,)
    as_length = (h * h, 1.0, 1.0, 1.0, h, *strains, 1.0, 1.0, 1.0, h, h * h, 1.0, h)
    end, at = step.end(), (shaken(place.q), shaken(place.v))
    found = [np.asarray(unit * one) for unit, one in zip(as_length, [*found, *end[:5]], strict=True)]
    return begun, [found, step.looked(end.series, *at), step.closed(*at)]


def derived(
    problem: Problem, kind: Kind, t: Any, q: Array, v: Array, expected: Array | None
) -> Derivative:
    """Return the derivative at a state."""
    return computed(problem, kind.increments(problem), False, t, q, v, expected)


def here(problem: Problem, place: Place) -> At:
    """Return the state in which a step begins."""
    t, q, v, _ = place
    return t, q, v, None if problem.strains is None else problem.strains.seen(q[None])[0]


def starts(derivative: Derivative, problem: Problem, kind: Kind, place: Place) -> bool:
    """Tell whether a derivative is what a step of a kind begins with."""
    alike = type(derivative.increments) is type(kind.increments(problem))
    there = together(here(problem, place))
    return alike and np.array_equal(derivative.taken[: len(there)], there)


def together(at: At) -> Array:
    """Return a state as one array."""
    return np.concatenate([np.ravel(one) for one in at if one is not None])


def parted(where: Array, n: int) -> At:
    """Return the parts of a state (n,) that is one array."""
    expected = where[2 * n + 1 :] if len(where) > 2 * n + 1 else None
    return where[0, ...], where[1 : n + 1], where[n + 1 : 2 * n + 1], expected


def common(results: list[list[Array]], others: list[list[Array]]) -> list[Array]:
    """Return those results of a step that another one has too."""
    return [one for mine, theirs in zip(results, others, strict=True) for one in mine[: len(theirs)]]
