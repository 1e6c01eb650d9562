"""What matters in a sweep: the mean of what is collected over each entry that is varied."""

from __future__ import annotations

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
    if values.dtype == object:
        words = list(dict.fromkeys(values.tolist()))
        return np.array([words.index(value) for value in values.tolist()]), words
    distinct, place = np.unique(values, return_inverse=True)
    if len(distinct) <= max(_MOST, 2) or len(values) < 2 * _FEWEST:
        return place, distinct.tolist()
    count = min(_MOST, len(values) // _FEWEST)
    place = np.argsort(np.argsort(values, kind="stable"), kind="stable") * count // len(values)
    return place, [float(values[place == k].mean()) for k in range(count)]


def main_effects(sweep: Sweep) -> dict[str, dict[str, float | None]]:
    """Return the share of the variance of what is collected that each varied entry explains by itself.

    That is the variance of the means in groups of runs along the entry, less what as many groups at random
    would have, over the variance of all.
    """
    places = {path: groups(sweep[path])[0] for path in sweep.paths}
    return {
        name: {path: _share(sweep[name], place) for path, place in places.items()} for name in sweep.collected
    }


def _share(values: Array, place: Any) -> float | None:
    known = ~np.isnan(values)
    values, place = values[known], place[known]
    if len(values) < 3 or (spread := float(((values - values.mean()) ** 2).sum())) <= 0.0:
        return None
    sizes = np.bincount(place)
    used = sizes > 0
    means = np.bincount(place, values)[used] / sizes[used]
    within = spread - float(sizes[used] @ (means - values.mean()) ** 2)
    n, k = len(values), int(used.sum())
    if n <= k:
        return None
    return float(np.clip(1.0 - (within / (n - k)) / (spread / (n - 1)), 0.0, 1.0))


def mean_curve(values: Array, place: Any, count: int) -> Array:
    """Return the mean of what is collected in each group, shape (count,); NaN where no run gave anything."""
    known = ~np.isnan(values)
    sizes = np.bincount(place[known], minlength=count)
    with np.errstate(all="ignore"):
        return np.asarray(np.bincount(place[known], values[known], minlength=count) / sizes)
