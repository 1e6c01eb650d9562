"""What matters in a sweep: the mean of what is collected over each entry that is varied."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.studies.sweep.result import Sweep

_MOST = 10
"""Groups of runs along one entry..."""
_FEWEST = 8
"""...each with that many runs."""


def groups(values: Array) -> tuple[Any, list[Any]]:
    """Return the group of each run along one entry, and the entry's mean in each, or its word.

    Few distinct values are groups of their own; others are divided into groups of about as many runs.

    Examples
    --------
    >>> groups(np.array([2.0, 1.0, 2.0]))
    (array([1, 0, 1]), [1.0, 2.0])
    """
    place, distinct = _levels(values)
    if values.dtype == object or len(distinct) <= max(_MOST, 2) or len(values) < 2 * _FEWEST:
        return place, distinct
    count = min(_MOST, len(values) // _FEWEST)
    place = np.argsort(np.argsort(values, kind="stable"), kind="stable") * count // len(values)
    return place, [float(values[place == k].mean()) for k in range(count)]


def _levels(values: Array) -> tuple[Any, list[Any]]:
    """Return which of the values that occur each run has, and these."""
    if values.dtype == object:
        words = list(dict.fromkeys(values.tolist()))
        return np.array([words.index(value) for value in values.tolist()]), words
    distinct, place = np.unique(values, return_inverse=True)
    return place, distinct.tolist()


def main_effects(sweep: Sweep) -> dict[str, dict[str, float | None]]:
    """Return the share of the variance of what is collected that each varied entry explains by itself.

    That is the variance of the means in groups of runs along the entry, over the variance of all.  But for a
    complete grid, whose groups are alike in all else, what as many groups at random would have is taken off.
    """
    levels = {path: _levels(sweep[path]) for path in sweep.paths}
    complete = _is_grid(levels.values(), len(sweep))
    places = {path: (levels[path] if complete else groups(sweep[path]))[0] for path in sweep.paths}
    return {
        name: {path: _share(sweep[name], place, complete) for path, place in places.items()}
        for name in sweep.collected
    }


def _is_grid(levels: Iterable[tuple[Any, list[Any]]], count: int) -> bool:
    """Return whether runs have every combination of the values that occur, each once."""
    number, most = np.zeros(count, dtype=int), 1
    for place, distinct in levels:
        number, most = number * len(distinct) + place, most * len(distinct)
        if most > count:
            return False
    return most == len(np.unique(number)) == count


def _share(values: Array, place: Any, balanced: bool) -> float | None:
    known = ~np.isnan(values)
    balanced = balanced and bool(known.all())
    values, place = values[known], place[known]
    if len(values) < 3 or (spread := float(((values - values.mean()) ** 2).sum())) <= 0.0:
        return None
    sizes = np.bincount(place)
    used = sizes > 0
    means = np.bincount(place, values)[used] / sizes[used]
    between = float(sizes[used] @ (means - values.mean()) ** 2)
    n, k = len(values), int(used.sum())
    if n <= k:
        return None
    random = 1.0 if balanced else (n - 1) / (n - k)
    return float(np.clip(1.0 - random * (1.0 - between / spread), 0.0, 1.0))


def mean_curve(values: Array, place: Any, count: int) -> Array:
    """Return the mean of what is collected in each group, shape (count,); NaN where no run gave anything."""
    known = ~np.isnan(values)
    sizes = np.bincount(place[known], minlength=count)
    with np.errstate(all="ignore"):
        return np.asarray(np.bincount(place[known], values[known], minlength=count) / sizes)
