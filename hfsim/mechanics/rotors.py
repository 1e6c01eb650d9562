"""Turns by themselves of what is the same all around an axis: shafts, rigid bodies, sets of these welded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.matrices import NOTHING, Entries
from hfsim.maths.rank import spanning

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
    runs = {body.name: body.columns for body in bodies}
    for one in sets if bodies[0].n_dim == 3 else ():
        own = np.concatenate([np.arange(runs[name].start, runs[name].stop) for name in one])
        part = np.zeros_like(columns)
        part[:, own] = columns[:, own]
        found[one] = _turn(own, x, equations, part)
    return {names: entries for names, entries in found.items() if entries.values.size}


def _turn(own: IntArray, x: Array, equations: Equations, columns: Array) -> Entries:
    """Return W for vectors of one set at its coordinates in x (n_x,), of which its turn is made."""
    spins, shifts = np.split(columns, 2)
    momenta = equations.momentum(x[None], shifts)
    spins = spins - (spins @ momenta.T) / (momenta[0] @ shifts[0]) @ shifts
    # only now, about its own centre: of inertia about a far one, rounding would be left
    sizes, axes = np.linalg.eigh(equations.momentum(x[None], spins) @ spins.T)
    x, spins, shifts = x[own], spins[:, own], shifts[:, own]
    even = np.diff(sizes) <= _SYMMETRIC * sizes[-1]
    which = 2 if even[0] else 0
    if even[0] == even[1] or sizes[which] <= _SYMMETRIC * sizes[-1]:
        return NOTHING
    axis = axes[:, which] * np.sign(axes[np.argmax(np.abs(axes[:, which])), which])
    vectors, places = x.reshape(-1, 3), own.reshape(-1, 3)
    turning = np.flatnonzero(~shifts.reshape(3, -1, 3).any(axis=(0, 2)))
    base = turning[spanning(vectors[turning])]
    factors = (axis @ spins).reshape(-1, 3) @ np.linalg.pinv(vectors[base])
    to, source = np.nonzero(factors)
    return Entries(places[to].ravel(), places[base[source]].ravel(), np.repeat(factors[to, source], 3))
