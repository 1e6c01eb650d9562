"""Functions of NumPy as tapes know them, and the recording itself: see `hfsim.maths.tape`."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from functools import reduce
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from hfsim.maths.kernel import replay
from hfsim.maths.recorder import WHERE, Recorder, codes
from hfsim.maths.tape import CODES, COMPLEX, REAL
from hfsim.maths.traced import Recording, Refused, Traced, is_traced, plain, recorder

_Result = TypeVar("_Result")
LONGEST_SUM = 32
"""Terms of a cumulative sum that are written down one by one."""
MOST_LETTERS = 5
"""Axes of a product that is summed which are written down."""
LARGE = 120
"""Linear equations from which LAPACK, called from Python, is faster."""


def _concatenate(tape: Recorder, arrays: Any, axis: int = 0, out: Any = None, **how: Any) -> Any:
    if out is not None:
        raise Refused("joined into an array")
    arrays = list(map(np.asarray, arrays))
    return tape.core.join(axis % arrays[0].ndim, arrays)


def _stack(tape: Recorder, arrays: Any, axis: int = 0, out: Any = None, **how: Any) -> Any:
    if out is not None:
        raise Refused("joined into an array")
    arrays = list(map(np.asarray, arrays))
    axis %= arrays[0].ndim + 1
    place = (*(slice(None),) * axis, None)
    return tape.core.join(axis, [one[place] for one in arrays])


def _where(tape: Recorder, condition: Any, x: Any, y: Any) -> Any:
    return tape.core.apply(*WHERE, None, condition, x, y)


def _dot(tape: Recorder, a: Any, b: Any) -> Any:
    if {a.ndim, b.ndim} - {1, 2}:
        raise Refused("a product of such shapes")
    return tape.core.matmul(None, a, b)


def _einsum(tape: Recorder, subscripts: str, *operands: Any, **how: Any) -> Any:
    given, arrow, kept = subscripts.partition("->")
    letters = kept + "".join(sorted({*given} - {*kept, ","}))
    if "." in given or not arrow or len(letters) > MOST_LETTERS or how.keys() - {"optimize"}:
        return tape.called(np.einsum, (subscripts, *operands), how)

    def spread(own: str, a: Any) -> Any:
        ordered = np.transpose(a, [own.index(one) for one in letters if one in own])
        return ordered[tuple([slice(None) if one in own else None for one in letters])]

    product = reduce(np.multiply, map(spread, given.split(","), operands))
    return product.sum(axis=tuple(range(len(kept), len(letters))))


def _cumsum(tape: Recorder, a: Any, axis: int | None = None) -> Any:
    if axis is None or a.shape[axis] > LONGEST_SUM:
        return tape.called(np.cumsum, (a, axis), {})
    out, ahead = a.copy(), (slice(None),) * (axis % a.ndim)
    for last, own in pairwise([out[(*ahead, slice(k, k + 1))] for k in range(a.shape[axis])]):
        own += last
    return out


def _bincount(tape: Recorder, places: Any, weights: Any = None, minlength: int = 0) -> Any:
    if isinstance(places, Traced) or weights is None:
        raise Refused("places that depend on the state")
    if places.min(initial=0) < 0:
        raise Refused("places before the first one")
    out = np.zeros(max(minlength, int(places.max(initial=-1)) + 1))
    tape.core.apply(*codes("sadd"), out, weights, tape.keep(8 * places.astype(np.int64)))
    return out


def _kron(tape: Recorder, a: Any, b: Any) -> Any:
    ndim = max(np.ndim(a), np.ndim(b))
    m, n = ((1,) * (ndim - np.ndim(one)) + np.shape(one) for one in (a, b))
    ones = (1,) * ndim
    pairs = np.reshape(a, np.ravel([m, ones], "F")) * np.reshape(b, np.ravel([ones, n], "F"))
    return pairs.reshape(np.multiply(m, n))


def _broadcast_arrays(tape: Recorder, *arrays: Any) -> tuple[Any, ...]:
    shape = np.broadcast_shapes(*map(np.shape, arrays))
    return tuple(one if np.shape(one) == shape else np.broadcast_to(one, shape) for one in arrays)


def _round(tape: Recorder, a: Any, decimals: int = 0) -> Any:
    if decimals:
        raise Refused("digits after the point")
    return np.rint(a)


def _factors(tape: Recorder, a: Any) -> Any:
    """Write down the factors of matrices, which `_solution` reads; see ``_resolve.c``."""
    return tape.core.resolve(CODES["factor"], a)


def _solution(tape: Recorder, factors: Any, b: Any) -> Any:
    return tape.core.resolve(CODES["solve"], factors, b)


def _solve(tape: Recorder, a: Any, b: Any) -> Any:
    """Write down linear equations: large ones as a call of Python."""
    if b.ndim == 1:
        return _solve(tape, a, b[:, None])[..., 0]
    if a.ndim > 4 and a.shape[:-2] == b.shape[:-2]:
        flat = [one.reshape(-1, *one.shape[-2:]) for one in map(np.asarray, (a, b))]
        return _solve(tape, *flat).reshape(b.shape)
    if a.shape[-1] > LARGE or a.ndim > 4 or b.ndim > 4:
        return tape.called(np.linalg.solve, (a, b), {})
    a, b = (tape.cast(np.asarray(one), max(a.dtype, b.dtype)) for one in (a, b))
    return _solution(tape, _factors(tape, a), b)


class Inverse(Traced):
    """Inverses of matrices; a product with few columns is a solution, so that they need not be formed."""

    factors: Any = None

    def __matmul__(self, b: Any) -> Any:
        if self.factors is None or b.ndim < 2 or 2 * b.shape[-1] > b.shape[-2] or b.dtype > self.dtype:
            return super().__matmul__(b)
        return _solution(recorder(), self.factors, recorder().cast(b, self.dtype))


def _inv(tape: Recorder, a: Any) -> Any:
    if a.ndim > 4:
        return _inv(tape, a.reshape(-1, *a.shape[-2:])).reshape(a.shape)
    if a.shape[-1] > 3 * LARGE and a.dtype == REAL:  # of complex ones, few columns are asked for
        return tape.called(np.linalg.inv, (a,), {})
    factors = _factors(tape, a)
    found = _solution(tape, factors, np.eye(a.shape[-1], dtype=a.dtype)).view(Inverse)
    found.factors = factors
    found.flags.writeable = False  # its factors are not those of another matrix
    return found


def _eigh(tape: Recorder, a: Any) -> Any:
    n = a.shape[-1]
    if a.dtype != REAL or n > LARGE or a.ndim != 2:
        return tape.called(np.linalg.eigh, (a,), {})
    found = tape.core.resolve(CODES["modes"], a)
    return found[0], found[1:].T


def _qr(tape: Recorder, a: Any, mode: str = "reduced") -> Any:
    if a.dtype != REAL or a.ndim != 2 or mode != "complete":
        return tape.called(np.linalg.qr, (a, mode), {})
    Q = tape.core.resolve(CODES["basis"], a)
    return Q, Q.T @ a


def _norm(tape: Recorder, a: Any, ord: Any = None, axis: Any = None, keepdims: bool = False) -> Any:
    if ord is not None or axis is None or a.dtype != REAL:
        return tape.called(np.linalg.norm, (a, ord, axis, keepdims), {})
    return np.sqrt(np.sum(a * a, axis=axis, keepdims=keepdims))


def _like(name: str) -> Callable[..., Any]:
    return lambda tape, a, dtype=None: getattr(np, name)(a.shape, dtype or a.dtype)


FUNCTIONS: dict[Any, Callable[..., Any]] = {
    np.concatenate: _concatenate,
    np.stack: _stack,
    np.where: _where,
    np.dot: _dot,
    np.cumsum: _cumsum,
    np.einsum: _einsum,
    np.bincount: _bincount,
    np.linalg.solve: _solve,
    np.linalg.inv: _inv,
    np.linalg.eigh: _eigh,
    np.linalg.qr: _qr,
    np.linalg.norm: _norm,
    np.zeros_like: _like("zeros"),
    np.empty_like: _like("empty"),
    np.ones_like: _like("ones"),
    np.copy: lambda tape, a, **how: a.copy(),
    np.clip: lambda tape, a, low, high: np.minimum(np.maximum(a, low), high),
    np.full_like: lambda tape, a, value: tape.filled(a.shape, a.itemsize, value),
    np.broadcast_to: lambda tape, a, shape: np.broadcast_to(plain(a), shape).view(Traced),
    np.broadcast_arrays: _broadcast_arrays,
    np.round: _round,
    np.kron: _kron,
    np.outer: lambda tape, a, b: np.ravel(a)[:, None] * np.ravel(b),
    np.repeat: lambda tape, a, repeats, axis=None: a.repeat(repeats, axis),
    **{
        f: lambda tape, *args, f=f: f(*(plain(a) if isinstance(a, Traced) else a for a in args))
        for f in (np.isrealobj, np.iscomplexobj, np.ndim, np.shape, np.size, np.result_type)
    },
}
"""What is written down in a way of its own."""
TRANSPARENT = {
    *(np.sum, np.max, np.min, np.hstack, np.vstack, np.split, np.array_split, np.swapaxes),
    *(np.transpose, np.moveaxis, np.expand_dims, np.squeeze, np.reshape, np.ravel, np.take, np.real, np.imag),
    np.angle,
}
"""What is made of other operations alone."""

# ---------------------------------------------------------------------- recording


def _asarray(a: Any, dtype: Any = None, *args: Any, **how: Any) -> Any:
    if type(a) is Traced and dtype is None:
        return a
    if not is_traced(a):
        return ORIGINAL["asarray"](a, dtype, *args, **how)
    found = a if isinstance(a, Traced) else np.stack([_asarray(one) for one in a])
    return found if dtype is None else recorder().cast(found, np.dtype(dtype))


def _array(object: Any, dtype: Any = None, **how: Any) -> Any:
    if not is_traced(object):
        return ORIGINAL["array"](object, dtype, **how)
    if how.get("ndmin"):
        raise Refused("dimensions")
    found = _asarray(object, dtype)
    return found.copy() if found is object else found


def _contiguous(a: Any, dtype: Any = None, **how: Any) -> Any:
    if not is_traced(a):
        return ORIGINAL["ascontiguousarray"](a, dtype, **how)
    found = a if type(a) is Traced and (dtype is None or dtype == a.dtype) else _asarray(a, dtype)
    return found if found.flags.c_contiguous else found.copy()


def _made(name: str) -> Callable[..., Any]:
    """Return what makes an array in the memory of the tape, which is filled anew at every replay."""
    number = {"zeros": 0.0, "ones": 1.0}.get(name.split("_")[0])

    def make(*args: Any, **how: Any) -> Any:
        if name == "full" and Recording.tape is not None and any(map(is_traced, (*args, *how.values()))):
            raise Refused("full of a value of the state")
        found = ORIGINAL[name](*args, **how)
        if Recording.tape is None or isinstance(found, Traced) or found.dtype not in (REAL, COMPLEX):
            return found
        if name.startswith("empty"):
            return recorder().core.new(found.shape, found.itemsize)
        return recorder().filled(found.shape, found.itemsize, found if number is None else number)

    return make


MADE = ("zeros", "empty", "ones", "full")
REPLACED: dict[str, Callable[..., Any]] = {
    "asarray": _asarray,
    "array": _array,
    "ascontiguousarray": _contiguous,
    **{name: _made(name) for name in (*MADE, *(f"{name}_like" for name in MADE), "eye", "repeat")},
}
"""Functions of NumPy that its protocols do not reach: they stand in for them while something is recorded."""
NUMPY = vars(np)
"""Where these functions stand."""
ORIGINAL = {name: getattr(np, name) for name in REPLACED}


class _Turn:
    """Lets one thread record at a time: what stands in for functions of NumPy does so for all of them.

    The others go on meanwhile: for them these functions do what they always do.
    """

    def __init__(self) -> None:
        self.lock, self.owner = threading.RLock(), 0

    def forked(self) -> None:
        """Let a new process record, whatever a thread that it has not did when it began."""
        if self.owner != threading.get_ident():
            self.__init__()  # type: ignore[misc]
            _set(None)


_TURN = _Turn()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_TURN.forked)


def on_tape(tape: Recorder, function: Callable[[], _Result]) -> _Result:
    """Return what a function finds; what it does with the memory of a tape is written down.

    Signals raise where calls begin and end: a context manager might not even begin to end.
    """
    assert replay is not None
    with _TURN.lock:
        before, _TURN.owner = Recording.tape, threading.get_ident()
        try:
            _set(tape)
            return function()
        finally:  # nothing here calls what is written in Python
            Recording.tape = before
            try:
                NUMPY.update(ORIGINAL if before is None else REPLACED)
            finally:
                replay.record(None if before is None else before.core)


def _set(tape: Recorder | None) -> None:
    Recording.tape = tape
    NUMPY.update(ORIGINAL if tape is None else REPLACED)
    assert replay is not None
    replay.record(None if tape is None else tape.core)


Recorder.switch = staticmethod(_set)
Recorder.functions.update(FUNCTIONS)
Recorder.transparent.update(TRANSPARENT)
