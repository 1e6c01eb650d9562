"""Small motions about a periodic one, by Floquet's theory.

What is next to a periodic motion is after a period what a matrix, the monodromy, makes of it: its eigenvalues
are the multipliers exp(value T).  The matrix is found by runs over a period, from states next to the start of
the motion, and with it that start itself: by shooting, with Newton's method for slow motions, while what is
fast goes on from where it has come to (Newton-Picard method of Lust and Roose).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from hfsim.errors import ArgumentError, DeckError
from hfsim.marching.stop import Progress, nobody
from hfsim.maths.arrays import Array, ComplexArray, IntArray
from hfsim.scene.build import Scene, build
from hfsim.scene.loading import LoadedDeck
from hfsim.studies.modes.found import Mode, Modes, check_count, kind_of
from hfsim.studies.modes.next_to import NextTo
from hfsim.studies.modes.state import ModesError, after

FEW = 24
"""Motions up to which all slow ones are looked at."""
_SOLVE = {"tolerance": 1e-11, "step": None, "max_steps": None}
"""How runs over a period are solved."""
_CLOSED, _CLOSED_NEARLY = 1e-8, 1e-6
"""Distance after a period, over the size, that is none; the same where iterations come no nearer."""
_MOST, _HALVES = 20, 6
"""Iterations, and how often a step is halved in one."""
_FREE = 1e-6
"""What a period changes of numbers, relative, that is nothing."""
_FLOOR, _ERROR, _ROOTS = 1e-9, 1e-7, 10.0
"""Least error of the monodromy over its size, that of differences, and factor on what its root does."""
_SURE, _FADED, _FAINT = 2.0, 10.0, 0.1
"""Factor on what a multiplier changes by where its own motion is followed; size of one, over its error, up to
which it is not known; size up to which one that is not known has faded."""
_TIMES = 8
"""Times in a period at which it is asked whether the same acts a period later."""


def periodic(
    loaded: LoadedDeck, period: float, count: int, at: float | None = None, progress: Progress | None = None
) -> Modes:
    """Return the slowest modes about the periodic motion next to a state, and those of them that grow.

    Parameters
    ----------
    period : float
        [s].
    at : float, optional
        Time of a run at which that state is [s]; the start without it.

    Raises
    ------
    ArgumentError
        If that is no period or no time, or no mode is wanted.
    DeckError
        If the scene cannot be assembled, or a law has no value somewhere until then.
    ModesError
        If a run over a period ends early, with its exit code, or no periodic motion is found.
    KeyboardInterrupt
        If a signal ends a run.
    """
    check_count(count)
    if not 0.0 < period < np.inf:
        raise ArgumentError(f"{period:g} s is no period: it must be greater than zero")
    begin, times = at or 0.0, period * np.linspace(0.0, 1.0, _TIMES, endpoint=False)
    try:
        deck = loaded.until(begin + 2.0 * period)
    except DeckError:  # of what has no value so late nothing is known but at the ends
        deck, times = loaded.until(begin + period), times[:1]
    scene = build(deck.with_solve({"duration": begin + period, **_SOLVE}))
    tell, q, v = progress or nobody, scene.q, scene.v
    if at:
        q, v = _run_before(scene, loaded, begin, _part(tell, 0))
        tell = _part(tell, 1)
    near = NextTo.of(scene, q, v, begin, period, max(FEW, 2 * count))
    if not near.motions.pencil.free:
        return Modes(near.about, (), True, True)
    near, monodromy, before = _closed(near, tell)
    changed = replace(near.about, changed=near.changed(begin + times))
    return _modes(replace(near, about=changed), monodromy, before, count)


def _run_before(
    scene: Scene, loaded: LoadedDeck, begin: float, progress: Progress
) -> tuple[Array, Array]:
    """Return the state (q, v) of a run at a time, solved as the deck says; the scene knows its turns then."""
    if any(part.events for part in scene.system.forces):
        raise ModesError("latches and springs that let go begin anew: --period goes without --at here")
    return after(scene, begin, progress, loaded.deck.solve.model_copy(update={"duration": begin}))


def _becoming(near: NextTo, progress: Progress) -> Array:
    """Return what becomes of each number in a period, (2, n_z, 2 r)."""
    found = []
    for k, vector in enumerate(np.eye(2 * near.number)):
        found.append(near.become(vector))
        progress((k + 1) / (2 * near.number))
    return np.stack(found, axis=-1)


def _closed(near: NextTo, progress: Progress) -> tuple[NextTo, Array, Array]:
    """Return the start of the periodic motion, its monodromy and, where fast motions follow, one before."""
    for k in range(_MOST + 1):
        becoming = _becoming(near, _part(progress, k))
        monodromy, (gap, size) = near.numbers(becoming), near.gap
        if size > _CLOSED:
            step = np.linalg.lstsq(monodromy - np.eye(len(gap)), -gap, rcond=_FREE)[0]
            nearer = _nearer(near, step) if k < _MOST else None
            if nearer is not None:
                near = nearer
                continue
            if size > _CLOSED_NEARLY:
                raise _nothing(near, k)
        if near.all:
            return near, monodromy, monodromy
        near = near.followed(becoming)
        return near, near.numbers(_becoming(near, _part(progress, k + 1))), monodromy
    raise AssertionError


def _part(progress: Progress, k: int) -> Progress:
    """Return what tells the share of all that is done from that of an iteration."""
    return lambda share: progress(1.0 - 0.5**k * (1.0 - 0.5 * share))


def _nearer(near: NextTo, step: Array) -> NextTo | None:
    """Return a state from which the motion closes better; None if there is none along a step."""
    ways = (False,) if near.all else (True, False)
    for k, settled in product(range(_HALVES), ways):
        try:
            found = near.at(step * 0.5**k, settled)
            if found.gap[1] < 0.9 * near.gap[1]:
                return found
        except (ModesError, np.linalg.LinAlgError):
            continue
    return None


def _nothing(near: NextTo, iterations: int) -> ModesError:
    about = near.about
    where = f"the run at {about.t:.6g} s" if about.t else "the start"
    return ModesError(
        f"no motion of period {near.period:.6g} s was found next to {where}: after {iterations} iterations "
        f"one is still {near.gap[1] * about.size:.3g} m from where it began (mean square by mass, rates "
        "counted too); is that the period of all laws and drivers? --at T begins at the state of a run, "
        "--count has more motions move, and damping ends what the start sets off"
    )


def _modes(near: NextTo, monodromy: Array, before: Array, count: int) -> Modes:
    """Return the modes that multipliers are of."""
    some = _multipliers(near, monodromy, before, count)
    found = sorted(_exponents(some, near.period), key=lambda one: (abs(one[0]), -one[0].real))
    modes = []
    for number, (value, uncertainty, doubled, vector) in enumerate(found, 1):
        if number <= count or value.real > 0.0:
            kind, change = kind_of(value, doubled), near.displacements @ vector
            modes.append(Mode(number, kind, value, uncertainty, change, near.about))
    return Modes(near.about, tuple(modes), some.complete, near.all and some.complete)


class _Multipliers(NamedTuple):
    """Multipliers that are told, (k,).

    Attributes
    ----------
    off : ndarray, shape (k,)
        Their errors.
    vectors : ndarray of complex, shape (r, k)
        Displacements.
    complete : bool
        Whether all that do not fade are known.
    """

    values: ComplexArray
    off: Array
    vectors: ComplexArray
    complete: bool


def _multipliers(near: NextTo, monodromy: Array, before: Array, count: int) -> _Multipliers:
    """Return the slowest multipliers and those that grow."""
    values, vectors = (one.astype(complex) for one in np.linalg.eig(monodromy))
    left, size = np.linalg.pinv(vectors), max(1.0, float(np.abs(monodromy).max()))
    # of two that are one with one motion, as of what goes on by itself, an error moves each by its root
    most = _ROOTS * np.sqrt(_ERROR) * size
    off = np.minimum(_FLOOR * size * np.linalg.norm(left, axis=1), most)
    off += np.abs(values[:, None] - np.linalg.eigvals(before)).min(axis=1)
    told, slow = _told(values, off, count, most)
    for k in told:
        missing = left[k] @ (_becomes(near, vectors[:, k]) - values[k] * vectors[:, k])
        values[k] += missing if abs(missing) <= most else 0.0
        off[k] += _SURE * abs(missing)
    sizes, errors = np.abs(values[told]), off[told]
    known = sizes > _FADED * errors
    kept = told[known & ((np.arange(len(told)) < slow) | (sizes > 1.0 + errors))]
    complete = bool((known | (sizes < _FAINT)).all())
    return _Multipliers(values[kept], off[kept], vectors[: near.number, kept], complete)


def _exponents(
    found: _Multipliers, period: float
) -> Iterator[tuple[complex, float, bool, ComplexArray]]:
    """Yield values [1/s], their uncertainties, whether they count twice, and displacements (r,)."""
    still = np.abs(found.values - 1.0) <= found.off
    often = int(np.sum(1 + (found.values[still].imag > 0.0)))
    yield from _free(found.vectors[:, still], often, float(found.off[still].max(initial=0.0)) / period)
    for k in np.flatnonzero(~still):
        multiplier = complex(found.values[k])
        value, uncertainty = complex(np.log(multiplier)) / period, float(found.off[k]) / period
        uncertainty /= abs(multiplier)
        parts = (one if abs(one) > uncertainty else 0.0 for one in (value.real, value.imag))
        yield complex(*parts), uncertainty, False, found.vectors[:, k]


def _told(multipliers: ComplexArray, off: Array, count: int, free: float) -> tuple[IntArray, int]:
    """Return which multipliers are known, of the slowest motions and of what may grow; of a pair one.

    How many are of slow motions comes second.  Two that may be one, so near to it, are of one motion.
    """
    size = np.abs(multipliers)
    known = np.flatnonzero(((size > _FADED * off) | (size > 1.0)) & (multipliers.imag >= 0.0))
    order = known[np.argsort(np.abs(np.log(multipliers[known])), kind="stable")]
    own = multipliers[order]
    motions = np.where((own.imag == 0.0) & (np.abs(own - 1.0) <= free), 0.5, 1.0)
    slow = int(np.sum(np.cumsum(motions) - motions < count))
    return order[(np.arange(len(order)) < slow) | (np.abs(own) > 1.0 + off[order])], slow


def _becomes(near: NextTo, vector: ComplexArray) -> ComplexArray:
    """Return what becomes of a vector of numbers in a period, by half as large ones."""
    parts = [vector.real, vector.imag] if np.any(vector.imag) else [vector.real]
    found = [near.numbers(near.become(part, 0.5)) for part in parts]
    return np.asarray(found[0] + 1j * (found[1] if len(found) > 1 else 0.0))


def _free(
    vectors: ComplexArray, often: int, uncertainty: float
) -> Iterator[tuple[complex, float, bool, ComplexArray]]:
    """Yield the motions that are the same after a period; those go on by themselves that count twice."""
    if not often:
        return
    left, sizes, _ = np.linalg.svd(np.hstack([vectors.real, vectors.imag]), full_matrices=False)
    kept = left[:, sizes > 1e-3 * sizes[0]][:, :often].astype(complex)
    for k, vector in enumerate(kept.T):
        yield 0j, uncertainty, k < often - kept.shape[1], vector
