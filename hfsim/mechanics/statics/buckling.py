"""Critical load factors: where the tangent stiffness of the equilibrium under a load becomes singular.

About a loaded state the stiffness changes with the load as K + nu K'; the factors nu at which it is singular
are eigenvalues.  The equilibrium is then taken to the load so found and the problem solved anew, until it is
the load itself: what bends, turns or stretches before it buckles is accounted for.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.matrices import Matrix
from hfsim.mechanics.statics.beginning import begun
from hfsim.mechanics.statics.newton import (
    MOVE,
    SHORTEST,
    Effort,
    NotFoundError,
    balanced,
    correction,
    follows,
)
from hfsim.mechanics.statics.problem import Level, Problem, State
from hfsim.mechanics.statics.singular import eigenpairs
from hfsim.mechanics.statics.stability import lowest

STEP = 1e-3
"""Of differences of the stiffness by the load, relative to the factor."""
SAME = 1e-10
"""Change of a factor, relative to it, after which it is found."""
AGAIN = 1e-8
"""Distance of a factor, relative to it, from an earlier estimate after which it is found too."""
SPARE = 4
"""Further factors that are looked at where some are none."""
MOST = 12
"""Improvements of a factor."""
REACHED = 1e-4
"""Least of these changes, relative to the factor, up to which only rounding of the stiffness is in it."""
NEARER = 3
"""Tries of a load before an estimate, each nearer to where it is looked from."""
BESIDE = 0.02
"""Distance from a factor, relative, from which it is looked at where its neighbourhood leads away."""
BEFORE = 0.9
"""Part of the way to an estimate up to which the equilibrium is taken where it is not found there."""
AHEAD = 1e-2
"""The same, beyond which a factor runs ahead of any load, and the distance at which it is looked for else."""
ROUNDING = 1e-15
"""Change of the stiffness along a motion, relative to all that adds up to it, that may be rounding."""
CLEAR = 1e-9
"""The same, from which rounding does not count ..."""
LONGER = 10.0
"""... and by how much longer steps have to be where it does."""
ONE = 1e-6
"""Difference of factors, relative to them, up to which they are one."""
ALIKE = 0.99
"""Cosine of the angle between motions from which on they are the same."""
FOLLOWED = 80
"""Steps of the load, tried ones too, in which factors are looked for where the start tells none."""
UNMOVED = 1e-20
"""What the loads move at first, below which steps are no longer: squares of the load would overflow [rad]."""
MOVED = 0.3
"""Change of a state from one load to another within which it is the same path [rad]."""

Passed = list[tuple[float, State]]
"""Loads on the way to a factor, with the equilibria there."""


class Factor(NamedTuple):
    """A critical load factor.

    Attributes
    ----------
    load : float
    found : bool
        Whether it is the load itself, not an estimate from smaller ones.
    motion : ndarray, shape (n,)
        How the scene begins to give way.
    """

    load: float
    found: bool
    motion: Array


def critical_factors(problem: Problem, effort: Effort, count: int = 3) -> list[Factor]:
    """Return the smallest positive factors of the loads at which the scene gives way.

    Raises
    ------
    NotFoundError
        If there is no equilibrium without the loads, or nothing gives way as far as it can be followed.
    """
    problem, state = begun(problem, effort)
    begin, (first, step) = problem.least, _first(problem, state, effort, count)
    every = (_improved(problem, state, begin + ahead, motion, effort) for ahead, motion in first)
    improved = list(islice((one for one in every if one is not None), count))
    if first and not improved:
        improved = list(islice(_crossed(problem, state, effort, count), count))
    stiffness = problem.tangent(state, begin).stiffness
    kept = list[Factor]()
    for one in sorted(improved, key=lambda one: (one.load, not one.found)):
        felt = one.found or _felt(stiffness, one.motion, step / (one.load - begin)) > ROUNDING
        if felt and not any(_same(one, other) for other in kept):
            kept.append(one)
    return kept


def _first(
    problem: Problem, state: State, effort: Effort, count: int
) -> tuple[list[tuple[float, Array]], float]:
    """Return estimates from where paths begin, and the step of the load that the stiffness was taken over.

    It is relative to the nearest of them where rounding hides what a short one changes, as of a small load,
    and nothing is hidden then.
    """
    begin, step = problem.least, STEP * (problem.least or 1.0)
    stiffness = problem.tangent(state, begin).stiffness
    found = first = eigenpairs(problem, state, begin, step, effort, count + SPARE), step
    try:
        longest = MOVE / max(problem.moved(_answered(problem, state)), UNMOVED)
        while True:
            pairs, step = found
            seen = pairs[:count] or eigenpairs(problem, state, begin, step, effort, 0)[:1]
            if seen and all(_felt(stiffness, motion, step / ahead) > CLEAR for ahead, motion in seen):
                return found
            longer = min(STEP * abs(seen[0][0]) if seen else step / ROUNDING**0.5, longest)
            if longer < LONGER * step:
                return first
            found = eigenpairs(problem, state, begin, longer, effort, count + SPARE), longer
    except (NotFoundError, np.linalg.LinAlgError):
        return first


def _felt(stiffness: Matrix, motion: Array, part: float) -> float:
    """Return by what the stiffness of the unloaded scene changes in differences, over all that adds up to it.

    These are over a part of the way to where it is gone, to both sides.
    """
    size, own = np.abs(motion), abs(float(motion @ (stiffness @ motion)))
    return 2.0 * abs(part) * own / float(size @ (abs(stiffness) @ size))


def _same(one: Factor, other: Factor) -> bool:
    """Return whether two factors have been improved to the same."""
    sizes = float(np.linalg.norm(one.motion) * np.linalg.norm(other.motion))
    near = abs(one.load - other.load) <= ONE * abs(other.load)
    return near and abs(float(one.motion @ other.motion)) > ALIKE * sizes


def _improved(problem: Problem, state: State, load: float, motion: Array, effort: Effort) -> Factor | None:
    """Return a factor with the equilibrium taken to it, as far as that goes; None if it runs ahead of it.

    The straight line K + nu K' has zeros where K itself has none, as of what bends from the start.
    """
    found = best = Factor(load, False, motion)
    at, before, least = problem.least, [load], abs(load)
    passed = [(at, state)]
    for _ in range(MOST):
        try:
            place, near = _next_to(problem, state, at, load, effort)
            if problem.moved(near.z - state.z) > MOVED:
                return found
            try:
                pairs = eigenpairs(problem, near, place, STEP * place, effort, 0)
            except NotFoundError:  # a scene that leans by rounding goes away beside the branch
                place = min(at + BEFORE * (load - at), (1.0 - BESIDE) * load)
                near = balanced(problem, state, Level(place), effort)
                pairs = eigenpairs(problem, near, place, STEP * place, effort, 0)
        except (NotFoundError, np.linalg.LinAlgError):
            return _proved(problem, passed, best, effort) if least <= REACHED * abs(best.load) else best
        if not pairs:
            return None
        motion = motion / np.linalg.norm(motion)
        alike = [abs(float(one @ motion)) / float(np.linalg.norm(one)) for _, one in pairs]
        close = [alike[k] / (1.0 + abs(pairs[k][0]) / abs(load)) for k in range(len(pairs))]
        more = pairs[int(np.argmax(close))][0]
        motion = _followed(motion, [one for shift, one in pairs if abs(shift - more) <= ONE * abs(load)])
        if not motion.any():
            return None
        state, at, load = near, place, place + more
        passed.append((at, state))
        if load <= problem.least:
            return None
        # at the factor itself all is rounding: from next to it the same is found again
        again = any(abs(load - one) <= AGAIN * abs(load) for one in before[:-1])
        found = Factor(load, False, motion)
        if again or abs(more) <= SAME * abs(at) or abs(more) <= 1e-14:
            return _proved(problem, passed, found, effort)
        before.append(load)
        if abs(more) <= least:
            best, least = found, abs(more)
    if least <= REACHED * abs(best.load):
        return _proved(problem, passed, best, effort)
    return _between(problem, passed, best.load, effort) if least <= AHEAD * abs(best.load) else None


def _next_to(problem: Problem, state: State, at: float, load: float, effort: Effort) -> tuple[float, State]:
    """Return a load with the equilibrium there or, where that at one is too singular or far, before it."""
    moved = problem.moved(correction(problem, state, Level(load))[0])
    for _ in range(NEARER):
        if moved > MOVED:
            load = at + BEFORE * MOVED / moved * (load - at)
        try:
            near = balanced(problem, state, Level(load), effort)
        except (NotFoundError, np.linalg.LinAlgError):
            load = at + BEFORE * (load - at)
            near = balanced(problem, state, Level(load), effort)
        moved = problem.moved(near.z - state.z)
        if moved <= MOVED:
            break
    return load, near


def _followed(motion: Array, others: list[Array]) -> Array:
    """Return what is nearest to a motion among those of one factor, of which any mixture is one."""
    basis = np.array(others).T
    return np.asarray(basis @ np.linalg.lstsq(basis, motion, rcond=None)[0])


def _proved(problem: Problem, passed: Passed, factor: Factor, effort: Effort) -> Factor | None:
    """Return a factor at which estimates stay; None if nothing gives way there, as where it only bends."""
    try:
        (*_, before), (*_, beyond) = _around(problem, passed, factor.load, effort)
    except (NotFoundError, np.linalg.LinAlgError):
        return factor
    return factor._replace(found=True) if before != beyond else None


def _between(problem: Problem, passed: Passed, load: float, effort: Effort) -> Factor | None:
    """Return the factor near a load about which estimates go to and fro; None if there is none."""
    try:
        (low, state, before), (high, _, beyond) = _around(problem, passed, load, effort)
        return _located(problem, state, (low, high), before, effort) if before < beyond else None
    except (NotFoundError, np.linalg.LinAlgError):
        return None


def _around(problem: Problem, passed: Passed, load: float, effort: Effort) -> list[tuple[float, State, int]]:
    """Return loads on both sides of one, equilibria there and how many of their motions are not stable.

    They are looked for from a load below, as next to a factor corrections lead to other paths; none is found
    beyond where the path of the equilibrium turns off.
    """
    low, high = (1.0 - AHEAD) * load, (1.0 + AHEAD) * load
    _, state = max((one for one in passed if one[0] <= low), key=lambda one: one[0], default=passed[0])
    below = balanced(problem, state, Level(low), effort)
    first = correction(problem, below, Level(high))
    beyond = balanced(problem, below, Level(high), effort, first)
    if not follows(problem, beyond.z - below.z, first[0], False):
        raise NotFoundError("the path turns off", beyond)
    return [(at, one, _unstable(problem, one, at)) for at, one in ((low, below), (high, beyond))]


def _crossed(problem: Problem, state: State, effort: Effort, count: int) -> Iterator[Factor]:
    """Yield factors that the equilibrium crosses as the load grows, where the start tells none.

    Raises
    ------
    NotFoundError
        If it cannot be followed so far.
    """
    load, found = problem.least, 0
    unstable = _unstable(problem, state, load)
    step = MOVE / max(problem.moved(_answered(problem, state)), UNMOVED)
    shortest = SHORTEST * step
    for _ in range(FOLLOWED):
        ends, located = (load, load + step), list[Factor]()
        try:
            first = correction(problem, state, Level(ends[1]))
            there = balanced(problem, state, Level(ends[1]), effort, first)
            problem.note(ends[1], there)
            led = follows(problem, there.z - state.z, first[0], False)
            now = _unstable(problem, there, ends[1]) if led else unstable
            # a long step may end on another path
            led = led and (now <= unstable or step <= AHEAD * ends[1])
            crossing = range(unstable, min(now, unstable + count - found)) if led else ()
            located += (_located(problem, state, ends, k, effort) for k in crossing)
        except (NotFoundError, np.linalg.LinAlgError):
            led = False
        if not led:
            step *= 0.25
            if step < shortest:
                break
            continue
        yield from located
        found += len(located)
        state, load, unstable = there, ends[1], now
        step *= min(2.0, 0.9 * MOVE / problem.moved(first[0]))
    if not found:
        told = f"nothing gives way up to a factor of {load:.4g}: --path follows it further"
        raise NotFoundError(told, state)


def _located(
    problem: Problem, state: State, between: tuple[float, float], number: int, effort: Effort
) -> Factor:
    """Return the factor, next to a state, at which one of the smallest stiffnesses changes its sign.

    Raises
    ------
    NotFoundError
        If none does so.
    """
    from scipy.optimize import brentq

    def smallest(load: float) -> tuple[float, Array]:
        values, motions, _ = lowest(problem, balanced(problem, state, Level(load), effort), load)
        return float(values[number]), motions[number]

    try:
        load = brentq(lambda load: smallest(load)[0], *between, xtol=SAME * between[1])
    except ValueError as error:  # beyond a limit point corrections end anywhere
        raise NotFoundError(str(error), state) from None
    return Factor(float(load), True, smallest(load)[1])


def _unstable(problem: Problem, state: State, load: float) -> int:
    """Return how many motions are not stable."""
    return int(np.sum(lowest(problem, state, load)[0] < 0.0))


def _answered(problem: Problem, state: State) -> Array:
    """Return by what the equilibrium from which it is followed changes with the load, (1, n)."""
    gaps = np.zeros_like(state.multipliers)
    return problem.tangent(state, problem.least).solved(problem.load(state.z), gaps)[0]
