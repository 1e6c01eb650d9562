"""Results as columns: arrays by name, and a frame of pandas of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, KeysView, Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar

from hfsim.deck.source import did_you_mean

if TYPE_CHECKING:
    from hfsim.maths.arrays import Array


class Columns:
    """A result that has ``columns``, an array each by name; ``result["cpu_s"]`` is one of them.

    ``name in result``, ``for name in result`` and ``dict(result)`` are as those of a dictionary of them.
    """

    _called: ClassVar[str] = "column"
    """What one of them is called."""

    columns: Mapping[str, Array]

    def keys(self) -> KeysView[str]:
        """Return the names of all columns."""
        return self.columns.keys()

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __getitem__(self, name: str) -> Array:
        """Return a column, a value for each row.

        Raises
        ------
        KeyError
            If there is none of that name.
        """
        columns = self.columns
        if name not in columns:
            hint = did_you_mean(str(name), list(columns))
            raise KeyError(f"no {self._called} '{name}': {hint}")
        return columns[name]

    def to_dataframe(self) -> Any:
        """Return the columns as a pandas DataFrame.

        Raises
        ------
        ImportError
            If pandas is not installed: hfsim does not need it.
        """
        pandas: Any = import_module("pandas")
        return pandas.DataFrame(dict(self.columns))


def as_columns(rows: Sequence[Mapping[str, object]], names: Iterable[str] = ()) -> dict[str, Array]:
    """Return rows of the same keys as columns: of numbers, None is NaN there, or of objects.

    Where there are no rows, the columns are empty, and of these names.

    Examples
    --------
    >>> as_columns([{"method": "gauss", "error": 0.5}, {"method": "gear", "error": None}])
    {'method': array(['gauss', 'gear'], dtype=object), 'error': array([0.5, nan])}
    """
    return {key: _column([row[key] for row in rows]) for key in (rows[0] if rows else names)}


def _column(values: Sequence[object]) -> Array:
    import numpy as np

    if all(isinstance(value, int | float | None) and not isinstance(value, bool) for value in values):
        return np.array([math.nan if value is None else value for value in values], dtype=float)
    found = np.empty(len(values), dtype=object)
    found[:] = values
    return found
