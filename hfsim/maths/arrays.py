"""Array types, as the whole package writes them, and what NumPy does at the price of a long import."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, TypeAlias, TypeVar

import numpy as np

Array: TypeAlias = np.ndarray[Any, np.dtype[np.floating[Any]]]
ComplexArray: TypeAlias = np.ndarray[Any, np.dtype[np.complexfloating[Any, Any]]]
BoolArray: TypeAlias = np.ndarray[Any, np.dtype[np.bool_]]
IntArray: TypeAlias = np.ndarray[Any, np.dtype[np.integer[Any]]]
Places: TypeAlias = slice | IntArray


def run_of(places: IntArray) -> Places:
    """Return places as a slice where they stand at equal distances: indexing by it is far quicker.

    Examples
    --------
    >>> run_of(np.array([3, 5, 7])), run_of(np.array([1, 2, 4]))
    (slice(3, 8, 2), array([1, 2, 4]))
    """
    every = places.tolist()
    step = every[1] - every[0] if len(every) > 1 else 1
    if not every or step < 1 or every != list(range(every[0], every[-1] + 1, step)):
        return places
    return slice(every[0], every[-1] + 1, step)


AT_ONCE, IN_CACHE = (64, 512), 1e6
"""Least and most states in a batch, and squares of coordinates in it: more numbers would be fetched from
memory over and over."""


def at_once(n: int) -> int:
    """Return how many states of n coordinates are looked at in a batch."""
    return int(np.clip(IN_CACHE / max(1, n) ** 2, *AT_ONCE))


def slices(count: int, most: int) -> list[slice]:
    """Return slices that have all of so many things, each of them at least one and at most so many.

    Examples
    --------
    >>> slices(5, 2)
    [slice(0, 2, None), slice(2, 4, None), slice(4, 5, None)]
    """
    most = max(1, most)
    return [slice(first, min(first + most, count)) for first in range(0, count, most)]


_Numbers = TypeVar("_Numbers", Array, IntArray)
_Factors = TypeVar("_Factors", Array, ComplexArray)


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


@lru_cache(maxsize=16)
def random_signs(shape: tuple[int, ...]) -> Array:
    """Return -1 and 1 in no order, always the same: `numpy.random` would take long to import."""
    import random

    bits = np.frombuffer(random.Random(0).randbytes(math.prod(shape)), dtype=np.uint8) & 1
    signs = np.asarray(2.0 * bits - 1.0).reshape(shape)
    signs.flags.writeable = False
    return signs


def magnitude(values: Array) -> float:
    """Return the largest absolute value; 0 where there is none."""
    return float(np.abs(values).max(initial=0.0))


def are_finite(a: Array, b: Array) -> bool:
    """Tell whether all entries of two arrays (n,) are finite.

    Examples
    --------
    >>> [are_finite(np.array([0.0, 1.0]), np.array([0.0, last])) for last in (1.0, np.nan, np.inf)]
    [True, False, False]
    """
    return math.isfinite(a.dot(b)) or bool(np.isfinite(a).all() and np.isfinite(b).all())


def on_components(factors: _Factors, n_dim: int) -> _Factors:
    """Return what factors (n,) or (m, n) of numbers are for vectors, (n_dim, n n_dim) or (m n_dim, n n_dim).

    The same as a Kronecker product with a unit matrix, in a tenth of the time.
    """
    blocks = factors[..., None, :, None] * np.eye(n_dim)[:, None]
    found: _Factors = blocks.reshape(math.prod(factors.shape[:-1]) * n_dim, factors.shape[-1] * n_dim)
    return found


def component_rows(V: Array) -> Array:
    """Return vectors (..., n_elements, n_vectors, n_dim) as (n_vectors, n_dim, n_elements * n_states)."""
    return V.T.swapaxes(0, 1).reshape(*V.shape[-2:], -1)


def cumulative(values: Array, places: Array) -> Array:
    """Return the integral from the first place up to each, by the trapezoidal rule along the first axis.

    Examples
    --------
    >>> cumulative(np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 3.0]))
    array([0. , 0.5, 3.5])
    """
    steps = 0.5 * (np.diff(places) * (values[1:] + values[:-1]).T).T
    return np.concatenate([np.zeros_like(values[:1]), np.cumsum(steps, axis=0)])
