"""Turns at the start that nothing states: bodies take them from others along the joints that fix them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from itertools import groupby

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.rotations import rotation, rotation_vector, smallest_rotation
from hfsim.mechanics.constraints import Constraint
from hfsim.scene.stated import AT_START, Start, Stated

GROUND = None


def hand_on(start: Start, given: Stated, step: Callable[[Constraint], Array]) -> None:
    """Take turns that are not stated from other bodies, along the constraints that fix them."""
    stated, unknown = (start.turns_of(kind) for kind in (given.stated, given.open))
    for k in _by_ties(start, start.turns_of(given.values), np.flatnonzero(stated[:, -1]), step) - {GROUND}:
        unknown[k] = False


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
        _by_ties(start, start.turns_of(x), known, lambda tie: tie.target(AT_START), heads)
        return
    reached = hand_on_faces(start, x, known)
    while _hand_on_hinges(start, x, reached):
        reached = hand_on_faces(start, x, reached)
    hand_on_faces(start, x, reached, heads)


def _by_ties(
    start: Start,
    turns: Array,
    given: Iterable[int],
    step: Callable[[Constraint], Array],
    heads: Collection[int] = (),
) -> set[int | None]:
    """Set turns (n_bodies, n_spin) by those that are given; return which are known then, and the ground."""
    known: dict[int | None, Array] = {GROUND: np.zeros(turns.shape[1])} | {int(k): turns[k] for k in given}
    owner = start.linkage.owner
    ties = [(tie, owner(tie.ends[0]), owner(tie.ends[1])) for tie in start.ties]

    def handed_on() -> bool:
        before = len(known)
        for tie, a, b in ties:
            if a in known and b not in known:
                known[b] = known[a] + step(tie)
            elif b in known and a not in known:
                known[a] = known[b] - step(tie)
        return len(known) > before

    tied = {end for _, *ends in ties for end in ends}
    for head in (GROUND, *(k for k in heads if k in tied)):
        if head is not GROUND:
            known.setdefault(head, turns[head])
        while handed_on():
            pass
    for k, turn in known.items():
        if k is not GROUND:
            turns[k] = turn
    return set(known)


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
