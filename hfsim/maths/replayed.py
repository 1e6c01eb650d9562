"""Functions of arrays that are recorded once and replayed from then on."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from math import isfinite
from typing import Any, Generic, TypeVar, cast

import numpy as np

from hfsim.maths import kernel
from hfsim.maths.arrays import Array, magnitude, random_signs
from hfsim.maths.traced import Refused, plain

AGREEING = 1e-7
"""Difference from NumPy, over the largest entry, that is rounding: what is wrong is wrong by far more."""
HALF = 1e-5
"""The same where derivatives come from differences, which keep half the digits."""
ROUNDING = 1e-9
"""The same over the largest coordinate: guesses may be stiff, which amplifies it."""
UNREADABLE = Exception
"""What a recording may fail with: what fails for other reasons does so again in NumPy."""

REACH = 100.0
"""The same over what a change in the last digit makes."""

_Result = TypeVar("_Result")


class Replayed(Generic[_Result]):
    """A function of arrays whose result is an array, or a tuple of some.

    Attributes
    ----------
    refused : Exception or None
        Why it is not replayed.
    """

    def __init__(self, function: Callable[..., _Result]) -> None:
        self._function = function
        self._program: Callable[[], None] | None = None
        self.refused: Exception | None = None if kernel.KERNEL == "native" else Refused("switched off")

    def __call__(self, *given: Any) -> _Result:
        """Return what the function returns."""
        if self.refused is not None:
            return self._function(*given)
        if self._program is None:
            self._record(given)
            if self.refused is not None:
                return self._function(*given)
        return self._again(given)

    def _again(self, given: tuple[Any, ...]) -> _Result:
        assert self._program is not None
        for memory, value in zip(self._inputs, given, strict=True):
            memory[...] = value
        self._renew()
        self._program()
        outputs = tuple([one.copy() for one in self._outputs])
        return cast(_Result, outputs if self._several else outputs[0])

    def _record(self, given: tuple[Any, ...]) -> None:
        from hfsim.maths.recorder import Recorder
        from hfsim.maths.recording import on_tape

        try:
            # NumPy goes first: what is kept when it is first asked for must not be made on the tape
            some = (later(given[0]), *map(shaken, given[1:]))
            expected = _arrays(self._function(*some))
            scale = max(map(magnitude, expected))
            tape = Recorder()
            inputs = [tape.input(np.asarray(one, dtype=float)) for one in given]
            with np.errstate(all="ignore"):
                result = on_tape(tape, partial(self._function, *inputs))
            self._several, outputs = isinstance(result, tuple), _arrays(result)
            tape.cut()
            (self._program,) = tape.programs(*filter(tape.knows, outputs))
            self._renew = tape.renew
            self._inputs, self._outputs = list(map(plain, inputs)), list(map(plain, outputs))
            found = _arrays(self._again(some))
            near = cache(lambda: [_arrays(self._function(*jitters)) for jitters in _jitters(some)])
            for k, (one, other) in enumerate(zip(expected, found, strict=True)):
                agree([one], [other], scale, partial(_farthest, near, k, one))
        except UNREADABLE as why:
            self.refused = why
        except BaseException:
            self._program = None  # it was not compared
            raise


def _arrays(found: Any) -> list[Array]:
    return list(map(np.asarray, found if isinstance(found, tuple) else (found,)))


def _jitters(given: Sequence[Any]) -> Iterator[list[Array]]:
    """Yield what differs in the last digits, in several ways: one number may come out the same by chance."""
    for digits in (1.0, 2.0, 3.0):
        yield [jittered(one, digits) for one in given]


def _farthest(near: Callable[[], Sequence[Sequence[Array]]], k: int, own: Array) -> list[Array]:
    """Return the k-th of results that is farthest from one's own."""
    return [max((found[k] for found in near()), key=lambda one: magnitude(one - own))]


def agree(
    own: Sequence[Array],
    found: Sequence[Array],
    scale: float = 0.0,
    near: Callable[[], Sequence[Array]] | None = None,
    agreeing: float = AGREEING,
) -> None:
    """Refuse what differs from what NumPy finds.

    Parameters
    ----------
    own, found : sequence of ndarray
        Of the same shapes: NumPy's, and those of the recording.
    scale : float
        Size beside which differences are small too.
    near : callable, optional
        What NumPy finds with numbers that differ in their last digit: how far rounding reaches in a stiff
        scene, in any of the results, which then are of one kind.
    agreeing : float
        Difference over the largest entry that is small.
    """
    reach = 0.0 if near is None else None
    for one, other in zip(own, found, strict=True):
        size = magnitude(one)
        if not isfinite(size):
            there = np.isfinite(one)
            if (np.isfinite(other) != there).any():
                raise Refused("other numbers are finite")
            one, other = one[there], other[there]
            size = magnitude(one)
        error = magnitude(one - other)
        if error <= max(agreeing * size, ROUNDING * scale):
            continue
        if reach is None and near is not None:
            pairs = zip(own, near(), strict=True)
            reach = max(magnitude(a - b) for a, b in pairs)
        if not error <= REACH * (reach or 0.0):
            raise Refused(f"{error:.3g} of {size:.3g} differ")


def jittered(a: Any, digits: float = 1.0) -> Array:
    """Return numbers that differ from others in their last digits."""
    return np.asarray(np.multiply(a, 1.0 + digits * 4e-16 * random_signs(np.shape(a))))


def later(t: Any) -> Array:
    """Return times a little after others: turns of angles are counted from the last step on."""
    return np.asarray(np.add(t, 1e-3 * np.abs(t)) + 1e-6)


def shaken(a: Any) -> Array:
    """Return numbers that differ a little from others."""
    return np.asarray(np.multiply(a, 1.0 + 1e-3 * random_signs(np.shape(a))) + 1e-6)


def arrays_in(holder: Any, name: str = "") -> Iterator[tuple[str, Array]]:
    """Yield the numbers that an object consists of, each with its name."""
    if isinstance(holder, np.ndarray):
        if holder.dtype.kind in "fc":
            yield name, holder
    elif isinstance(holder, tuple):
        for k, one in enumerate(holder):
            yield from arrays_in(one, f"{name}.{k}")
    elif getattr(holder, "holds_arrays", False):
        for key, value in vars(holder).items():
            yield from arrays_in(value, f"{name}.{key}")


def rebuilt(holder: Any, change: Callable[[Array], Array] = lambda a: plain(a).copy()) -> Any:
    """Return an object with other arrays: copies without more said."""
    if isinstance(holder, np.ndarray):
        return change(holder) if holder.dtype.kind in "fc" else holder
    if isinstance(holder, tuple):
        parts = [rebuilt(one, change) for one in holder]
        return type(holder)(*parts) if hasattr(holder, "_fields") else tuple(parts)
    if hasattr(holder, "anew"):
        return holder.anew()
    if not getattr(holder, "holds_arrays", False):
        return holder
    found = copy.copy(holder)
    found.__dict__.update({key: rebuilt(value, change) for key, value in vars(holder).items()})
    return found
