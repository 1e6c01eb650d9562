"""Functions of many states, replayed natively for some at once where that pays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from hfsim.integrators import Recordings
from hfsim.maths.arrays import Array
from hfsim.mechanics.projection import Through, Weakly, directly


class Replaying:
    """Applies functions to states, so many at once as recordings are made for.

    Parameters
    ----------
    recordings : Recordings
        Where these are kept.
    size : int
        Number of states at once.
    calls : int
        How often functions are called for so many: where that does not pay all states are taken at once, and
        where a function cannot be recorded.
    n : int
        Number of coordinates.
    """

    def __init__(self, recordings: Recordings, size: int, calls: int, n: int) -> None:
        self._recordings, self._size = recordings, size
        self._native = recordings.pay(calls, n)

    @property
    def through(self) -> Through:
        """What functions of so many states are called through, by their names."""
        # recordings keep what they are made of, and this keeps them
        return Weakly(self._called) if self._native else directly

    def _called(self, name: str, function: Callable[..., Any], given: tuple[Any, ...]) -> Any:
        if not self._native:
            return function(*given)
        found = self._recordings.replayed(name, function)
        result = found(*given)
        self._native = found.refused is None
        return result

    def over(self, function: Callable[..., tuple[Array, Array]], *given: Array) -> tuple[Array, Array]:
        """Return both results of a function of states, whose own functions are called through this."""
        done, count, found = 0, len(given[0]), list[tuple[Array, Array]]()
        while done < count:
            part = slice(done, done + self._size if self._native else count)
            found.append(function(*(one[part] for one in given)))
            done = part.stop
        one, other = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return one, other
