"""Where modes of a scene that turns begin to grow, between two rates.

What grows has a number of dimensions, two for what swings and one for what goes away.  That changes only
where an eigenvalue comes to the imaginary axis: nothing need be followed to find where, and modes that only
decay, of which two have one shape, cannot be.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice, pairwise
from typing import Any, TypeAlias

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.studies.modes.following import ALIKE, Steady, assigned, how_unlike
from hfsim.studies.modes.found import Mode, Modes

_CLOSE, _TRIES = 1e-3, 16
"""Relative width within which growth begins; how often rates are halved at most."""
_MOST = 24
_End: TypeAlias = tuple[float, Modes]


@dataclass(frozen=True)
class Onset:
    """Where a mode begins to grow by itself, or ceases to.

    Attributes
    ----------
    track : int
        Number of the mode, from one on.
    rate : float
        [rad/s].
    frequency : float
        [Hz].
    above : bool
        Whether it grows above the rate, not below it.
    critical : bool
        Whether its stiffness is lost there: what was held goes away.
    """

    track: int
    rate: float
    frequency: float
    above: bool
    critical: bool = False

    def facts(self) -> dict[str, Any]:
        """Return its numbers."""
        where = "above" if self.above else "below"
        return {"mode": self.track, "rate": self.rate, "frequency": self.frequency, "grows": where}


def onsets(
    rates: Array, founds: Sequence[Modes], tracks: Sequence[Sequence[Mode | None]], steady: Steady
) -> list[Onset]:
    """Return where modes, each at all rates, begin to grow between two rates, or cease to."""
    found = list[Onset]()
    for k, (first, last) in enumerate(pairwise(founds)):
        if not (first.steady and last.steady) or len(found) >= _MOST:
            continue
        ends = sorted(((float(rates[k]), first), (float(rates[k + 1]), last)), key=lambda end: end[0])
        here = [(a, b) if ends[0][1] is first else (b, a) for a, b in (track[k : k + 2] for track in tracks)]
        found += _told(ends[0], ends[1], here, steady)
    return sorted(found, key=lambda one: one.rate)


def _told(
    low: _End, high: _End, tracks: Sequence[tuple[Mode | None, Mode | None]], steady: Steady
) -> Iterator[Onset]:
    """Yield the onsets between two rates, at which all modes are known by their numbers."""
    taken = {True: set[int](), False: set[int]()}
    # what nothing brings back at either end is not what grows between
    kept = [not all(mode and mode.free for mode in pair) for pair in tracks]
    known = pairwise((low, *steady.between(low[0], high[0]), high))
    changes = chain.from_iterable(_changes(*ends, steady, _TRIES) for ends in known)
    for below, beyond in islice(changes, _MOST):
        for mode, partner, above in _of_change(below[1], beyond[1]):
            ends = [pair[above] if may else None for pair, may in zip(tracks, kept, strict=True)]
            number = _number(mode, ends, taken[above])
            if number:
                taken[above].add(number)
                held = tracks[number - 1][not above] or partner
                between = (below, beyond) if above else (beyond, below)
                yield _onset(number, between, mode, partner or mode, not (held and held.free), above)


def _onset(
    number: int, ends: tuple[_End, _End], mode: Mode, before: Mode, was_held: bool, above: bool
) -> Onset:
    share, away = _share(before, mode, ends[1][1]), mode.kind == "divergence" or before.kind == "decay"
    rate, frequency = (
        a + share * (b - a) for a, b in ((ends[0][0], ends[1][0]), (before.frequency, mode.frequency))
    )
    return Onset(number, rate, 0.0 if away else frequency, above, away and was_held)


def _changes(low: _End, high: _End, steady: Steady, tries: int) -> Iterator[tuple[_End, _End]]:
    """Yield rates next to where growth begins or ceases, by halves: it may set in steeply."""
    if not _changed(low[1], high[1]):
        return
    rate, mid = 0.5 * (low[0] + high[0]), None
    if tries and high[0] - low[0] > _CLOSE * abs(rate):  # towards none they would never be close
        mid = steady.maybe_at(rate, low[1].about)
    if mid is None:
        yield low, high
    else:
        yield from _changes(low, (rate, mid), steady, tries - 1)
        yield from _changes((rate, mid), high, steady, tries - 1)


def _changed(low: Modes, high: Modes) -> bool:
    """Tell whether something begins to grow between two rates, or ceases to."""
    return _dimensions(low) != _dimensions(high) or all(_new(*both) for both in ((low, high), (high, low)))


def _dimensions(found: Modes) -> int:
    """Return the number of dimensions in which something grows."""
    return sum(2 if mode.value.imag else 1 for mode in found.unstable)


def _new(before: Modes, after: Modes) -> list[Mode]:
    """Return what grows at a rate and not at another."""
    growing, known = after.unstable, before.unstable
    if not growing or not known:
        return list(growing)
    unlike = how_unlike(after, known, growing)[0]
    same = {j: known[k] for k, j in assigned(unlike).items() if unlike[k, j] < 1.0 - ALIKE}
    new = [mode for j, mode in enumerate(growing) if j not in same]
    if new or _dimensions(after) <= _dimensions(before):
        return new
    # a second motion of one shape has begun to go away, and both swing now
    return [growing[j] for j, one in same.items() if growing[j].value.imag and not one.value.imag]


def _of_change(low: Modes, high: Modes) -> Iterator[tuple[Mode, Mode | None, bool]]:
    """Yield what grows on one side only, what it is on the other, None if not known, and whether above."""
    for above, before, after in ((True, low, high), (False, high, low)):
        for mode in _new(before, after):
            # what was free and is not any more may be what grows
            freed = sum(one.free for one in before.modes) > sum(one.free for one in after.modes)
            others = [one for one in before.modes if not one.unstable and (freed or not one.free)]
            unlike = how_unlike(after, [mode], others)[0][0] if others else np.zeros(0)
            alike = [one for one, by in zip(others, unlike, strict=True) if by < 1.0 - ALIKE]
            partner = min(alike, key=lambda one: abs(one.value - mode.value), default=None)
            # where not all motions are looked at, it may have come from beyond those
            if partner is not None or before.whole:
                yield mode, partner, above


def _number(mode: Mode, ends: Sequence[Mode | None], taken: set[int]) -> int:
    """Return the number of the mode that a growing one is at the next rate, or 0."""
    free = [(k, end) for k, end in enumerate(ends, 1) if end is not None and k not in taken]
    if not free:
        return 0
    unlike = how_unlike(Modes(mode.about, (), None, False), [mode], [end for _, end in free])[0][0]
    # of shapes that are all others', eigenvalues tell
    by = [
        (min(float(one), 1.0 - ALIKE) + (not end.unstable), abs(end.value - mode.value), k)
        for one, (k, end) in zip(unlike, free, strict=True)
    ]
    return min(by)[-1]


def _share(before: Mode, mode: Mode, after: Modes) -> float:
    """Return how far between two rates something begins to grow, over their distance."""
    if not before.value:
        return 0.0
    a, b = before.growth, mode.growth
    if before.value.imag and not mode.value.imag:
        # what is smooth there is the stiffness: the product of both eigenvalues of one shape
        a, b = -abs(before.value) ** 2, b * _return(mode, after)
    return a / (a - b) if a * b < 0.0 else 0.5


def _return(mode: Mode, found: Modes) -> float:
    """Return how fast the other motion of the same shape decays, where one goes away."""
    others = [one for one in found.modes if one.kind == "decay"]
    if not others:
        return mode.growth
    return -others[int(np.argmin(how_unlike(found, [mode], others)[0][0]))].growth
