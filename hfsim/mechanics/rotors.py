"""Turns by themselves of what is the same all around an axis: shafts, rigid bodies, sets of these welded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.matrices import NOTHING, Entries

if TYPE_CHECKING:
    from hfsim.mechanics.body import Body
    from hfsim.mechanics.equations import Equations

_SYMMETRIC = 1e-9
"""Part of the largest moment of inertia by which others may differ that are the same, or be none."""


def own_turns(
    bodies: Sequence[Body],
    sets: Sequence[tuple[str, ...]],
    equations: Equations,
    x: Array,
    columns: Array,
) -> dict[tuple[str, ...], Entries]:
    """Return W of the rates u = W x at which bodies turn at 1 rad/s about axes of their own, by their names.

    Parameters
    ----------
    sets : sequence of tuple of str
        Rigid bodies in space that are welded together, or one alone.
    x : ndarray, shape (n_x,)
    columns : ndarray, shape (6, n_x)
        Rates of everything in turns about the axes of the ground, and in shifts along them.
    """
    found: dict[tuple[str, ...], Entries] = {(body.name,): body.spun_by_itself() for body in bodies}
    momenta, runs = equations.momentum(x[None], columns), {body.name: body.columns for body in bodies}
    for one in sets if bodies[0].n_dim == 3 else ():
        own = np.concatenate([np.arange(runs[name].start, runs[name].stop) for name in one])
        found[one] = _turn(own, x[own], columns[:, own], momenta[:, own])
    return {names: entries for names, entries in found.items() if entries.values.size}


def _turn(own: IntArray, x: Array, columns: Array, momenta: Array) -> Entries:
    """Return W for vectors x of one set, whose directions its turn is made of."""
    (spins, shifts), (turning, shifting) = np.split(columns, 2), np.split(momenta, 2)
    centre = turning @ shifts.T / (shifting[0] @ shifts[0])
    spins, turning = spins - centre @ shifts, turning - centre @ shifting
    sizes, axes = np.linalg.eigh(turning @ spins.T)
    even = np.diff(sizes) <= _SYMMETRIC * sizes[-1]
    which = 2 if even[0] else 0
    if even[0] == even[1] or sizes[which] <= _SYMMETRIC * sizes[-1]:
        return NOTHING
    axis = axes[:, which] * np.sign(axes[np.argmax(np.abs(axes[:, which])), which])
    vectors, places = x.reshape(-1, 3), own.reshape(-1, 3)
    base = _independent(vectors, np.flatnonzero(~shifts.reshape(3, -1, 3).any(axis=(0, 2))))
    factors = (axis @ spins).reshape(-1, 3) @ np.linalg.pinv(vectors[base])
    to, source = np.nonzero(factors)
    return Entries(places[to].ravel(), places[base[source]].ravel(), np.repeat(factors[to, source], 3))


def _independent(vectors: Array, some: IntArray) -> IntArray:
    """Return those of some of the vectors (n, 3) that span what all of these do."""
    from scipy.linalg import qr

    _, left, order = qr(vectors[some].T, mode="economic", pivoting=True)
    sizes = np.abs(np.diagonal(left))
    return np.asarray(some[order[: np.count_nonzero(sizes > _SYMMETRIC * sizes[0])]])
