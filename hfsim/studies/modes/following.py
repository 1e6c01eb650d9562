"""Modes of a scene that turns, followed by their shapes from one rate to another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, BoolArray, ComplexArray
from hfsim.studies.modes.about import turning_at
from hfsim.studies.modes.found import Mode, Modes, modes_of
from hfsim.studies.modes.state import About, ModesError

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
_SURE = 0.3
"""How unlike itself a mode is at most where it is followed for sure: of shapes across it none is as like."""
_CLOSEST, _LOOKED = 2.0**-8, 24
"""Shortest step to be sure, over that between rates that are asked for; rates looked at in one at most."""


class _Became(NamedTuple):
    """What a mode is at the next rate, minus one where it goes round the other way, and whether for sure."""

    mode: Mode | None
    way: int
    sure: bool


@dataclass(eq=False)
class Steady:
    """Modes about the steady rotations of a scene, each of which is found once.

    Attributes
    ----------
    start : About
        A state that turns about the axis.
    count : int
        Modes followed.
    missed : dict of float to str
        Rates [rad/s] at which there are none so far, and why.
    """

    start: About
    count: int
    missed: dict[float, str] = field(default_factory=dict)
    _known: dict[float, Modes] = field(default_factory=dict)

    def at(self, rate: float, near: About) -> Modes:
        """Return those at a rate, sought from another one; at none, about the equilibrium next to it.

        At the rate of a start that is steady they are its own.

        Raises
        ------
        ModesError
            If there is no steady rotation next to that.
        """
        if rate in self.missed:
            raise ModesError(self.missed[rate])
        if rate not in self._known:
            turning = self.start.turning
            if turning is not None and np.isclose(rate, turning.rate, rtol=_SAME) and self.start.lasting:
                near = self.start
            seen = replace(near, motions=replace(near.motions, turning=turning))
            try:
                self._known[rate] = modes_of(turning_at(seen, rate), self.count + SPARE)
            except ModesError as error:
                self.missed[rate] = str(error)
                raise
        return self._known[rate]

    def maybe_at(self, rate: float, near: About) -> Modes | None:
        """Return those at a rate that is not asked for; None where there is no steady rotation."""
        try:
            return self.at(rate, near)
        except ModesError:
            return None

    def between(self, low: float, high: float) -> list[tuple[float, Modes]]:
        """Return steady rates between two at which modes are known by now, from slow to fast, and these."""
        rates = sorted(rate for rate in self._known if low < rate < high)
        return [(rate, self._known[rate]) for rate in rates if self._known[rate].steady]


@dataclass(eq=False)
class Followed:
    """Modes of the first rate, and what else grows at any that is asked for, at rates that follow another.

    Attributes
    ----------
    steady : Steady
    rates : list of float
        So far, with those between others at which modes were looked at to be sure [rad/s].
    founds : list of Modes
        One at each rate.
    tracks : list of list of Mode or None
        Each mode at all rates; None where it is not known.
    senses : list of list of int
        Minus one where it goes round the other way.
    guesses : list of list of int
        How often so far it could but be guessed what it has become.
    """

    steady: Steady
    rates: list[float] = field(default_factory=list)
    founds: list[Modes] = field(default_factory=list)
    tracks: list[list[Mode | None]] = field(default_factory=list)
    senses: list[list[int]] = field(default_factory=list)
    guesses: list[list[int]] = field(default_factory=list)
    _last: list[Mode] = field(default_factory=list)

    def reach(self, rate: float, near: About) -> None:
        """Follow modes to a rate, in steps that are halved until it is sure what each has become.

        Parameters
        ----------
        near : About
            A state next to which the first one is sought.

        Raises
        ------
        ModesError
            If there is no steady rotation there.
        """
        goals, begun, looked = [rate], len(self.rates) - 1, 0
        while goals:
            goal = goals[-1]
            found = self.steady.at(goal, self.founds[-1].about if self.founds else near)
            became = self._next(found) if self.founds else []
            if looked < _LOOKED and not all(one.sure for one in became):
                middle = 0.5 * (self.rates[-1] + goal)
                close = abs(goal - self.rates[-1]) <= _CLOSEST * abs(rate - self.rates[begun])
                # at rest modes are not told apart
                if middle and not close and self._known(middle):
                    goals.append(middle)
                    looked += 1
                    continue
            self._add(goal, found, became, goal == rate)
            goals.pop()

    def _known(self, rate: float) -> bool:
        """Tell whether there is a steady rotation at a rate."""
        found = self.steady.maybe_at(rate, self.founds[-1].about)
        return found is not None and found.steady

    def _add(self, rate: float, found: Modes, became: Sequence[_Became], asked: bool) -> None:
        """Take modes at the next rate; those that begin to grow are followed from one that is asked for."""
        if not self.founds:
            self._begin(found.modes[: self.steady.count])
        for k, one in enumerate(became):
            self.tracks[k].append(one.mode)
            self.senses[k].append(one.way * self.senses[k][-1])
            self.guesses[k].append(self.guesses[k][-1] + (not one.sure))
            self._last[k] = one.mode or self._last[k]
        told = [track[-1] for track in self.tracks]
        self._begin([mode for mode in found.unstable if asked and found.steady and mode not in told])
        self.rates.append(rate)
        self.founds.append(found)

    def _begin(self, modes: Sequence[Mode]) -> None:
        before = len(self.rates)
        self.tracks += [[*[None] * before, mode] for mode in modes]
        self.senses += [[1] * (before + 1) for _ in modes]
        self.guesses += [[0] * (before + 1) for _ in modes]
        self._last += modes

    def _next(self, found: Modes) -> list[_Became]:
        """Return what modes have become."""
        last, before = self._last, self.founds[-1]
        unlike, turned = how_unlike(found, last, found.modes)
        # where all that a scene has is known, before and after, nothing can have come or gone
        whole = all(len(one.modes) < self.steady.count + SPARE for one in (*self.founds, found))
        known = whole and len(found) == len(last)
        # what is refused all the same takes no other mode its own
        chosen = assigned(unlike if known else np.minimum(unlike, 1.0 - ALIKE))
        became = list[_Became]()
        for k, mode in enumerate(last):
            j = chosen.get(k)
            j = j if j is not None and (known or unlike[k, j] < 1.0 - ALIKE) else None
            after = None if j is None else found.modes[j]
            way = -1 if j is not None and turned[k, j] else 1
            sure = j is not None and unlike[k, j] <= min(_SURE, unlike[k].min() + _SAME)
            # what was lost before, does not swing or is one of several alike is not looked for in between
            idle = self.tracks[k][-1] is None or mode.free or not mode.value.imag or _has_twin(mode, before)
            idle = idle or (after is not None and _has_twin(after, found))
            became.append(_Became(after, way, sure or idle or not (before.steady and found.steady)))
        return became


def _has_twin(mode: Mode, found: Modes) -> bool:
    """Tell whether another mode has its eigenvalue, so that any mixture of both is one as well."""
    apart = np.abs(np.array([one.value for one in found.modes]) - mode.value)
    return int(np.count_nonzero(apart <= _SAME * abs(mode.value))) > 1


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
    j = int(np.argmin(np.abs([high - rate, rate - low]) @ unlike))  # squares of changes: what lies between
    return modes[j], bool(turned[0, j])
