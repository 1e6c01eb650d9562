"""How operations on traced arrays are written down: see `hfsim.maths.tape`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, ClassVar

import numpy as np

from hfsim.maths.arrays import IntArray
from hfsim.maths.tape import CODES, COMPLEX, KINDS, REAL, Tape, offsets
from hfsim.maths.traced import Refused, Traced, plain

_NAMES = {
    np.add: "add",
    np.subtract: "sub",
    np.multiply: "mul",
    np.true_divide: "div",
    np.maximum: "max",
    np.minimum: "min",
    np.power: "pow",
    np.arctan2: "at2",
    np.less: "lt",
    np.less_equal: "le",
    np.greater: "gt",
    np.greater_equal: "ge",
    np.equal: "eq",
    np.not_equal: "ne",
    np.negative: "neg",
    np.absolute: "abs",
    np.square: "sqr",
    np.sqrt: "sqrt",
    np.sin: "sin",
    np.cos: "cos",
    np.tan: "tan",
    np.exp: "exp",
    np.sinh: "sinh",
    np.cosh: "cosh",
    np.tanh: "tanh",
    np.log: "log",
    np.arcsin: "asin",
    np.arccos: "acos",
    np.arctan: "atan",
    np.sign: "sign",
    np.rint: "rint",
}


def codes(name: str) -> tuple[int, int]:
    """Return the codes of an operation on real numbers and on complex ones; -1 where there is none."""
    return CODES.get(f"{name}_d", -1), CODES.get(f"{name}_D", -1)


ELEMENTWISE = {ufunc: codes(name) for ufunc, name in _NAMES.items()}
COPY, WHERE, GATHER, SCATTER = map(codes, ("copy", "where", "gather", "scatter"))
ELEMENTWISE[np.conjugate] = COPY[0], CODES.get("conj_D", -1)
ELEMENTWISE[np.matmul] = 2 * (CODES.get("matmul", -1),)
REDUCED = {np.add: codes("radd"), np.maximum: codes("rmax"), np.minimum: codes("rmin")}

# ---------------------------------------------------------------------- operations


def _raw(tape: Tape, a: Traced) -> np.ndarray:
    """Return the memory of an operand."""
    if not tape.knows(a):
        raise Refused("memory of unknown origin")
    found = a.view(np.ndarray)
    found.flags.writeable = False
    return found


def _filled(tape: Tape, shape: tuple[int, ...], itemsize: int, value: Any) -> Any:
    """Return an array of such a value."""
    found = tape.core.new(shape, itemsize)
    tape.core.apply(*COPY, found, value)
    return found


def _cast(tape: Tape, a: Any, dtype: np.dtype[Any]) -> Any:
    """Return an array as one of such numbers."""
    if a.dtype == dtype:
        return a
    if (a.dtype, dtype) != (REAL, COMPLEX):
        raise Refused(f"{a.dtype} as {dtype}")
    return tape.core.apply(*COPY, tape.core.new(a.shape, dtype.itemsize), a)


def _ufunc(tape: Tape, ufunc: Any, method: str, inputs: Any, out: Any, how: dict[str, Any]) -> Any:
    if method == "reduce" and ufunc in REDUCED and out is None:
        return _reduce(tape, ufunc, *inputs, **how)
    if out is not None:
        raise Refused(f"{ufunc} into an array")
    return called(tape, getattr(ufunc, method), inputs, how)


def _reduce(
    tape: Tape, ufunc: Any, a: Any, axis: Any = 0, dtype: Any = None, out: Any = None, keepdims: Any = False,
    initial: Any = np._NoValue, where: Any = True,
) -> Any:  # fmt: skip
    if dtype is not None or out is not None or where is not True:
        raise Refused("a reduction")
    some = range(a.ndim) if axis is None else axis if isinstance(axis, tuple) else (axis,)
    axes = sum({1 << x % max(a.ndim, 1) for x in some})
    begin = None if initial is np._NoValue else initial
    if begin is None and ufunc is np.add:
        begin = 0.0
    return tape.core.reduce(*REDUCED[ufunc], a, axes, keepdims is not np._NoValue and keepdims, begin)


def _take(tape: Tape, a: Traced, key: Any) -> Any:
    return tape.core.apply(*GATHER, None, a, _places(tape, a, key))


def _put(tape: Tape, a: Traced, key: Any, value: Any) -> None:
    given = value if isinstance(value, np.ndarray) else np.asarray(value, dtype=a.dtype)
    if isinstance(given, Traced) and np.may_share_memory(plain(given), plain(a)):
        given = given.copy()
    places = _places(tape, a, key)
    if places.ndim > 1:
        ordered = np.sort(places, axis=None)
        if (ordered[1:] == ordered[:-1]).any():
            raise Refused("places that repeat")
    tape.core.apply(*SCATTER, a, _cast(tape, given, a.dtype), places)


def _places(tape: Tape, a: Traced, key: Any) -> IntArray:
    """Return how far entries are from the first one [bytes]."""
    if Traced in map(type, key if type(key) is tuple else (key,)):
        raise Refused("places that depend on the state")
    found: IntArray = tape.keep(offsets(a.shape, a.strides)[key])
    return found


@contextmanager
def _tried_on(memory: list[np.ndarray]) -> Iterator[None]:
    """For the time being, have numbers in memory with which functions work: identities, or ones."""
    try:
        for one in memory:
            square = one.ndim > 1 and one.shape[-1] == one.shape[-2]
            one[...] = np.eye(one.shape[-1]) if square else 1.0
        yield
    finally:
        for one in memory:
            one[...] = np.nan


def _bare(tape: Any, memory: list[np.ndarray], a: Any) -> Any:
    """Return an argument with plain arrays, whose memory is added to that of the others."""
    if isinstance(a, Traced):
        memory.append(plain(a))
        return _raw(tape, a)
    return type(a)(_bare(tape, memory, one) for one in a) if type(a) in (list, tuple) else a


def called(tape: Any, func: Any, args: Any, kwargs: Any) -> Any:
    """Do a function and write it down as a call of Python on the same memory."""
    memory: list[np.ndarray] = []
    bare = partial(_bare, tape, memory)
    args, kwargs = bare(tuple(args)), {name: bare(value) for name, value in kwargs.items()}
    with _tried_on(memory):
        value = tape.plainly(func, *args, **kwargs)
    if isinstance(value, np.ndarray) and tape.knows(value):
        if not value.size and any(one.size for one in memory):
            raise Refused(f"{func} finds nothing")  # in another state it may find something
        return value.view(Traced)
    several = isinstance(value, list | tuple)
    values = [np.asarray(one) for one in (value if several else [value])]
    if any(one.dtype not in KINDS for one in values) or (not several and isinstance(value, bool | np.bool_)):
        raise Refused(f"{func}")
    outs = [tape.own(one) for one in values]
    targets = [plain(one) for one in outs]

    tape.told.append(getattr(func, "__qualname__", str(func)))

    def again() -> None:
        found = func(*args, **kwargs)
        for target, one in zip(targets, found if several else [found], strict=True):
            target[...] = np.reshape(one, target.shape)

    tape.call(again, *memory)
    if not several:
        return outs[0]
    return type(value)(*outs) if hasattr(value, "_fields") else type(value)(outs)


class Recorder(Tape):
    """A tape that traced arrays write on."""

    operations = ELEMENTWISE
    ufunc = _ufunc
    reduce = _reduce
    take = _take
    put = _put
    filled = _filled
    cast = _cast
    called = called
    switch: Callable[[Any], None] = staticmethod(lambda tape: None)
    """Makes a tape, or none, the one that records."""
    functions: ClassVar[dict[Any, Callable[..., Any]]] = {}
    """Functions of NumPy that are written down in a way of their own."""
    transparent: ClassVar[set[Any]] = set()
    """Those that are made of other operations alone."""

    def function(self, func: Any, args: Any, kwargs: Any) -> Any:
        """Do a function of NumPy and write it down."""
        own = self.functions.get(func)
        if own is not None:
            return own(self, *args, **kwargs)
        if func in self.transparent:
            return func._implementation(*args, **kwargs)
        return called(self, func, args, kwargs)

    def plainly(self, function: Callable[..., Any], *args: Any, **how: Any) -> Any:
        """Return what a function finds, and write nothing down."""
        try:
            self.switch(None)
            return function(*args, **how)
        finally:
            self.switch(self)
