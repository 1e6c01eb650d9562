"""Results of studies as columns: arrays by name, and a frame of pandas of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

import numpy as np

from hfsim.deck.source import did_you_mean
from hfsim.maths.arrays import Array


class Columns:
    """A result that has ``columns``, an array each by name; ``result["cpu_s"]`` is one of them."""

    columns: Mapping[str, Array]

    def __getitem__(self, name: str) -> Array:
        """Return a column, a value for each row.

        Raises
        ------
        KeyError
            If there is none of that name.
        """
        if name not in self.columns:
            raise KeyError(f"no column '{name}': {did_you_mean(name, list(self.columns))}")
        return self.columns[name]

    def to_dataframe(self) -> Any:
        """Return the columns as a pandas DataFrame.

        Raises
        ------
        ImportError
            If pandas is not installed: hfsim does not need it.
        """
        pandas: Any = import_module("pandas")
        return pandas.DataFrame(dict(self.columns))


def as_columns(rows: Sequence[Mapping[str, object]]) -> dict[str, Array]:
    """Return rows of the same keys as columns: of numbers, None is NaN there, or of objects.

    Examples
    --------
    >>> as_columns([{"method": "gauss", "error": 0.5}, {"method": "gear", "error": None}])
    {'method': array(['gauss', 'gear'], dtype=object), 'error': array([0.5, nan])}
    """
    return {key: _column([row[key] for row in rows]) for key in (rows[0] if rows else ())}


def _column(values: Sequence[object]) -> Array:
    if all(isinstance(value, int | float | None) and not isinstance(value, bool) for value in values):
        return np.array([math.nan if value is None else value for value in values], dtype=float)
    found = np.empty(len(values), dtype=object)
    found[:] = values
    return found
