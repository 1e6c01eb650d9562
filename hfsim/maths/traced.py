"""Arrays that have a tape write down what is done with them, and what code says to such a tape."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import numpy as np

from hfsim.maths.arrays import Array, ComplexArray, IntArray
from hfsim.maths.kernel import replay
from hfsim.maths.matrices import Matrix, dense, is_sparse

_Kind = TypeVar("_Kind", Array, ComplexArray)
Written: Any = type("Written", (), {}) if replay is None else replay.Written


class Refused(Exception):  # noqa: N818
    """What cannot be recorded."""


class _Recording(threading.local):
    tape: Any = None


Recording = _Recording()
"""The tape on which this thread records, if any."""


def recorder() -> Any:
    """Return the tape that records."""
    if Recording.tape is None:
        raise Refused("nothing records")
    return Recording.tape


class Traced(Written, np.ndarray):  # type: ignore[misc]
    """An array in the memory of a tape: what is common with it is written down natively."""

    __array_priority__ = 1e9

    def _rare_ufunc(self, ufunc: Any, method: str, *inputs: Any, out: Any = None, **how: Any) -> Any:
        return recorder().ufunc(ufunc, method, inputs, None if out is None else out[0], how)

    def _rare_take(self, key: Any) -> Any:
        return recorder().take(self, key)

    def _rare_put(self, key: Any, value: Any) -> None:
        recorder().put(self, key, value)

    def __pow__(self, exponent: Any) -> Any:  # type: ignore[override]
        """Write down a power: products take less time."""
        return self * self * self if exponent == 3 else super().__pow__(exponent)

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        """Write down a function of NumPy."""
        return recorder().function(func, args, kwargs)

    def __iter__(self) -> Iterator[Any]:
        return (self[k] for k in range(len(self)))

    def __copy__(self) -> Any:
        return self.copy()

    def reshape(self, *shape: Any, **how: Any) -> Any:
        """Return a view, or one of a copy."""
        found = super().reshape(*shape, **how)
        if recorder().knows(found):
            return found
        if how.get("order", "C") != "C":
            raise Refused("an order of entries")
        return self.copy().reshape(*shape)

    def ravel(self, order: Any = "C") -> Any:
        """Return a view, or one of a copy."""
        return self.reshape(-1, order=order)

    def flatten(self, order: Any = "C") -> Any:
        """Return a copy."""
        return self.copy().reshape(-1, order=order)

    def astype(self, dtype: Any, **how: Any) -> Any:  # type: ignore[override]
        """Write down a copy."""
        found = recorder().cast(self, np.dtype(dtype))
        return self.copy() if found is self else found

    def take(  # type: ignore[override]
        self, indices: Any, axis: int | None = None, **how: Any
    ) -> Any:
        """Write down a selection."""
        if how:
            raise Refused("take")
        if axis is None:
            return self.reshape(-1)[np.asarray(indices)]
        return recorder().take(self, (slice(None),) * (axis % self.ndim) + (np.asarray(indices),))

    def dot(self, other: Any) -> Any:  # type: ignore[override]
        """Write down a product."""
        return recorder().function(np.dot, (self, other), {})

    def sum(self, axis: Any = None, *args: Any, **how: Any) -> Any:
        """Write down a sum."""
        return recorder().reduce(np.add, self, axis, *args, **how)

    def max(self, axis: Any = None, **how: Any) -> Any:  # type: ignore[override]
        """Write down the largest entries."""
        return recorder().reduce(np.maximum, self, axis, **how)

    def min(self, axis: Any = None, **how: Any) -> Any:  # type: ignore[override]
        """Write down the smallest entries."""
        return recorder().reduce(np.minimum, self, axis, **how)

    def repeat(self, repeats: Any, axis: int | None = None) -> Any:  # type: ignore[override]
        """Write down a selection."""
        if axis is None:
            return self.reshape(-1).repeat(repeats, 0)
        axis %= self.ndim
        if isinstance(repeats, int) and self.shape[axis] == 1:
            shape = (*self.shape[:axis], repeats, *self.shape[axis + 1 :])
            return recorder().filled(shape, self.itemsize, self)
        return self.take(np.repeat(np.arange(self.shape[axis]), repeats), axis)

    def fill(self, value: Any) -> None:
        """Write down that all entries are set."""
        self[...] = value

    def _refuse(self, *args: Any, **how: Any) -> Any:
        raise Refused("a value of the state decides")

    __bool__ = __float__ = __int__ = __complex__ = __index__ = __contains__ = _refuse
    item = tolist = tobytes = nonzero = sort = argsort = argmax = argmin = resize = put = _refuse
    trace = setfield = tofile = getfield = _refuse
    flat = property(_refuse)
    real = property(np.ndarray.real.__get__, lambda self, value: self.real.__setitem__(..., value))
    imag = property(np.ndarray.imag.__get__, lambda self, value: self.imag.__setitem__(..., value))
    cumsum = cumprod = choose = compress = partition = searchsorted = prod = byteswap = dump = _refuse


def apart(function: Callable[..., None], *args: Any) -> None:
    """Do what writes into its last argument; while a tape records, as a call of Python if it is refused."""
    tape, out = Recording.tape, args[-1]
    if tape is None or not tape.knows(out):
        function(*args)
        return
    try:
        with tape.attempt():
            function(*args)
    except Refused:
        aside(function, *args)


def aside(function: Callable[..., None], *args: Any) -> None:
    """Do what writes into its last argument; while a tape records, as a call of Python at every replay."""
    tape = Recording.tape
    if tape is None:
        function(*args)
        return
    memory = [plain(a) if isinstance(a, np.ndarray) else a for a in args]
    tape.told.append(function.__qualname__)
    tape.call(lambda: function(*memory), *(a for a in memory if isinstance(a, np.ndarray)))


def outside(function: Callable[..., Array], *args: Any) -> Array:
    """Return an array that a function returns; while a tape records, the function is a call of Python."""
    tape = Recording.tape
    if tape is None or not any(isinstance(a, np.ndarray) and tape.knows(a) for a in args):
        return function(*args)
    return np.asarray(tape.called(function, args, {}))


def changeable(a: _Kind) -> _Kind:
    """Return a copy of which parts are to be changed; a tape holds it, also where it is constant."""
    tape = Recording.tape
    copy: _Kind = a.copy() if tape is None or isinstance(a, Traced) else tape.filled(a.shape, a.itemsize, a)
    return copy


def product(matrix: Matrix, a: Array) -> Array:
    """Return a product with a matrix; a tape knows itself which of its entries are zero."""
    if is_sparse(matrix):
        if Recording.tape is None:
            return np.asarray(matrix @ a)
        matrix = Recording.tape.plainly(dense, matrix)
    return np.asarray(np.dot(matrix, a))


def row_products(a: Array, some: IntArray, b: Array, others: IntArray) -> Array:
    """Return products of rows (n,) of two matrices, or sums of groups of them (m, n).

    Rows that occur in several products are copied first: the products are then long and plain.
    """
    tape = Recording.tape
    if tape is not None and tape.knows(a):
        groups = len(some) if some.ndim == 2 else 1
        written: Array = tape.core.row_products(a, some.ravel(), b, others.ravel(), groups)
        return written
    found = a.take(some, axis=0)
    found *= b.take(others, axis=0)
    return found if some.ndim == 1 else np.add.reduce(found, axis=0)


def live(a: Array) -> Array:
    """Return an array that others change in place; while a tape records, what it is at every replay."""
    tape = Recording.tape
    return a if tape is None else np.asarray(tape.live(a))


def sometimes(condition: Any) -> bool:
    """Tell whether a condition holds anywhere; as far as a tape knows that records, it may."""
    if isinstance(condition, Traced):
        recorder().core.waive(condition)
        return True
    return bool(np.any(condition))


def is_traced(a: Any) -> bool:
    """Tell whether something is traced, or a list with something traced in it."""
    return isinstance(a, Traced) or (isinstance(a, list | tuple) and any(map(is_traced, a)))


def plain(a: Any) -> np.ndarray:
    """Return an array as NumPy's own type, on the same memory."""
    return a.view(np.ndarray) if isinstance(a, np.ndarray) else np.array(a)
