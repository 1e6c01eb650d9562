"""Turns at the start that nothing states: bodies take them from others along the joints that fix them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from itertools import groupby
from typing import NamedTuple, TypeAlias

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.rank import LOST, null_space
from hfsim.maths.rotations import rotation, rotation_vector, smallest_rotation
from hfsim.mechanics.constraints import Constraint
from hfsim.scene.closing import CLOSED
from hfsim.scene.stated import AT_START, Start, Stated

GROUND = None
Turns: TypeAlias = "dict[int | None, Array]"


def hand_on(start: Start, given: Stated, step: Callable[[Constraint], Array]) -> None:
    """Take turns that are not stated from other bodies, along the constraints and gears that fix them."""
    turns, stated = start.turns_of(given.values), start.turns_of(given.stated)[:, -1]
    known = _by_turns(start, turns, np.flatnonzero(stated), step, gears=())
    geared = _by_turns(start, turns, known, step) - known if start.gears else set()
    for k in (known | geared) - {GROUND}:
        start.turns_of(given.open)[k] = False
        start.turns_of(given.geared)[k] = k in geared


def hand_on_known_faces(start: Start, place: Stated) -> None:
    """Take turns in space that are not stated from other bodies, along the joints that hold three axes."""
    unknown = start.turns_of(place.open)
    known = np.flatnonzero(~unknown.any(axis=1))
    for k in hand_on_faces(start, place.values, known) - {GROUND}:
        unknown[k] = False


def hand_on_level(start: Start, x: Array, known: Iterable[int], heads: Collection[int]) -> None:
    """Turn bodies, in places (n,), as joints have them against known ones, or else against each other.

    Parameters
    ----------
    heads : collection of int
        Bodies that stand as they are where nothing known fixes them, one after another.
    """
    if start.n_dim == 2:
        _by_turns(start, start.turns_of(x), known, lambda tie: tie.target(AT_START), heads)
        return
    reached = hand_on_faces(start, x, known)
    while _hand_on_hinges(start, x, reached):
        reached = hand_on_faces(start, x, reached)
    hand_on_faces(start, x, reached, heads)


def _by_turns(
    start: Start,
    turns: Array,
    given: Iterable[int | None],
    step: Callable[[Constraint], Array],
    heads: Collection[int] = (),
    gears: Iterable[Constraint] | None = None,
) -> set[int | None]:
    """Set turns (n_bodies, n_spin) by those that are given; return which are known then, and the ground."""
    known: Turns = {GROUND: np.zeros(turns.shape[1])} | {int(k): turns[k] for k in given if k is not GROUND}
    kinds = (start.ties, start.gears if gears is None else gears)
    ties, geared = ([_Row.of(start, one, step) for one in kind] for kind in kinds)
    tied = {k for row in (*ties, *geared) for k in row.factors}

    def spread() -> None:
        while _handed_on(known, ties) or _handed_on(known, geared) or _solved(known, ties, geared):
            pass

    spread()
    for head in heads:
        if head in tied and head not in known:
            known[head] = turns[head]
            spread()
    for k, turn in known.items():
        if k is not GROUND:
            turns[k] = turn
    return set(known)


class _Row(NamedTuple):
    """A sum of turns of bodies, each with a factor, that a constraint holds at a value."""

    factors: dict[int, float]
    value: Array

    @classmethod
    def of(cls, start: Start, constraint: Constraint, step: Callable[[Constraint], Array]) -> _Row:
        """Return it by which values constraints have."""
        factors, level = dict[int, float](), np.zeros((1, start.linkage.n))
        for marker, J in zip(constraint.ends, constraint.jacobians(level), strict=True):
            if (k := start.linkage.owner(marker)) is not GROUND:
                factors[k] = factors.get(k, 0.0) + float(J[0, 0, -1])
        return cls({k: factor for k, factor in factors.items() if abs(factor) > CLOSED}, step(constraint))

    def left(self, known: Turns) -> Array:
        """Return what is left of the value for bodies that are not known."""
        part = sum(factor * known[k] for k, factor in self.factors.items() if k in known)
        return np.asarray(self.value - part)


def _handed_on(known: Turns, rows: Iterable[_Row]) -> bool:
    """Take the turns of bodies by rows in which all others are known; tell whether any was."""
    before = len(known)
    for row in rows:
        if len(unknown := [k for k in row.factors if k not in known]) == 1:
            known[unknown[0]] = row.left(known) / row.factors[unknown[0]]
    return len(known) > before


def _solved(known: Turns, ties: Iterable[_Row], gears: Iterable[_Row]) -> bool:
    """Take turns that gears and ties fix only together; tell whether any was."""
    if all(row.factors.keys() <= known.keys() for row in gears):
        return False
    rows = [row for row in (*ties, *gears) if not row.factors.keys() <= known.keys()]
    unknown = list(dict.fromkeys(k for row in rows for k in row.factors if k not in known))
    A = np.array([[row.factors.get(k, 0.0) for k in unknown] for row in rows])
    turns = np.linalg.lstsq(A, np.array([row.left(known) for row in rows]), rcond=LOST)[0]
    fixed = np.flatnonzero(np.abs(null_space(A)).max(axis=1, initial=0.0) < CLOSED)
    known.update((unknown[k], turns[k]) for k in fixed)
    return len(fixed) > 0


def hand_on_faces(
    start: Start, x: Array, given: Iterable[int | None], heads: Collection[int] = ()
) -> set[int | None]:
    """Turn bodies in space, in places (n,), as joints that hold three axes have them against known ones.

    Then against each of some heads, one after another, as far as these are not known.

    Returns
    -------
    set of int or None
        Which bodies are known then, and the ground.
    """
    link, turns = start.linkage, start.turns_of(x)
    known = {k if k is GROUND else int(k) for k in given}

    def handed_on() -> bool:
        before = len(known)
        for _, (a, b), held, faced in link.faced(x):
            first, second = link.owner(a), link.owner(b)
            if (first in known) != (second in known):
                forth, back = (second, a, held @ faced.T), (first, b, held.T @ faced)
                own, end, turn = forth if first in known else back
                axes = np.stack([end.turned(x[None], e)[0] for e in np.eye(3)], axis=1)
                turns[own] = rotation_vector(axes @ turn @ axes.T @ rotation(turns[own]))
                known.add(own)
        return len(known) > before

    for one in (GROUND, *heads):
        known.add(one)
        while handed_on():
            pass
    return known


def _hand_on_hinges(start: Start, x: Array, known: set[int | None]) -> bool:
    """Turn bodies in space as little as puts the axes of hinges on those in known ones; tell whether any."""
    link, turns, before = start.linkage, start.turns_of(x), len(known)
    for _, group in groupby(link.senses, key=lambda sense: sense[0]):
        (_, a, b, own, other), *more = group
        first, second = link.owner(a), link.owner(b)
        if not more and (first in known) != (second in known):
            here, there = a.turned(x[None], own)[0], b.turned(x[None], other)[0]
            k, turn = (second, (there, here)) if first in known else (first, (here, there))
            turns[k] = rotation_vector(smallest_rotation(*turn) @ rotation(turns[k]))
            known.add(k)
    return len(known) > before
