"""Modes of a scene that turns, followed by their shapes from one rate to another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from hfsim.maths.arrays import Array, BoolArray, ComplexArray
from hfsim.studies.modes.about import turning_at
from hfsim.studies.modes.found import Mode, Modes, modes_of
from hfsim.studies.modes.state import About

SPARE = 6
"""Modes looked at beyond those asked for: some drop out of the slowest."""
_SAME = 1e-6
"""Difference of frequencies, relative, up to which they are one."""
ALIKE = 0.3
"""Modal assurance from which two shapes may be those of one mode."""
_NEAR = 0.2
"""Weight of the difference of eigenvalues, over their size, beside the assurance."""
_SLOWER = 0.05
"""Weight of the decay: of two without a frequency, which have one shape, a mode becomes the slower one."""
_TINY = float(np.finfo(float).tiny)


@dataclass(eq=False)
class Steady:
    """Modes about the steady rotations of a scene, each of which is found once.

    Attributes
    ----------
    start : About
        A state that turns about the axis.
    count : int
        Modes followed.
    """

    start: About
    count: int
    _known: dict[float, Modes] = field(default_factory=dict)

    def at(self, rate: float, near: About) -> Modes:
        """Return those at a rate, sought from another one; at none, about the equilibrium next to it.

        At the rate of a start that is steady they are its own.

        Raises
        ------
        ModesError
            If there is no steady rotation next to that.
        """
        if rate not in self._known:
            turning = self.start.turning
            if turning is not None and np.isclose(rate, turning.rate, rtol=_SAME) and self.start.lasting:
                near = self.start
            seen = replace(near, motions=replace(near.motions, turning=turning))
            self._known[rate] = modes_of(turning_at(seen, rate), self.count + SPARE)
        return self._known[rate]


def followed(founds: Sequence[Modes], count: int) -> tuple[Any, Any]:
    """Return each mode of the first rate, and what else grows at any, with their senses, at all rates."""
    tracks: list[list[Mode | None]] = [[mode] for mode in founds[0].modes[:count]]
    senses = [[1] for _ in tracks]
    last, every = [track[0] for track in tracks], all(len(one.modes) < count + SPARE for one in founds)
    for number, found in enumerate(founds):
        for k, (mode, way) in enumerate(_next(found, last, every) if number else ()):
            tracks[k].append(mode)
            senses[k].append(way * senses[k][-1])
            last[k] = mode or last[k]
        told = [track[-1] for track in tracks]
        new = [mode for mode in found.unstable if found.steady and mode not in told]
        tracks += [[*[None] * number, mode] for mode in new]
        senses += [[1] * (number + 1) for _ in new]
        last += new
    return tuple(map(tuple, tracks)), tuple(map(tuple, senses))


def _next(found: Modes, last: Sequence[Mode | None], every: bool) -> list[tuple[Mode | None, int]]:
    """Return what modes have become, or None, and minus one where they go round the other way now."""
    unlike, turned = how_unlike(found, [mode for mode in last if mode is not None], found.modes)
    known = every and len(found) == len(last)
    # what is refused all the same takes no other mode its own
    chosen = assigned(unlike if known else np.minimum(unlike, 1.0 - ALIKE))
    became = list[tuple[Mode | None, int]]()
    for k in range(len(last)):
        j = chosen.get(k)
        # where all that a scene has is known, before and after, nothing can have come or gone
        if j is not None and (unlike[k, j] < 1.0 - ALIKE or known):
            became.append((found.modes[j], -1 if turned[k, j] else 1))
        else:
            became.append((None, 1))
    return became


def how_unlike(found: Modes, before: Sequence[Mode], after: Sequence[Mode]) -> tuple[Array, BoolArray]:
    """Return how unlike modes are, (n_before, n_after), in shape and a little in their eigenvalues.

    Then whether they are alike the other way round.
    """
    momentum = partial(found.about.scene.system.equations.momentum, found.about.motions.x[None])

    def weighed(shapes: ComplexArray) -> ComplexArray:
        return np.asarray(momentum(shapes.real) + 1j * momentum(shapes.imag))

    one, other = (np.array([mode.value for mode in modes]) for modes in (before, after))
    (a, alike), (b, others) = (_shapes(modes, w, weighed) for modes, w in ((before, one), (after, other)))
    assured = (np.abs(way @ weighed(b).T) ** 2 for way in (a.conj(), a))
    same, turned = (np.minimum(alike @ way @ others, 1.0) for way in assured)
    # of changes the squares, over one size for all modes of a shape: they keep their order, also through zero
    either = np.maximum(same, turned)
    size = either @ abs(other) + either @ (either.T @ abs(one)) / (either.sum(axis=1) + _TINY) + _TINY
    apart, through = (
        (np.minimum(abs(other - own[:, None]), size[:, None]) / size[:, None]) ** 2
        for own in (one, one.conj())
    )
    # the other way round it has gone through zero
    slowed = np.clip(one.real[:, None] - other.real, -size[:, None], size[:, None]) / size[:, None]
    plain, other_way = (
        1.0 - way + _NEAR * change + _SLOWER * (other.imag == 0.0) * slowed
        for way, change in ((same, apart), (turned, through))
    )
    way = (other_way < plain) & np.array([mode.kind in ("vibration", "flutter") for mode in after])
    return np.where(way, other_way, plain), way


def _shapes(
    modes: Sequence[Mode], values: ComplexArray, weighed: Callable[[ComplexArray], ComplexArray]
) -> tuple[ComplexArray, Array]:
    """Return shapes (n, n_x) of unit size, and which modes (n, n) are of one eigenvalue.

    Of these any mixture is a mode as well: their shapes are made orthogonal, so that assurances add up.
    """
    shapes = np.array([mode.change for mode in modes])
    apart, sizes = np.abs(values[:, None] - values), np.abs(values)
    one = np.where(apart <= _SAME * np.maximum(sizes[:, None], sizes), 1.0, 0.0)
    for k in range(len(shapes)):
        own, before = shapes[k : k + 1], one[k, :k, None] * shapes[:k]
        for _ in range(2):  # again, for what rounding leaves where they are nearly alike
            own -= (weighed(own) @ before.conj().T) @ before
            own /= np.sqrt((own.conj() @ weighed(own).T).real + np.finfo(float).tiny)
    return shapes, one


def assigned(unlike: Array) -> dict[int, int]:
    """Return which modes (rows) have become which (columns), so that all are the least unlike."""
    from scipy.optimize import linear_sum_assignment

    return dict(zip(*(one.tolist() for one in linear_sum_assignment(unlike)), strict=True))


def mode_between(
    found: Modes, rate: float, ends: Sequence[tuple[float, Mode]], most: float = np.inf
) -> tuple[Mode, bool] | None:
    """Return the mode at a rate that lies between two, and whether it goes round the other way; None if none.

    Larger eigenvalues than the most are not looked at.
    """
    (low, first), (high, last) = ends
    modes = tuple(one for one in found.modes if abs(one.value) <= most)
    if not modes:
        return None
    unlike, turned = how_unlike(found, [first, last], modes)
    j = int(np.argmin([high - rate, rate - low] @ unlike))  # squares of changes: what lies between them
    return modes[j], bool(turned[0, j])
