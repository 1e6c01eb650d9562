"""Functions of many states, replayed natively for some at once where that pays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from hfsim.integrators import Recordings
from hfsim.maths.arrays import Array


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

    def over(
        self, name: str, function: Callable[..., tuple[Array, Array]], *given: Array
    ) -> tuple[Array, Array]:
        """Return both results of a function of states, which has a name of its own."""
        done, count, found = 0, len(given[0]), list[tuple[Array, Array]]()
        while done < count:
            part = slice(done, done + self._size if self._native else count)
            found.append(self._called(name, function, [one[part] for one in given]))
            done = part.stop
        one, other = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return one, other

    def _called(self, name: str, function: Callable[..., Any], given: list[Array]) -> Any:
        if not self._native:
            return function(*given)
        found = self._recordings.replayed(f"{name} of {len(given[0])} states", function)
        result = found(*given)
        self._native = found.refused is None
        return result
