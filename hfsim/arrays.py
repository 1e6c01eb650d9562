"""Array types, as the whole package writes them, and what NumPy does at the price of a long import."""

from __future__ import annotations

import math
import random
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.floating[Any]]
ComplexArray: TypeAlias = NDArray[np.complexfloating[Any, Any]]
BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.integer[Any]]

_Numbers = TypeVar("_Numbers", Array, IntArray)


def distinct(values: _Numbers) -> _Numbers:
    """Return the values that occur, sorted, shape (n,): `numpy.unique` would import all masked arrays.

    Examples
    --------
    >>> distinct(np.array([[3, 1], [1, 2]]))
    array([1, 2, 3])
    """
    ordered = np.sort(values, axis=None)
    new = np.ones(len(ordered), dtype=bool)
    new[1:] = ordered[1:] != ordered[:-1]
    return ordered[new]


def random_signs(shape: tuple[int, ...]) -> Array:
    """Return -1 and 1 in no order, always the same: `numpy.random` would take long to import."""
    bits = np.frombuffer(random.Random(0).randbytes(math.prod(shape)), dtype=np.uint8) & 1
    return np.asarray(2.0 * bits - 1.0).reshape(shape)
