"""Modes of a scene that turns, followed by their shapes from one rate to another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from hfsim.maths.arrays import Array, BoolArray, ComplexArray
from hfsim.studies.modes.about import About, turning_at
from hfsim.studies.modes.found import Mode, Modes, modes_of

SPARE = 6
"""Modes looked at beyond those asked for: some drop out of the slowest."""
_SAME = 1e-6
"""Difference of frequencies, relative, up to which they are one."""
_ALIKE = 0.3
"""Modal assurance from which two shapes may be those of one mode."""
_NEAR = 0.2
"""Weight of the difference of frequencies, over their size, beside the assurance."""


def at_rate(near: About, start: About, rate: float) -> About:
    """Return the steady rotation at a rate, sought from another one; at none, the equilibrium next to it."""
    seen = replace(near, motions=replace(near.motions, turning=start.turning))
    return turning_at(seen, rate)


def followed(founds: Sequence[Modes], count: int) -> tuple[Any, Any]:
    """Return each mode of the first rate, and its sense, at all rates."""
    from scipy.optimize import linear_sum_assignment

    tracks: list[list[Mode | None]] = [[mode] for mode in founds[0].modes[:count] if mode.kind != "decay"]
    senses = [[1] for _ in tracks]
    last, every = [track[0] for track in tracks], all(len(one.modes) < count + SPARE for one in founds)
    for found in founds[1:]:
        here = [mode for mode in found.modes if mode.kind != "decay"]
        unlike, turned = _unlike(found, [mode for mode in last if mode is not None], here)
        chosen = dict(zip(*(one.tolist() for one in linear_sum_assignment(unlike)), strict=True))
        for k, track in enumerate(tracks):
            j = chosen.get(k)
            # where all that a scene has is known, before and after, nothing can have come or gone
            same = j is not None and (unlike[k, j] < 1.0 - _ALIKE or (every and len(here) == len(last)))
            track.append(here[j] if j is not None and same else None)
            senses[k].append(senses[k][-1] * (-1 if j is not None and same and turned[k, j] else 1))
            last[k] = track[-1] or last[k]
    return tuple(map(tuple, tracks)), tuple(map(tuple, senses))


def _unlike(found: Modes, before: Sequence[Mode], after: Sequence[Mode]) -> tuple[Array, BoolArray]:
    """Return how unlike modes are, (n_before, n_after), in shape and a little in frequency.

    Then whether they are alike the other way round.
    """
    momentum = partial(found.about.scene.system.equations.momentum, found.about.motions.x[None])

    def weighed(shapes: ComplexArray) -> ComplexArray:
        return np.asarray(momentum(shapes.real) + 1j * momentum(shapes.imag))

    one, other = (np.array([mode.natural_frequency for mode in modes]) for modes in (before, after))
    (a, alike), (b, others) = (_shapes(modes, w, weighed) for modes, w in ((before, one), (after, other)))
    assured = (np.abs(way @ weighed(b).T) ** 2 for way in (a.conj(), a))
    same, turned = (np.minimum(alike @ way @ others, 1.0) for way in assured)
    # of changes the squares, over one size for all modes of a shape: they keep their order, also through zero
    either = np.maximum(same, turned)
    size = either @ other + either @ (either.T @ one) / either.sum(axis=1) + np.finfo(float).tiny
    apart, through = (
        np.minimum((other + sign * one[:, None]) / size[:, None], 1.0) ** 2 for sign in (-1.0, 1.0)
    )
    # the other way round it has gone through zero
    plain, other_way = (1.0 - way + _NEAR * change for way, change in ((same, apart), (turned, through)))
    way = (other_way < plain) & np.array([mode.kind in ("vibration", "flutter") for mode in after])
    return np.where(way, other_way, plain), way


def _shapes(
    modes: Sequence[Mode], frequencies: Array, weighed: Callable[[ComplexArray], ComplexArray]
) -> tuple[ComplexArray, Array]:
    """Return shapes (n, n_x) of unit size, and which modes (n, n) are of one frequency.

    Of these any mixture is a mode as well: their shapes are made orthogonal, so that assurances add up.
    """
    shapes = np.array([mode.change for mode in modes])
    apart = np.abs(frequencies[:, None] - frequencies)
    one = np.where(apart <= _SAME * np.maximum(frequencies[:, None], frequencies), 1.0, 0.0)
    for k in range(len(shapes)):
        own, before = shapes[k : k + 1], one[k, :k, None] * shapes[:k]
        for _ in range(2):  # again, for what rounding leaves where they are nearly alike
            own -= (weighed(own) @ before.conj().T) @ before
            own /= np.sqrt((own.conj() @ weighed(own).T).real + np.finfo(float).tiny)
    return shapes, one


def mode_between(
    state: About, rate: float, ends: Sequence[tuple[float, Mode]], count: int, most: float = np.inf
) -> tuple[Mode, bool] | None:
    """Return the mode at a rate that lies between two, and whether it goes round the other way; None if none.

    Larger eigenvalues than the most are not looked at.
    """
    (low, first), (high, last) = ends
    found = modes_of(state, count + SPARE).modes
    modes = tuple(one for one in found if one.kind != "decay" and abs(one.value) <= most)
    if not modes:
        return None
    unlike, turned = _unlike(Modes(state, modes, None, False), [first, last], modes)
    j = int(np.argmin([high - rate, rate - low] @ unlike))  # squares of changes: what lies between them
    return modes[j], bool(turned[0, j])
