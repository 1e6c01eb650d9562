"""Bodies beside the loops that must be searched for: they start as they would without the search."""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array, BoolArray
from hfsim.scene.closing import BESIDE, CLOSED
from hfsim.scene.handed_on import hand_on_level
from hfsim.scene.loops import GROUND, Loops, ends_of
from hfsim.scene.stated import Start, Stated


def by_itself(start: Start, place: Stated, x: Array, found: BoolArray | None = None) -> Array:
    """Return places (n,) where what is not stated is zero, but for turns that joints fix against others.

    Where joints fix turns against each other alone, the body nearest to the ground is not turned.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Where stated turns, and those that follow from them, are.
    found : ndarray of bool, shape (n_bodies,), optional
        Bodies that are there with origin and turn.
    """
    known = ~start.turns_of(place.open).any(axis=1)
    begin = np.where(place.stated, x, 0.0)
    start.turns_of(begin)[known] = start.turns_of(x)[known]
    if found is not None:
        known |= found
        begin.reshape(len(known), -1)[found] = x.reshape(len(known), -1)[found]
    hand_on_level(start, begin, np.flatnonzero(known), _loops(start, place).inner)
    return begin


def taken_back(start: Start, place: Stated, x: Array) -> Array:
    """Return places x (n,) of a search with bodies that need none where they would be without it.

    These are in no loop that shifts alone leave open; where they hang on such loops, they are turned least.
    """
    link, ends, loops = start.linkage, ends_of(start.linkage), _loops(start, place)
    origins = ~place.stated & ~link.turns
    begin = link.descend(by_itself(start, place, x)[None], origins)
    gaps = np.abs(link.gaps(begin)[0])
    missed = np.array([gaps[rows].max(initial=0.0) for rows in link.equations.rows])
    wide = np.flatnonzero(missed > max(CLOSED, BESIDE * missed.max(initial=0.0)))
    searched = {loops.loop_of(ends[k]) for k in wide}
    found: BoolArray = np.zeros(len(start.names), dtype=bool)
    found[[body for body in loops.bodies(searched) if body != GROUND]] = True
    back = by_itself(start, place, x, found)
    aside = place.open & link.turns
    start.turns_of(aside)[found] = False
    if not np.abs(back - x)[aside].max(initial=0.0) > CLOSED:
        return x
    if link.closes(back, origins):
        return back
    return next(iter(link.search(back[None], origins | aside)), x)


def _loops(start: Start, place: Stated) -> Loops:
    """Return the loops of a scene, closed too by what is stated of bodies: they are as if on the ground."""
    stated = place.stated.reshape(len(start.names), -1)
    held = np.flatnonzero((stated if start.n_dim == 3 else stated[:, : start.n_dim]).any(axis=1))
    return Loops.of(len(stated), [*ends_of(start.linkage), *((GROUND, int(k)) for k in held)])
